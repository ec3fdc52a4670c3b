"""Rows quoted from papers stand since the day they were added: what was shown before never changes."""

import json
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone

from leaderboard.editions import papers, splits
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, PublishedResult
from leaderboard.models.benchmark import SINCE_EVER
from tests import pages
from tests.editions import board_now, corrected, open_edition, paper, publish, quote, roll_back
from tests.leaderboard.web.test_every_page import assert_sound

FORMS = ("/board/test/editions/1/", "/board/test/editions/1.csv", "/board/test/editions/1.tex")
A_DAY = timedelta(days=1)
PAGE = "/maintain/published/"
# What a page of the past says of the present board.
CHANGES = re.compile(rb'<section aria-labelledby="changes">.*?</section>', re.DOTALL)
N_CHANGES = re.compile(rb"(?<=changes since then&nbsp;)\(\d+\)")


def representations(client: Client, at: datetime) -> dict[str, bytes]:
    """A board of the past and an earlier edition, in every format."""
    moment = f"{at.astimezone(UTC):%Y-%m-%dT%H:%M:%S.%fZ}"
    past = [f"/board/test{form}?at={moment}" for form in ("/", ".csv", ".tex", ".md")]
    api = [f"/api/v1/splits/test/board?at={moment}", "/api/v1/splits/test/editions/1/board"]
    addresses = [*past, *api, *FORMS, "/board/test/editions/1.md", "/board/test/?at=2020-01-01"]
    responses = {address: client.get(address) for address in addresses}
    assert {response.status_code for response in responses.values()} == {200}
    return {
        address: N_CHANGES.sub(b"", CHANGES.sub(b"", response.content))
        for address, response in responses.items()
    }


def changes_since(client: Client, at: datetime) -> str:
    """The part of the same page that tells what is different now."""
    shown = CHANGES.search(client.get(f"/board/test/?at={at.astimezone(UTC):%Y-%m-%dT%H:%M:%S.%fZ}").content)
    return shown[0].decode() if shown else ""


def on_board() -> dict[str, float | None]:
    return {e.method: e.scores["mid"] for e in board_now().entries if e.kind == "published"}


@pytest.fixture
def former(edition: Edition, tmp_path: Path) -> Edition:
    """The first edition, which another one has replaced."""
    publish(open_edition(corrected(tmp_path, factor=1.3)))
    return edition


@pytest.mark.slow
def test_a_row_that_is_added_or_replaced_changes_no_board_of_the_past_and_no_former_edition(
    client: Client, former: Edition
) -> None:
    at = timezone.now()
    before = representations(client, at)
    quote("later", mid=1.0)
    quote("deep-scale", mid=0.5)
    assert (on_board()["Later"], on_board()["Deep-Scale"]) == (1.0, 0.5)
    assert "Deep Scale" not in on_board()
    assert representations(client, at) == before
    assert "Later" in changes_since(client, at)
    later = client.get(f"/board/test.csv?at={timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}").text
    assert "Later" in later
    assert board_now().updated_at is not None
    assert board_now().updated_at > at


@pytest.mark.slow
def test_a_row_that_is_removed_leaves_the_board_and_stays_on_those_of_the_past(
    keeper: Client, former: Edition
) -> None:
    quote("later", mid=1.0)
    at = timezone.now()
    before, page = representations(Client(), at), f"{PAGE}test/later/remove/"
    assert "Remove Later from the Test board" in assert_sound(keeper.get(page)).one("main").text
    assert keeper.post(page, {"reason": " "}).status_code == 422
    assert "Later" in on_board()
    assert keeper.post(page, {"reason": "Withdrawn by its authors."}).status_code == 302
    assert "Later" not in on_board()
    assert representations(Client(), at) == before
    assert keeper.get(page).status_code == 404
    with pytest.raises(Refused, match="quotes no row 'later'; expected one of deep-scale"):
        splits.remove_published(split_name="test", slug="later", reason="Again.", now=timezone.now())
    assert AuditEvent.objects.filter(verb="removed", noun="PublishedResult").count() == 1
    assert quote("later").added == ("test/later",)


def test_a_board_that_stands_has_every_row_and_a_former_one_those_of_its_time(
    former: Edition, client: Client
) -> None:
    quote("second")
    roll_back()
    quote("first-again")
    # The first edition is the board again, so it has what came meanwhile; the second is an earlier one.
    assert {"Second", "First-Again"} <= set(on_board())
    second = client.get("/board/test/editions/2.csv").text
    assert "Second" in second
    assert "First-Again" not in second


@pytest.mark.usefixtures("benchmark")
def test_rows_that_come_with_their_split_stand_since_ever_and_later_ones_since_their_day() -> None:
    PublishedResult.objects.filter(slug="sot").delete()
    assert set(PublishedResult.objects.values_list("added_at", flat=True)) == {SINCE_EVER}
    splits.ensure_splits()
    later = PublishedResult.objects.filter(slug="sot")
    assert later.count() == 2
    assert all(timezone.now() - row.added_at < A_DAY for row in later)


def import_paper(document: dict[str, Any]) -> splits.Imported:
    """Import a document as JSON."""
    data = json.dumps(document).encode()
    return splits.import_published(document=papers.parse(data), now=timezone.now())


@pytest.mark.usefixtures("benchmark")
def test_a_document_is_imported_once_and_another_content_replaces_only_on_demand() -> None:
    assert import_paper(paper("later", mid=1.0)).added
    assert import_paper(paper("later", mid=1.0)).unchanged
    assert AuditEvent.objects.filter(verb="imported").count() == 1
    with pytest.raises(
        Refused, match="already has the row 'later', which differs in scores; expected the same content"
    ):
        import_paper(paper("later", mid=2.0))
    assert on_board()["Later"] == 1.0
    assert quote("later", mid=2.0).replaced
    assert on_board()["Later"] == 2.0
    assert PublishedResult.objects.filter(slug="later").count() == 2


@pytest.mark.usefixtures("benchmark")
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"results": {"nowhere": {"later": [1.0] * 10}}}, "/results/nowhere: no split of this site"),
        ({"results": {"test": {"later": [1.0] * 9}}}, "/results/test/later: 9 values; expected a list of 10"),
        ({"results": {"test": {"later": [1.0, float("nan"), *[1.0] * 8]}}}, "/results/test/later/1: nan;"),
        ({"results": {}}, "/results: no rows"),
        ({"source": paper()["source"] | {"year": 2150}}, "/source/year: 2150; expected a year from 1950 to"),
        ({"columns": ["mid"] * 10}, "/columns: not the scores of a protocol"),
        (
            {"methods": [{"slug": "A B", "name": ""}]},
            "/methods/0/slug: 'A B'; expected(.|\\n)*/methods/0/name: ''",
        ),
        (
            {"source": {"title": "T", "url": "ftp://x"}},
            "/source/authors: nothing(.|\\n)*/source/url: 'ftp://x'",
        ),
    ],
)
def test_a_document_that_is_none_is_refused_in_words(change: dict[str, Any], sentence: str) -> None:
    n_before = PublishedResult.objects.count()
    with pytest.raises(Refused, match=sentence):
        import_paper(paper() | change)
    assert PublishedResult.objects.count() == n_before


@pytest.mark.slow
def test_the_page_imports_a_paper_with_missing_values_and_says_where_every_problem_is(
    keeper: Client, edition: Edition
) -> None:
    def send(text: bytes, **more: str) -> Any:
        file = SimpleUploadedFile("paper.json", text, content_type="application/json")
        return keeper.post(PAGE, {"file": file, **more})

    document = paper("later", mid=1.0)
    document["results"]["test"]["later"][3] = None
    assert send(json.dumps(document).encode()).status_code == 302
    page = assert_sound(keeper.get(PAGE)).one("main").text
    assert "Later since 20" in page
    assert "Deep Scale since" not in page
    assert "Later" in keeper.get("/board/test/").text
    assert "@misc{ater2026later," in keeper.get("/board/test.bib").text
    assert "import" in AuditEvent.objects.filter(noun="PublishedResult").latest("pk").verb
    document["results"]["test"]["later"][0] = 2.0
    refused = send(json.dumps(document).encode())
    assert refused.status_code == 422
    assert "which differs in scores" in assert_sound(refused).one("div", class_="wrong").text
    assert send(json.dumps(document).encode(), is_replacing="on").status_code == 302
    bad = {**document, "columns": ["mid"], "source": {"year": "2026"}}
    sentences = [
        (json.dumps(bad).encode(), "/source/year: '2026'; expected a year from 1950 to "),
        (b"{\n  x", "line 2, column 3: no JSON"),
        (b"\xff", "byte 1: not UTF-8"),
        (b"[" * 100_000, "too long to read"),
    ]
    for text, sentence in sentences:
        answer = send(text)
        assert answer.status_code == 422
        assert sentence in assert_sound(answer).one("div", class_="wrong").text
    assert on_board()["Later"] == 2.0


# --- the forms of the page ---------------------------------------------------------------------------------


def test_the_example_on_the_page_can_be_pasted_as_it_is(keeper: Client, edition: Edition) -> None:
    example = assert_sound(keeper.get(f"{PAGE}?form=paper")).one("code", id="example").text
    assert keeper.post(PAGE, {"text": example}).status_code == 302
    assert on_board()["Later"] == 14.0


ROW = {
    "step": "row",
    "row-split": "test",
    "row-name": "Typed net",
    "row-title": "A paper",
    "row-authors": "L. Ater",
    "row-year": "2026",
    "row-url": "https://arxiv.org/abs/2601.00001",
    "row-table": "Table 2",
    "row-scores": "14.0 27 15.1 11.2 – 12.0 6.4 – – -",
}


def test_rows_stand_below_their_paper_and_a_form_opens_when_asked_or_refused(
    keeper: Client, edition: Edition
) -> None:
    def opened(page: Any) -> list[str]:
        details = assert_sound(page).one("main").all("details", class_="note")
        return [each.attributes["id"] for each in details if "open" in each.attributes]

    assert keeper.post(PAGE, ROW).status_code == 302
    page = keeper.get(PAGE)
    table = pages.page(page).one("table")
    papers = [each.one("th", scope="rowgroup").text for each in table.all("tbody")]
    assert len(set(papers)) == len(papers)
    [own] = [
        each for each in table.all("tbody") if "Test, 2026" in each.text and "A paper, Table 2" in each.text
    ]
    [name] = [row.all("td")[0].text for row in own.all("tr")[1:]]
    assert name.startswith("Typed net since 20")
    assert opened(page) == []
    assert opened(keeper.get(f"{PAGE}?form=row")) == ["add"]
    assert opened(keeper.get(f"{PAGE}?form=paper")) == ["import"]
    assert opened(keeper.post(PAGE, ROW | {"row-year": "1"})) == ["add"]
    assert opened(keeper.post(PAGE, {"text": "x"})) == ["import"]


def test_a_row_is_typed_in_without_a_document(keeper: Client, edition: Edition) -> None:
    assert keeper.post(PAGE, ROW).status_code == 302
    row = PublishedResult.objects.get(slug="typed-net")
    assert (row.method_name, row.scores["mid"], row.scores["mid_negative"]) == ("Typed net", 14.0, None)


@pytest.mark.parametrize(
    ("field", "text", "sentence"),
    [
        ("url", "nowhere", "'nowhere'; expected an address that begins with http:// or https://."),
        ("scores", "14.0 x", "'x'; expected a number such as 14.0, or a dash."),
        ("scores", "14.0", "1 values; expected a list of 10, one for each of the columns."),
        ("year", "1", "1; expected a year from 1950 to"),
    ],
)
def test_what_is_wrong_in_a_typed_row_stands_at_its_field(
    keeper: Client, edition: Edition, field: str, text: str, sentence: str
) -> None:
    answer = keeper.post(PAGE, ROW | {f"row-{field}": text})
    assert answer.status_code == 422
    assert sentence in assert_sound(answer).one("div", id=f"id_row-{field}_error").text
