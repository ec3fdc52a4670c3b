"""People and programs that use a site: one with a web browser's habits, one with a token."""

import html
import re
from typing import Any

import httpx2

from tests.journeys.production import TIMEOUT_S, Site, await_that

FINAL = {"SCORED", "REJECTED", "SYSTEM_ERROR", "CANCELLED"}
PASSWORD = "journey-of-a-thousand-miles"


class Visitor:
    """Fills in the site's forms: keeps cookies, follows redirections, sends the CSRF token of each form
    back.
    """

    def __init__(self, site: Site) -> None:
        self.site = site
        # Loopback is never reached through a proxy that the environment names.
        self.http = httpx2.Client(
            base_url=site.url, follow_redirects=True, timeout=TIMEOUT_S, trust_env=False
        )

    def get(self, path: str) -> httpx2.Response:
        answer = self.http.get(path)
        assert answer.status_code < 500, answer.text
        return answer

    def post_form(
        self, path: str, fields: dict[str, str], file: tuple[str, bytes] | None = None
    ) -> httpx2.Response:
        """Load the page, fill in its form, send it."""
        page = self.get(path)
        token = re.search(r'name="csrfmiddlewaretoken" value="([^"]+)"', page.text)
        assert token, f"{path} has no form with a CSRF token"
        answer = self.http.post(
            path,
            data={**fields, "csrfmiddlewaretoken": token[1]},
            files={"file": (*file, "application/json")} if file else None,
            headers={"Referer": f"{self.site.url}{path}"},
        )
        assert answer.status_code < 500, answer.text
        return answer

    def sign_up(self, *, email: str, name: str) -> None:
        """Make an account and enter the code of the mail, which signs in."""
        answer = self.post_form(
            "/accounts/signup/",
            {"email": email, "name": name, "password1": PASSWORD, "password2": PASSWORD},
        )
        # Workers send others theirs meanwhile.
        mails = [
            mail for mail in self.site.mails if re.search(f"^To: {re.escape(email)}$", mail, re.MULTILINE)
        ]
        assert len(mails) == 1, answer.text
        code = re.search(r"^([A-Z]{4}-[A-Z]{4})$", mails[0], re.MULTILINE)
        assert code, mails[0]
        answer = self.post_form("/accounts/confirm-email/", {"code": code[1]})
        assert answer.url.path == "/submit/", answer.text

    def submit(self, *, split: str, method: str, data: bytes, **more: str) -> str:
        """Upload a file through the form; returns the submission's id."""
        fields = {"split": split, "method": method, **more}
        answer = self.post_form("/submit/", fields, file=("predictions.json", data))
        question = re.search(r'<input type="checkbox" name="confirmed"[^>]* value="([^"]+)"', answer.text)
        if question:
            # The page asks about warnings and about names and bytes that it knows; this person means it.
            fields["confirmed"] = html.unescape(question[1])
            answer = self.post_form("/submit/", fields, file=("predictions.json", data))
        match = re.fullmatch(r"/submissions/([0-9a-f-]{36})/", answer.url.path)
        assert match, answer.text
        return match[1]

    def show(self, submission: str) -> None:
        """Make a submission's method public: look at what others will see, say that one knows, confirm."""
        link = re.search(r"/methods/[0-9a-f-]{36}/", self.get(f"/submissions/{submission}/").text)
        assert link
        path = f"{link[0]}visibility/"
        preview = self.get(f"{path}?visibility=PUBLIC")
        assert "I understand that this cannot be undone." in preview.text
        answer = self.post_form(path, {"visibility": "PUBLIC", "confirm": "on"})
        assert answer.url.path == link[0], answer.text

    def text_of(self, path: str) -> str:
        """A page's words, without its markup."""
        marked = re.sub(r"</?strong>|<wbr>", "", self.get(path).text)  # inside of a sentence or a word
        text = re.sub(r"<(script|style).*?</\1>|<[^>]+>", " ", marked, flags=re.DOTALL)
        return re.sub(r"\s+", " ", html.unescape(text))

    def close(self) -> None:
        self.http.close()


class Program:
    """A CI job: speaks to the API with a token, or as a signed-in visitor's session."""

    def __init__(self, site: Site, *, email: str) -> None:
        scopes = (f"--scope={scope}" for scope in ("read", "submit", "publish"))
        token = site.manage("create_token", email, "--name", "journey", *scopes).strip()
        self.http = httpx2.Client(
            base_url=site.url,
            headers={"Authorization": f"Bearer {token}"},
            timeout=TIMEOUT_S,
            trust_env=False,
        )

    def submit(self, *, split: str, method: str, data: bytes) -> str:
        """Upload a file; returns the submission's id."""
        answer = self.http.post(
            "/api/v1/submissions",
            data={"split": split, "method": method},
            files={"file": ("predictions.json", data, "application/json")},
        )
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def show(self, submission_id: str) -> None:
        """Make a submission's method public."""
        method_id = self.http.get(f"/api/v1/submissions/{submission_id}").json()["method_id"]
        answer = self.http.post(
            f"/api/v1/methods/{method_id}/visibility", json={"visibility": "PUBLIC", "confirm": True}
        )
        assert answer.status_code == 200, answer.text

    def outcome(self, submission_id: str) -> dict[str, Any]:
        """The submission as the API tells of it, once nothing changes any more."""
        answers: list[dict[str, Any]] = []

        def is_final() -> bool:
            answer = self.http.get(f"/api/v1/submissions/{submission_id}")
            assert answer.status_code == 200, answer.text
            answers.append(answer.json())
            return answers[-1]["state"] in FINAL

        await_that(is_final, what=f"submission {submission_id} is decided")
        return answers[-1]

    def board(self, split: str) -> list[dict[str, Any]]:
        """The entries of a board, in rank order."""
        answer = self.http.get(f"/api/v1/splits/{split}/board")
        assert answer.status_code == 200, answer.text
        return list(answer.json()["entries"])

    def close(self) -> None:
        self.http.close()
