"""What templates and the code that draws must not do, whatever they are given."""

import re
from pathlib import Path

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client

from leaderboard.models import Edition, User
from tests import builders, pages

REPOSITORY = Path(__file__).resolve().parents[2]
TEMPLATES = sorted((REPOSITORY / "templates").rglob("*.html"))
CODE = sorted((REPOSITORY / "leaderboard").rglob("*.py"))
# Texts from people that become addresses of links.
# The address of the code of a dataset is the site's own.
PEOPLES_LINKS = re.compile(r'<a\b[^>]*href="\{\{\s*(?!dataset\.)[\w.]*(?:paper_url|code_url)\b[^>]*>')


def test_no_template_takes_text_for_markup() -> None:
    assert len(TEMPLATES) > 40
    script = r"<script(?![^>]*\bsrc=)(?! type=\"application/ld\+json\">)"
    trusting = re.compile(rf"\|\s*safe\b|\|\s*safeseq\b|autoescape\s+off|{script}|javascript:")
    matches = {
        str(path.relative_to(REPOSITORY)): trusting.findall(path.read_text())
        for path in TEMPLATES
        if trusting.search(path.read_text())
    }
    assert matches == {}


def test_every_text_in_data_for_search_engines_is_escaped_for_a_script() -> None:
    data = re.compile(r'<script type="application/ld\+json">(.*?)</script>', re.DOTALL)
    blocks = [text for path in TEMPLATES for text in data.findall(path.read_text())]
    filled = [name for text in blocks for name in re.findall(r"{{(.*?)}}", text)]
    assert filled
    assert [name for name in filled if not name.strip().endswith("|escapejs")] == []


# The place that trusts a text which is not empty has what a parser made of Markdown, which escapes all markup
# in it. All others join pieces by `format_html_join`, which escapes what is no markup already.
TRUSTING = {
    "leaderboard/web/markdown.py": ["SafeString(html)"],
    # A line break between lines that are escaped.
    "leaderboard/web/formatting.py": ['SafeString("<br>"), "{}", lines))'],
}


@pytest.mark.slow
def test_no_code_takes_text_for_markup() -> None:
    trusting = re.compile(r"\bmark_safe\(|\bSafeText\(|__html__|autoescape=False")
    not_empty = re.compile(r"\bSafeString\((?!\"\"\)).*")
    texts = {str(path.relative_to(REPOSITORY)): path.read_text() for path in CODE}
    assert [path for path, text in texts.items() if trusting.search(text)] == []
    assert {path: matches for path, text in texts.items() if (matches := not_empty.findall(text))} == TRUSTING


def test_every_attribute_that_a_template_fills_in_is_quoted() -> None:
    bare = re.compile(r"<[a-zA-Z][^<>]*\s[\w-]+=\{\{")
    assert [str(path) for path in TEMPLATES if bare.search(path.read_text())] == []


def test_links_that_people_gave_are_marked_in_every_template() -> None:
    links = [link for path in TEMPLATES for link in PEOPLES_LINKS.findall(path.read_text())]
    assert links
    assert [link for link in links if 'rel="nofollow ugc"' not in link] == []


@pytest.mark.slow
def test_links_that_people_gave_are_marked_on_every_page(edition: Edition, owner: User) -> None:
    sent = builders.submit(
        owner,
        builders.predictions(edition),
        paper_url="https://elsewhere.example/paper",
        code_url="http://elsewhere.example/code?a=1&b=<2>".replace("<2>", "2"),
    )
    builders.score_all()
    n_links = 0
    for path in ("/", "/board/test/", f"/methods/{sent.method_id}/", "/board/test/editions/1/"):
        for link in pages.page(Client().get(path)).all("a"):
            if "elsewhere.example" in link.attributes["href"]:
                n_links += 1
                assert link.attributes.get("rel") == "nofollow ugc", path
    assert n_links >= 4


@pytest.mark.parametrize(
    "address",
    [
        "javascript:alert(1)",
        "data:text/html,<script>alert(1)</script>",
        "//elsewhere.example/x",
        "https://user@",
        "\u202ehttps://x.example/",
        "https://x.example/\r\nSet-Cookie: a=b",
        "java\nscript:alert(1)",
    ],
)
def test_no_other_scheme_becomes_a_link(edition: Edition, owner: User, address: str) -> None:
    client = Client(headers={"Authorization": f"Bearer {builders.token(owner)}"})
    file = SimpleUploadedFile("p.json", builders.predictions(edition))
    form = {"split": "test", "method": "Foo", "paper_url": address, "file": file}
    response = client.post("/api/v1/submissions", form)
    assert response.status_code == 422
    assert response.json()["code"] in {"bad-address", "bad-character"}
