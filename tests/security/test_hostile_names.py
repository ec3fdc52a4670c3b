"""Any name that a person gives: refused in words, or shown as a name and as nothing else, everywhere."""

import csv
import io
import json
import os
import re
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import pytest
from django.test import Client
from django.utils import timezone
from pytest_django.fixtures import Settings

from evaluator.tables.escaping import guarded
from leaderboard.models import Edition, Method, Split, Status, User, Visibility
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import RunResult
from tests import builders, pages
from tests.leaderboard.web.test_every_page import assert_nothing_from_elsewhere, assert_nothing_inline
from tests.security.hostile_names import NAMES
from tests.security.people import browser_of, program_of

pytestmark = pytest.mark.slow

WHOLE = os.environ.get("TSTTC_SECURITY_WHOLE") == "1"
# At every form and address; as names of methods all of them are sent.
SOME = NAMES if WHOLE else NAMES[::5]
FORMULA = re.compile(r"^\s*[=+\-@\t\r\n＝＋－＠]")
NUMBER = re.compile(r"^-?\d+(?:\.\d+)?$")
RUN_BY_LATEX = re.compile(r"\\(?:input|write|immediate|openout|end|begin|include|def|catcode)\b")
PLAIN_FILE_NAME = re.compile(r'^(?:attachment|inline); filename="[A-Za-z0-9._-]+"$')
SCORES = {("mid", "overall"): 14.5, ("rte", "overall"): 9.25}


@dataclass
class Named:
    """A board of methods with all the names that were taken."""

    owner: User
    names: list[str]
    refused: list[str]


def raw(name: str) -> bytes:
    """The bytes that a careless client sends, also of half a character."""
    return name.encode("utf-8", "surrogatepass")


def send(client: Client, path: str, fields: dict[str, bytes], data: bytes, *, filename: bytes) -> Any:
    """A form as bytes, so that nothing sets right what is wrong with them."""
    quoted = filename[:300].translate(None, b'"\\\r\n') or b"x"
    parts = [b'name="%s"\r\n\r\n%s' % (name.encode(), value) for name, value in fields.items()]
    parts.append(b'name="file"; filename="%s"\r\nContent-Type: application/json\r\n\r\n%s' % (quoted, data))
    body = b"".join(b"--bound\r\nContent-Disposition: form-data; %s\r\n" % part for part in parts)
    return client.generic("POST", path, body + b"--bound--\r\n", "multipart/form-data; boundary=bound")


@pytest.fixture
def named(edition: Edition, owner: User, settings: Settings) -> Named:
    """Every name sent as a method's, with the same as its description, note, commit and file name."""
    settings.QUOTAS = False
    Split.objects.update(quota_limit=None, quota_rejected_limit=None)
    program, browser = program_of(owner), browser_of(owner)
    data = builders.predictions(edition)
    refused = []
    for n, name in enumerate(NAMES):
        texts = dict.fromkeys(("method", "description", "note"), raw(name))
        client, path = ((program, "/api/v1/submissions"), (browser, "/submit/"))[n % 2]
        response = send(client, path, {"split": b"test", **texts}, data, filename=raw(name))
        body = response.content.decode()
        if response.status_code in {400, 422} and (
            "looks like" in body or "Nothing is submitted yet" in body
        ):
            # Punctuation makes no name another one, a word of its own does. A page asks about names that are
            # close and about the same bytes; a program is not asked.
            check_refusal(response)
            texts["method"] = raw(f"{name} {''.join('bdfghkmnpr'[int(digit)] for digit in str(n))}")
            response = send(
                program, "/api/v1/submissions", {"split": b"test", **texts}, data, filename=raw(name)
            )
        assert response.status_code in {200, 201, 302, 400, 422}, (name, response.status_code)
        if response.status_code in {400, 422}:
            refused.append(name)
            check_refusal(response)
    leases = lifecycle.claim(lease_s=60, wall_s=60, limit=1000)
    outcome = RunResult(status=Status.SCORED, scores=SCORES, report={"counts": {}, "truncated": {}})
    lifecycle.finalise_many([(lease, outcome) for lease in leases])
    Method.objects.update(visibility=Visibility.PUBLIC, shown_at=timezone.now())
    return Named(owner=owner, names=list(Method.objects.values_list("name", flat=True)), refused=refused)


def check_refusal(response: object) -> None:
    """Check that a refusal is a problem, or a page, that says what was found and expected."""
    kind = response.headers["Content-Type"]  # type: ignore[attr-defined]  # a response of any client
    body: bytes = response.content  # type: ignore[attr-defined]  # as above
    if kind.startswith("application/problem+json"):
        problem = json.loads(body)
        assert problem["problems"][0]["message"], problem
        assert problem["detail"].isprintable(), problem
    else:
        assert kind.startswith("text/html")
        pages.read(body.decode())


def test_names_are_names_on_every_board_in_every_form(named: Named) -> None:
    assert len(named.names) > 80
    assert len(named.refused) > 60
    visitor = Client()
    _in_json(visitor, named)
    _in_csv(visitor, named)
    _in_latex(visitor)
    _in_markdown(visitor)
    _in_xml(visitor)
    shown = "".join(_in_html(visitor))
    _on_its_own_page(Client(), named)
    missing = [name for name in named.names if " ".join(name.split()) not in shown]
    assert missing == []


def _in_html(visitor: Client) -> list[str]:
    """Sound pages, with nothing in them that a name has brought."""
    texts = []
    for number in range(1, 9):
        response = visitor.get(f"/board/test/?page={number}")
        assert response.status_code == 200
        root = assert_clean(response)
        texts.append(root.one("main").text)
        assert not [link for link in root.all("a") if "x.example" in link.attributes.get("href", "")]
        for script in root.one("main").all("script"):
            assert script.attributes.get("src") or script.attributes["type"] == "application/json"
    charts = visitor.get("/board/test/charts/")
    assert charts.status_code == 200
    for element in assert_clean(charts).everything():
        assert element.tag not in {"img", "iframe", "foreignobject", "base"}
    return texts


def assert_clean(response: Any) -> pages.Element:
    """A page whose tags nest, that runs and styles nothing in place, and fetches nothing from elsewhere."""
    root = pages.page(response)
    assert_nothing_inline(root.one("html"))
    assert_nothing_from_elsewhere(root.one("html"))
    return root


def _in_json(visitor: Client, named: Named) -> None:
    entries = visitor.get("/api/v1/splits/test/board").json()["entries"]
    assert set(named.names) <= {entry["method"] for entry in entries}


def _in_csv(visitor: Client, named: Named) -> None:
    response = visitor.get("/board/test.csv")
    rows = list(csv.DictReader(io.StringIO(response.content.decode())))
    names = {row["method"] for row in rows}
    assert {guarded(name) for name in named.names} <= names
    bad = [cell for row in rows for cell in row.values() if FORMULA.match(cell) and not NUMBER.match(cell)]
    assert bad == []
    # As a spreadsheet reads it that splits lines elsewhere: no cell runs there, either.
    for separator in ";\t":
        cells = [
            c for row in csv.reader(io.StringIO(response.content.decode()), delimiter=separator) for c in row
        ]
        assert [cell for cell in cells if FORMULA.match(cell) and not NUMBER.match(cell)] == []
    assert PLAIN_FILE_NAME.match(response.headers["Content-Disposition"])


def _in_latex(visitor: Client) -> None:
    """Each row has as many columns as the others, braces close, and nothing is run."""
    response = visitor.get("/board/test.tex")
    text = response.content.decode()
    inner = text.split("\\midrule")[1].split("\\bottomrule")[0]
    rows = [line for line in inner.splitlines() if line.rstrip().endswith("\\\\")]
    assert len(rows) > 80
    columns = {len(re.findall(r"(?<!\\)&", line)) for line in rows}
    assert len(columns) == 1, columns
    for line in rows:
        bare = re.sub(r"\\[\\{}%$&#_^~]", "", line.replace("\\textbackslash", ""))
        assert bare.count("{") == bare.count("}"), line
        assert not RUN_BY_LATEX.search(line), line
        assert not re.search(r"(?<!\\)[%#]|\^\^", bare), line


def _in_markdown(visitor: Client) -> None:
    lines = visitor.get("/board/test.md").content.decode().splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert len(rows) > 80
    assert len({len(re.findall(r"(?<!\\)\|", line)) for line in rows}) == 1
    assert not [line for line in rows if re.search(r"<script|(?<!\\)\]\(http://x\.example", line)]


def _in_xml(visitor: Client) -> None:
    feed = visitor.get("/board/test/feed.atom")
    assert ElementTree.fromstring(feed.content).tag.endswith("feed")
    for pk in Method.objects.values_list("pk", flat=True):
        badge = visitor.get(f"/methods/{pk}/badge.svg")
        assert badge.status_code == 200
        drawn = ElementTree.fromstring(badge.content)
        assert not [each for each in drawn.iter() if each.tag.endswith(("script", "foreignObject", "image"))]


def _on_its_own_page(reader: Client, named: Named) -> None:
    reader.force_login(named.owner)
    for method in Method.objects.all()[:: 1 if WHOLE else 3]:
        response = reader.get(f"/methods/{method.pk}/")
        assert response.status_code == 200, method.name
        assert "\r" not in str(response.headers)
        assert_clean(response)


@pytest.mark.parametrize(
    ("path", "form"),
    [
        ("/tokens/", {"name": None, "scopes": "read", "days": "90"}),
        ("/team/", {"name": None}),
        ("/accounts/signup/", {"email": "new@example.org", "name": None, "password1": "x", "password2": "x"}),
        ("/accounts/signup/", {"email": None, "name": "x", "password1": "x", "password2": "x"}),
        ("/accounts/login/", {"login": None, "password": None}),
        ("/accounts/password/reset/", {"email": None}),
    ],
)
def test_forms_take_any_text(
    edition: Edition, owner: User, settings: Settings, path: str, form: dict[str, str | None]
) -> None:
    settings.ACCOUNT_RATE_LIMITS = False
    browser = Client(raise_request_exception=False)
    if not path.startswith("/accounts/"):
        browser.force_login(owner)
        browser.post("/accounts/reauthenticate/", {"password": "correct horse", "next": path})
    for name in SOME:
        sent = {field: raw(name) if value is None else value for field, value in form.items()}
        response = browser.post(path, sent)
        assert response.status_code < 500, (path, name)


@pytest.mark.parametrize("part", ["query", "path", "header"])
def test_addresses_and_headers_take_any_text(edition: Edition, part: str) -> None:
    visitor = Client(raise_request_exception=False)
    for name in SOME:
        text = raw(name[:2000])
        if part == "query":
            encoded = "".join(f"%{byte:02X}" for byte in text)
            paths = [f"/board/test/?q={encoded}&sort={encoded}", f"/api/v1/splits/test/board?at={encoded}"]
        else:
            encoded = "".join(f"%{byte:02X}" for byte in text[:200])
            paths = [f"/board/{encoded}/", f"/methods/{encoded}/", f"/api/v1/splits/{encoded}/board"]
        headers = {}
        if part == "header":
            paths = ["/", "/api/v1/submissions"]
            line = text.decode("latin-1").replace("\r", "").replace("\n", "")
            headers = dict.fromkeys(
                ("Accept", "User-Agent", "If-None-Match", "Cookie", "Authorization"), line
            )
        for path in paths:
            response = visitor.get(path, headers=headers)
            assert response.status_code < 500, (path, name)
