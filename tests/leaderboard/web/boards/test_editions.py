"""A board's past: editions at addresses that stay, the board as it stood at a time, what changed."""

from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest
from django.conf import settings
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Evaluation, Method, Publication, PublishedResult, Submission, User
from leaderboard.submissions import intake
from tests import builders, pages
from tests.editions import changed_on, corrected, extended, open_edition, publish, roll_back
from tests.pages import get

pytestmark = pytest.mark.slow

OLD, NEW = "/board/test/editions/1/", "/board/test/editions/2/"
EDITIONS = "/board/test/editions/"


@pytest.fixture
def replaced(entries: list[Submission], tmp_path: Path) -> Edition:
    """The second edition, which is the board; the first was."""
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    return second


def facts(root: pages.Element) -> dict[str, str]:
    """The edition's own facts, by name."""
    facts = root.one("dl", class_="edition-facts")
    return {dt.text: dd.text for dt, dd in zip(facts.all("dt"), facts.all("dd"), strict=True)}


def test_former_edition_keeps_its_board_and_names_its_successor(
    client: Client, entries: list[Submission], tmp_path: Path
) -> None:
    before = pages.board_rows(get(client, "/board/test/"))
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    root = get(client, OLD)
    assert pages.board_rows(root) == before
    notice = root.one("p", class_="notice")
    assert notice.text.startswith(f"Replaced by edition 2 on {changed_on()} (“Labels corrected.”); see")
    assert [a.attributes["href"] for a in notice.all("a")] == [NEW, "/board/test/"]
    assert pages.board_rows(get(client, NEW)) == pages.board_rows(get(client, "/board/test/")) != before


def test_edition_names_its_ground_truth_protocol_counts_and_time(client: Client, replaced: Edition) -> None:
    truth = replaced.ground_truth
    shown = facts(get(client, NEW))
    assert shown["Ground truth"] == truth.digest
    assert shown["Manifest"] == truth.manifest_digest
    assert shown["Protocol"] == "tsttc-1"
    counts = truth.counts
    assert shown["Sequences"] == "120 in 24 recordings"
    assert shown["TTC ranges"] == (
        f"{counts['crucial']} in 0–3 s, {counts['small']} in 3–6 s, "
        f"{counts['large']} in 6–20 s, {counts['negative']} in −20–0 s, {counts['out_of_range']} out of range"
    )
    assert shown["What changed"] == "5 labels corrected, compared with edition 1"
    assert shown["Published"].endswith("UTC: “Labels corrected.”")


def test_edition_that_was_taken_back_says_so_and_keeps_its_board(client: Client, replaced: Edition) -> None:
    before = pages.board_rows(get(client, NEW))
    roll_back()
    root = get(client, NEW)
    assert pages.board_rows(root) == before
    assert "Rolled back to edition 1 on" in root.one("p", class_="notice").text
    assert " (“A mistake.”); see" in root.one("p", class_="notice").text
    assert "again: “A mistake.”" in facts(get(client, OLD))["Published"]


def test_edition_in_preparation_is_nothing_to_anybody(
    client: Client, entries: list[Submission], tmp_path: Path
) -> None:
    open_edition(corrected(tmp_path, factor=1.3))
    assert client.get(NEW).status_code == 404
    assert client.get("/board/test/editions/7/").status_code == 404
    assert client.get("/board/val/editions/1/").status_code == 404
    assert client.get(f"/board/test/editions/{10**30}/").status_code == 404


def test_board_as_it_stood_at_a_time(client: Client, entries: list[Submission]) -> None:
    sent_at = entries[0].submitted_at
    yesterday = sent_at - timedelta(days=1)
    root = get(client, f"/board/test/?at={yesterday:%Y-%m-%d}")
    assert len(pages.board_rows(root)) == 5
    assert "Board as of" in root.one("main").text
    assert len(pages.board_rows(get(client, f"/board/test/?at={timezone.now():%Y-%m-%d}"))) == 9


def test_past_board_leads_to_its_edition_and_to_the_board_now(client: Client, replaced: Edition) -> None:
    long_ago = timezone.now() - timedelta(days=9)
    Publication.objects.filter(edition__number=1).update(at=long_ago)
    root = get(client, f"/board/test/?at={long_ago + timedelta(days=1):%Y-%m-%d}")
    links = [a.attributes["href"] for a in root.one("p", class_="notice").all("a")]
    assert links == ["/board/test/", "#changes"]
    facts = [a.attributes["href"] for a in root.one("p", class_="facts").all("a")]
    assert OLD in facts
    assert "#changelog" not in str(facts)


def test_past_board_lists_what_has_changed_since(
    client: Client, entries: list[Submission], owner: User
) -> None:
    now = timezone.now()
    Publication.objects.update(at=now - timedelta(days=9))
    Evaluation.objects.update(finished_at=now - timedelta(days=8))
    Method.objects.update(shown_at=now - timedelta(days=8))
    file = builders.predictions(entries[0].evaluations.get().edition, factor=1.01)
    builders.submit(owner, file, method="New")
    passing = builders.submit(owner, file, method="Passing")
    better = builders.predictions(entries[0].evaluations.get().edition, factor=1.02)
    builders.submit(owner, better, method="M1.05")
    builders.score_all()
    for submission in (entries[1], passing):
        intake.withdraw(submission=submission, actor=owner, now=now)
    root = get(client, f"/board/test/?at={now - timedelta(days=2):%Y-%m-%d}")
    section = root.one("section", **{"aria-labelledby": "changes"})
    changed, added = (
        [(row.one("th").text, *(cell.text for cell in row.all("td"))) for row in body.all("tr")]
        for body in section.all("tbody")
    )
    assert changed[0][:3] == ("M1.05", "down 1, MiD changed", "1 → 2")
    best = client.get("/api/v1/splits/test/board").json()["entries"][0]
    assert added == [("New", "1", str(best["scores"]["mid"]))]
    assert changed[-1][:2] == ("M1.1", "withdrawn")
    assert changed[-1][2].endswith(" → –")
    n_changes = len(changed) + len(added)
    assert root.one("a", href="#changes").text == f"changes since then ({n_changes})"
    assert "Passing" not in {row[0] for row in changed}, "it came and was withdrawn in between"
    assert "Deep Scale" in {row[0] for row in changed if row[1] == "down 1"}
    assert get(client, "/board/test/").all("section", **{"aria-labelledby": "changes"}) == []


def test_a_day_before_the_first_edition_says_so_and_offers_another_day(
    client: Client, entries: list[Submission]
) -> None:
    PublishedResult.objects.all().delete()
    root = get(client, "/board/test/?at=2020-01-01")
    first = f"Its first edition was published on {Publication.objects.get().at:%Y-%m-%d}."
    message = root.one("div", class_="no-rows")
    assert f"The Test board did not exist on 2020-01-01. {first}" in message.text
    assert [a.attributes["href"] for a in message.all("a")] == ["?"]
    assert root.all("section", **{"aria-labelledby": "changes"}) == [], "everything has come since"
    day = root.one("details", class_="as-of").one("input", type="date").attributes
    assert (day["value"], day["max"]) == ("2020-01-01", f"{timezone.now() - timedelta(days=1):%Y-%m-%d}")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda tmp_path: open_edition(corrected(tmp_path, factor=1.3)), "5 labels corrected"),
        (lambda _: open_edition(None, protocol="toolkit"), "protocol toolkit instead of tsttc-1"),
    ],
    ids=["labels", "protocol"],
)
def test_head_says_what_changed_and_leads_to_the_changelog(
    client: Client, entries: list[Submission], tmp_path: Path, change: Callable[[Path], Edition], words: str
) -> None:
    publish(change(tmp_path), leave_out=True)
    head = get(client, "/board/test/").one("p", class_="facts")
    (link,) = [a for a in head.all("a") if a.attributes["href"] == f"{EDITIONS}#changelog"]
    assert link.text == words


def test_list_has_every_published_edition_and_what_became_of_it(
    client: Client, replaced: Edition, tmp_path: Path
) -> None:
    open_edition(corrected(tmp_path, factor=1.5))
    root = get(client, EDITIONS)
    rows = [[cell.text for cell in row.all("td")] for row in root.one("tbody").all("tr")]
    opened, changed = (f"{row.at:%Y-%m-%d}" for row in Publication.objects.order_by("pk"))
    first, second = (edition.ground_truth.short_digest for edition in Edition.objects.all()[:2])
    assert rows == [
        ["edition 2", "current", "5 labels corrected", changed, second, "tsttc-1", "120"],
        [
            "edition 1",
            f"replaced by edition 2 on {changed}",
            "first edition",
            opened,
            first,
            "tsttc-1",
            "120",
        ],
    ]


def test_changelog_tells_every_change_with_its_reason(client: Client, replaced: Edition) -> None:
    roll_back()
    items = [li.one("div").text for li in get(client, EDITIONS).one("ol", class_="changelog").all("li")]
    assert items == [
        "Rolled back from edition 2 to edition 1. A mistake.",
        "Edition 2 replaced edition 1. Labels corrected.",
        "Edition 1, the first edition, was published.",
    ]


def test_split_without_an_edition_says_so_and_leads_onward(client: Client, edition: Edition) -> None:
    main = get(client, "/board/val/editions/").one("main")
    assert "No edition of the Validation board has been published yet." in main.text
    onward = [a.attributes["href"] for a in main.all("a")][1:]
    assert onward == ["/board/val/", "/board/test/editions/", "/docs/editions/", "/docs/changelog/"]
    assert client.get("/board/nowhere/editions/").status_code == 404


def test_entry_that_the_next_edition_cannot_score_is_marked(
    client: Client, entries: list[Submission], tmp_path: Path
) -> None:
    # No file has a value for what was added, so none can be scored.
    second = open_edition(extended(tmp_path))
    builders.score_all()
    publish(second, leave_out=True)
    marked = [row[1] for row in pages.board_rows(get(client, OLD)) if "not in edition 2" in row[1]]
    assert len(pages.board_rows(get(client, NEW))) == 5, "published rows alone"
    assert len(marked) == len(entries)
    assert all(text.endswith("Edition 2 added sequences that its file does not predict.") for text in marked)


def test_withdrawn_entry_leaves_its_mark_in_a_former_edition(
    client: Client, entries: list[Submission], owner: User, replaced: Edition
) -> None:
    intake.withdraw(submission=entries[0], actor=owner, now=timezone.now())
    root = get(client, OLD)
    rows = root.one("table", class_="board").one("tbody").all("tr")
    (row,) = [row for row in rows if "withdrawn" in row.classes]
    withdrawn_at = Submission.objects.get(pk=entries[0].pk).withdrawn_at
    assert row.one("div", class_="name").text == f"M1.05 withdrawn {withdrawn_at:%Y-%m-%d}"
    assert {cell.text for cell in row.all("td")} - {""} == {"–"}
    sentence = (
        "One submission was withdrawn by its team. Its row remains in each edition that had scored it, "
        "without scores or rank."
    )
    assert sentence in root.one("main").text


def test_list_promises_of_a_withdrawn_submission_what_the_editions_show(
    client: Client, replaced: Edition
) -> None:
    lead = get(client, EDITIONS).one("p", class_="lead").text
    assert "its row stays, without values, in the editions that had scored it" in lead


def test_every_page_that_stays_has_its_own_canonical_address(client: Client, replaced: Edition) -> None:
    def canonical(address: str) -> list[str]:
        links = get(client, address).all("link", rel="canonical")
        return [link.attributes["href"].removeprefix(settings.SITE_URL) for link in links]

    assert canonical("/board/test/?sort=-mid") == ["/board/test/"]
    assert canonical(f"{OLD}?sort=-mid") == [OLD]
    assert canonical("/board/test/?at=2020-01-01") == []
