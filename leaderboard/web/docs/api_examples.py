"""An example of each operation of the API, by curl, `tsttc` and Python, and its answer.

`tests/api_examples.py` sends every request and records the answers in `api_answers.json`, with constant ids,
times and signatures, and only the first member of a long list.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent
from typing import Any, Final
from urllib.parse import urlencode

from django.conf import settings

SITE: Final = "https://leaderboard.example.org"
"""The site of the recorded answers; a page shows its own instead."""
SUBMISSION: Final = "0f8b1c2d-3e4f-4a5b-8c6d-7e8f9a0b1c2d"
MISNAMED: Final = "3f2504e0-4f89-41d3-9a0c-0305e82c3301"
METHOD: Final = "7c9e6679-7425-4de9-944b-e07fc1f90ae7"
OTHER: Final = "550e8400-e29b-41d4-a716-446655440000"
DRAFT: Final = "16fd2706-8baf-433b-82eb-8c7fada847da"
NOBODYS: Final = "6ba7b810-9dad-41d1-80b4-00c04fd430c8"
_FORM: Final = {"split": "val", "method": "Deep TTC"}
_ANSWERS: Final = Path(__file__).with_name("api_answers.json")


@dataclass(frozen=True)
class Call:
    """A request: `form` goes as multipart with the file, `body` as JSON."""

    method: str
    path: str
    query: tuple[tuple[str, str], ...] = ()
    body: Mapping[str, Any] | None = None
    form: Mapping[str, str] | None = None
    has_file: bool = False
    has_token: bool = True
    bearer: str = "$TSTTC_TOKEN"

    @property
    def target(self) -> str:
        return f"{self.path}?{urlencode(self.query)}" if self.query else self.path

    def curl(self, site: str) -> str:
        parts = [f'curl "{site}{self.target}"']
        if self.method not in {"GET", "POST"} or (self.method == "POST" and not (self.form or self.body)):
            parts[0] = f'curl -X {self.method} "{site}{self.target}"'
        if self.has_token:
            parts.append(f'-H "Authorization: Bearer {self.bearer}"')
        parts += [f"--form-string {name}='{text}'" for name, text in (self.form or {}).items()]
        if self.has_file:
            parts.append("-F file=@predictions.json")
        if self.body is not None:
            parts += ["-H 'Content-Type: application/json'", f"-d '{json.dumps(self.body)}'"]
        return " \\\n  ".join(parts)


@dataclass(frozen=True)
class Example:
    """An accepted request, a refused one, and the same by command line and Python."""

    call: Call
    refused: Call
    command: str = ""
    python: str = ""
    by: str = "owner"  # who asks: "maintainer" has a token of theirs

    def script(self, site: str) -> str:
        """Return the Python code, if any."""
        if not self.python:
            return ""
        token = ', token=os.environ["TSTTC_TOKEN"]' if self.call.has_token else ""
        imports = "import os\n\nimport evaluator\n\n" if token else "import evaluator\n\n"
        lines = self.python if "\n" in self.python else f"print({self.python})"
        where = f'\n    url="{site}"{token}\n' if token else f'url="{site}"'
        return f"{imports}with evaluator.Client({where}) as client:\n{indent(lines, '    ')}"


def _get(path: str, *query: tuple[str, str], has_token: bool = False) -> Call:
    return Call("GET", f"/api/v1/{path}", query, has_token=has_token)


def _own(path: str, *query: tuple[str, str]) -> Call:
    return _get(path, *query, has_token=True)


def _send(method: str, path: str, *, has_token: bool = True, **parts: Any) -> Call:
    return Call(method, f"/api/v1/{path}", has_token=has_token, **parts)


EXAMPLES: Final[Mapping[str, Example]] = {
    # The order is that in which they are sent: what reads comes before what changes.
    "list_splits": Example(_get("splits"), _send("GET", "splits", bearer="wrong")),
    "board": Example(
        _get("splits/val/board", ("sort", "rte"), ("intervals", "1")),
        _get("splits/val/board", ("sort", "speed")),
        "tsttc board val --sort rte --intervals",
        'client.board("val", sort="rte", has_intervals=True)',
    ),
    "changelog": Example(
        _get("splits/val/changelog", ("limit", "10")), _get("splits/val/changelog", ("limit", "0"))
    ),
    "list_editions": Example(_get("splits/val/editions"), _get("splits/val/editions", ("after", "x"))),
    "edition_board": Example(
        _get("splits/val/editions/1/board"),
        _get("splits/val/editions/99/board"),
        "tsttc board val --edition 1",
        'client.board("val", edition=1)',
    ),
    "list_published_tables": Example(
        _get("published"), _send("GET", "published", bearer="wrong"), "tsttc published --json"
    ),
    "published_table": Example(
        _get("published/ablation-frame-gap"),
        _get("published/nowhere"),
        "tsttc published ablation-frame-gap",
    ),
    "manifest": Example(
        _get("splits/val/manifest"),
        _get("splits/nowhere/manifest"),
        "tsttc manifest --split val",
        'client.manifest("val")',
    ),
    "croissant": Example(_get("splits/val/croissant"), _get("splits/nowhere/croissant")),
    "compare": Example(
        _get("compare", ("split", "val"), ("m", METHOD), ("m", OTHER)),
        _get("compare", ("split", "val"), ("m", METHOD)),
        "",
        f'client.compare("val", ["{METHOD}", "{OTHER}"])',
    ),
    "method": Example(
        _get(f"methods/{METHOD}"), _get(f"methods/{NOBODYS}"), "", f'client.method("{METHOD}")'
    ),
    "list_methods": Example(
        _own("methods", ("limit", "1")), _get("methods"), "tsttc methods", "list(client.methods())"
    ),
    "account": Example(_own("account"), _get("account"), "tsttc whoami", "client.account()"),
    "quota": Example(_own("quota"), _get("quota"), "tsttc quota", "client.quota()"),
    "list_submissions": Example(
        _own("submissions", ("limit", "1")),
        _own("submissions", ("after", "x")),
        "tsttc submissions",
        "list(client.submissions())",
    ),
    "submission": Example(
        _own(f"submissions/{SUBMISSION}"),
        _own(f"submissions/{NOBODYS}"),
        f"tsttc status {SUBMISSION} --watch",
        f'client.submission("{SUBMISSION}")',
    ),
    "receipt": Example(
        _own(f"submissions/{SUBMISSION}/receipt"),
        _own(f"submissions/{SUBMISSION}/receipt", ("edition", "99")),
        f"tsttc receipt {SUBMISSION}",
        f'client.receipt("{SUBMISSION}")',
    ),
    "move": Example(
        _send("POST", f"submissions/{MISNAMED}/move", body={"method": "Draft net"}),
        _send("POST", f"submissions/{MISNAMED}/move", body={"method": "Darft net"}),
        f'tsttc move {MISNAMED} --method "Draft net"',
        f'client.move("{MISNAMED}", method="Draft net")',
    ),
    "submission_file": Example(
        _own(f"submissions/{SUBMISSION}/file"),
        _own(f"submissions/{NOBODYS}/file"),
        f"tsttc download {SUBMISSION} -o predictions.json",
        f'client.file("{SUBMISSION}")',
    ),
    "preview_visibility": Example(
        _own(f"methods/{DRAFT}/visibility", ("as", "ANONYMOUS")),
        _own(f"methods/{DRAFT}/visibility", ("as", "EVERYONE")),
        "",
        f'client.visibility_preview("{DRAFT}", "ANONYMOUS")',
    ),
    "edit_method": Example(
        _send("PATCH", f"methods/{DRAFT}", body={"n_frames": 6, "cameras": "ONE"}),
        _send("PATCH", f"methods/{DRAFT}", body={"n_frames": -1}),
    ),
    "show_method": Example(
        _send(
            "POST",
            f"methods/{DRAFT}/visibility",
            body={"visibility": "ANONYMOUS", "confirm": True},
        ),
        _send("POST", f"methods/{DRAFT}/visibility", body={"visibility": "PUBLIC"}),
        f"tsttc publish {DRAFT} --as anonymous",
        f'client.show_method("{DRAFT}", "ANONYMOUS")',
    ),
    "submit": Example(
        _send(
            "POST",
            "submissions",
            form={"split": "val", "method": "Deep TTC", "note": "lr 1e-4"},
            has_file=True,
        ),
        _send("POST", "submissions", form=_FORM),
        'tsttc submit predictions.json --split val --method "Deep TTC" \\\n  --note "lr 1e-4" --wait',
        'client.submit("predictions.json", split="val", method="Deep TTC")',
    ),
    "withdraw": Example(
        _send("POST", f"submissions/{SUBMISSION}/withdraw"),
        _send("POST", f"submissions/{NOBODYS}/withdraw"),
        f"tsttc withdraw {SUBMISSION}",
        f'client.withdraw("{SUBMISSION}")',
    ),
    "edition_progress": Example(
        _own("splits/val/editions/2/progress"), _get("splits/val/editions/2/progress"), by="maintainer"
    ),
    "edition_preview": Example(
        _own("splits/val/editions/2/preview"), _get("splits/val/editions/2/preview"), by="maintainer"
    ),
    "revoke_token": Example(
        _send("POST", "tokens/revoke", has_token=False, body={"token": "tsttc_0123456789abcdef"}),
        _send("POST", "tokens/revoke", has_token=False, body={}),
    ),
}


def shown(operation_id: str) -> dict[str, Any]:
    """Return the examples of an operation for its page."""
    example, recorded = EXAMPLES[operation_id], json.loads(_ANSWERS.read_text(encoding="utf-8"))[operation_id]
    return {
        "curl": example.call.curl(settings.SITE_URL),
        "command": example.command,
        "python": example.script(settings.SITE_URL),
        "answer": _answer(recorded["answer"]),
        "refused_curl": example.refused.curl(settings.SITE_URL),
        "refused": _answer(recorded["refused"]),
        "refused_code": recorded["refused"]["body"]["code"],
    }


def _answer(recorded: Mapping[str, Any]) -> dict[str, Any]:
    body = recorded["body"]
    text = body if isinstance(body, str) else json.dumps(body, indent=2, ensure_ascii=False)
    ours = {name: value.replace(SITE, settings.SITE_URL) for name, value in recorded["headers"].items()}
    return {"status": recorded["status"], "headers": ours, "body": text.replace(SITE, settings.SITE_URL)}
