"""The maintainers' desk: who gets in, how far a re-scoring is, and what it would change."""

import csv
import io
import re
from pathlib import Path

import pytest
from django.http import HttpResponseBase
from django.test import Client

from evaluator.metrics.protocol import SCORE_NAMES
from leaderboard.editions import preview
from leaderboard.models import (
    Edition,
    Evaluation,
    Method,
    PublishedResult,
    Status,
    Submission,
    Team,
    User,
)
from tests import builders, pages
from tests.editions import extended, open_edition, publish, roll_back
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.desk import FIRST, HUB, OPEN, SECOND, effects, get, main_text

pytestmark = pytest.mark.slow

PAGES = (HUB, OPEN, SECOND, f"{SECOND}publish/", f"{SECOND}discard/", f"{FIRST}roll-back/")
ROUTES = (*PAGES, f"{SECOND}preview.csv", f"{SECOND}progress/")


# --- who gets in -----------------------------------------------------------------------------------------


def test_a_visitor_signs_in_first_and_an_open_page_is_led_there_as_a_whole(
    client: Client, rescored: Edition
) -> None:
    for address in ROUTES:
        response = client.get(address)
        assert response.status_code == 302
        assert response.headers["Location"] == f"/accounts/login/?next={address}"
    part = client.get("/maintain/queue/state/", headers={"HX-Request": "true"})
    assert (part.status_code, part.headers["HX-Refresh"], part.content) == (200, "true", b"")


@pytest.mark.parametrize("address", PAGES)
def test_every_page_is_sound(keeper: Client, rescored: Edition, address: str) -> None:
    get(keeper, address)


# --- the desk --------------------------------------------------------------------------------------------


def test_desk_shows_each_split_with_its_board_and_what_is_prepared(keeper: Client, second: Edition) -> None:
    root = get(keeper, HUB)
    assert [h2.text for h2 in root.all("h2")] == ["Waiting for you", "Pages", "State of the site", "Editions"]
    # Django's administration shows nothing to a maintainer who is no superuser.
    assert "administration" in root.one("main").text
    User.objects.update(is_superuser=False)
    assert "administration" not in main_text(keeper, HUB)
    test, val, _ = (row.text for row in root.one("table").one("tbody").all("tr"))
    assert "edition 1, published" in test
    draft = root.all("div", class_="preparing")[0].text
    assert draft.startswith("Test, edition 2 draft since")
    assert "0%. 0 of 4 submissions finished." in draft
    assert "none: no ground truth yet" in val
    assert "tsttc-maintain import_truth val PATH" in main_text(keeper, "/maintain/val/open/")
    bar = root.one("progress")
    assert (bar.attributes["value"], bar.attributes["max"]) == ("0", "4")


def test_desk_leads_to_what_failed_by_our_fault(keeper: Client, rescored: Edition) -> None:
    Evaluation.objects.filter(edition=rescored).update(status=Status.SYSTEM_ERROR)
    link = next(a for a in get(keeper, HUB).all("a") if a.text == "Inspect and retry")
    assert "4 evaluations in edition 2 Inspect and retry" in main_text(keeper, HUB)
    listed = get(keeper, link.attributes["href"])
    assert len(listed.one("table", class_="queue").one("tbody").all("tr")) == 4


def test_pages_offer_only_what_can_be_done_to_an_edition(keeper: Client, rescored: Edition) -> None:
    for page in (HUB, FIRST):
        assert "Roll back" not in main_text(keeper, page)
    assert "Edition 1 is not in preparation" in main_text(keeper, f"{FIRST}discard/")
    assert get(keeper, f"{SECOND}discard/").one("main").all("button")
    current = get(keeper, f"{FIRST}publish/").one("main")
    assert "Edition 1 is the current board already, so it cannot be published." in current.text
    assert current.all("button") == []
    assert get(keeper, f"{SECOND}publish/").one("main").all("button")
    publish(rescored)
    for page in (HUB, SECOND):
        assert "Roll back to edition 1" in main_text(keeper, page)


def test_a_draft_is_opened_with_what_the_maintainer_chose(keeper: Client, rescored: Edition) -> None:
    radios = [
        each.attributes for each in get(keeper, OPEN).all("input") if each.attributes["type"] == "radio"
    ]
    assert {each["name"] for each in radios} == {"digest", "protocol"}
    assert not any("checked" in each for each in radios)
    answer = keeper.post(OPEN)
    assert answer.status_code == 422
    assert "No protocol was chosen; expected one of those listed." in pages.page(answer).text


# --- progress --------------------------------------------------------------------------------------------


def poll(client: Client, query: str = "") -> HttpResponseBase:
    return client.get(f"{SECOND}progress/{query}")


def test_progress_is_sent_when_it_changes_and_ends_with_the_comparison(
    keeper: Client, second: Edition
) -> None:
    assert poll(keeper).status_code == 200
    assert poll(keeper, "?seen=0-4").status_code == 204
    assert get(keeper, SECOND).one("div", class_="progress").attributes["hx-get"].endswith("comparison=1")
    builders.score_all()
    last = poll(keeper, "?seen=0-4&comparison=1")
    assert last.status_code == 286
    root = pages.page(last)
    assert "Finished. 4 submissions: 4 scored." in root.text
    assert root.one("div", id="comparison").one("table", class_="changes")


# --- the comparison --------------------------------------------------------------------------------------


def test_hub_tells_failures_of_an_earlier_edition_apart(
    keeper: Client, rescored: Edition, owner: User
) -> None:
    queue_rows.queued(Edition.objects.get(split="test", number=1), owner)
    queue_rows.strike_out()
    assert "1 evaluation in edition 1 Inspect and retry" in main_text(keeper, HUB)
    publish(rescored, leave_out=True)
    assert "1 evaluation in edition 1, an earlier edition Inspect and retry" in main_text(keeper, HUB)


def test_comparison_counts_what_the_draft_does_not_evaluate(
    keeper: Client, rescored: Edition, owner: User
) -> None:
    queue_rows.queued(Edition.objects.get(split="test", number=1), owner)
    root = get(keeper, SECOND)
    assert "1 submission without a score is not evaluated in this edition." in effects(root)
    [about] = [each.text for each in root.all("div", class_="about") if "not evaluated" in each.text]
    assert about.endswith("not evaluated (before: queued)"), "a phone has no room for the column of states"


def test_comparison_is_the_previews_line_by_line(keeper: Client, rescored: Edition) -> None:
    expected = preview.preview(rescored)
    root = get(keeper, SECOND)
    assert (expected.n_changed, expected.n_moved) == (4, 1)
    assert effects(root) == [
        "Ground truth: 5 labels corrected.",
        "MiD and RTE change for all 4 scored submissions.",
        "1 of 4 scored submissions gets another rank.",
    ]
    rows = root.one("table", class_="changes").one("tbody").all("tr")
    assert [row.one("th").one("a").text for row in rows] == [change.method for change in expected.changes]
    for row, change in zip(rows, expected.changes, strict=True):
        assert f"{change.team}, submitted {change.submitted_at:%Y-%m-%d}" in row.one("th").text
        cells = row.all("td")
        for cell, name in zip(cells[1:], SCORE_NAMES, strict=True):
            old, new, delta = change.old[name], change.new[name], change.delta[name]
            assert f"{old:.1f}" in cell.text
            assert f"{new:.1f}" in cell.text
            assert cell.one("span", class_="delta").text == (f"{delta:+.1f}" if delta else "0.0").replace(
                "-", "−"
            )


def test_the_current_edition_shows_its_contents_who_published_it_and_its_changes(
    keeper: Client, rescored: Edition
) -> None:
    first = main_text(keeper, FIRST)
    assert "this is the first edition" in first
    assert "Publish" not in first.replace("Published", "")
    publish(rescored)
    root = get(keeper, SECOND)
    assert "Ground truth: 5 labels corrected." in effects(root)
    assert rescored.ground_truth.digest in [each.attributes.get("title") for each in root.all("span")]
    assert re.search(r"UTC (from the command line|by \S+@\S+): “", root.text)
    assert "What this edition changed compared with edition 1" in root.text
    assert "Publish again" not in root.text
    assert preview.preview(rescored).replaces == 1
    former = main_text(keeper, FIRST)
    assert "What would change if it is published again compared with edition 2" in former
    assert "Publish again…" in former


def test_entries_that_become_rejected_say_why(
    keeper: Client, entries: list[Submission], tmp_path: Path
) -> None:
    open_edition(extended(tmp_path))
    builders.score_all()
    root = get(keeper, SECOND)
    assert "4 scored submissions become rejected." in effects(root)
    for row in root.one("table", class_="changes").one("tbody").all("tr"):
        status = row.one("td", class_="status")
        assert status.one("summary").text == (
            "1 sequence has no value, added by a correction after the file was sent"
        )
        assert "expected a new file" in status.one("p").text
        assert status.text.startswith("rejected (before: scored)")
        assert "worse" in status.classes
    listed = main_text(keeper, f"{SECOND}publish/")
    assert "Edition 1 still shows what becomes rejected, marked: M1.05 (Owls)" in listed


def test_a_protocol_that_lacks_a_metric_says_who_loses_it(
    keeper: Client, owner: User, open_values: None, tmp_path: Path
) -> None:
    first = builders.import_truth(tmp_path, protocol="tsttc-2")
    for factor in (1.05, 1.1):
        builders.submit(owner, builders.predictions(first, factor=factor), method=f"M{factor}")
    builders.submit(owner, b'{"0": 3.5}', method="Incomplete")
    builders.score_all()
    draft = open_edition(protocol="toolkit")
    builders.score_all()
    root = get(keeper, SECOND)
    assert effects(root) == [
        "The protocol changes from tsttc-2 to toolkit. The new one does not compute the warning error (WE): "
        "all 2 scored submissions lose this score.",
        "MiD, RTE, all ranks and the ground truth stay the same.",
    ]
    assert effects(get(keeper, f"{SECOND}publish/"))[:2] == effects(root)
    table = root.one("table", class_="changes").one("tbody")
    assert len(table.all("del")) == 2, "the warning errors that go"
    publish(draft)
    open_edition(protocol="tsttc-1")
    assert effects(get(keeper, "/maintain/test/editions/3/")) == [
        "The protocol changes from toolkit to tsttc-1.",
        "The ground truth stays the same.",
    ]
    back = get(keeper, f"{SECOND}roll-back/")
    gain = "The new one adds the warning error (WE): all 2 scored submissions get this score."
    assert gain in effects(back)[0]


def test_a_submission_that_waits_is_counted_in_no_score_and_listed_with_its_state(
    keeper: Client, owner: User, open_values: None, tmp_path: Path
) -> None:
    first = builders.import_truth(tmp_path, protocol="tsttc-2")
    builders.submit(owner, builders.predictions(first), method="Done")
    builders.score_all()
    open_edition(protocol="toolkit")
    builders.score_all()
    builders.submit(owner, builders.predictions(first, factor=1.05), method="Late")
    root = get(keeper, f"{SECOND}publish/")
    assert "(WE): 1 scored submission loses this score." in effects(root)[0]
    [late] = root.one("ul", class_="left-out").all("li")
    assert re.fullmatch(r"Late Owls, submitted [0-9-]{10}: queued", late.text)


@pytest.mark.parametrize("has_quoted", [True, False])
def test_ranks_of_quoted_rows_are_explained_where_they_are_missing(
    keeper: Client, edition: Edition, owner: User, has_quoted: bool
) -> None:
    for factor in (1.05, 9.0):
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
    if not has_quoted:
        PublishedResult.objects.all().delete()
    builders.score_all()
    open_edition(protocol="toolkit")
    builders.score_all()
    assert ("The missing ranks belong to rows quoted from papers" in main_text(keeper, SECOND)) == has_quoted


def test_csv_has_every_number_and_guards_texts(keeper: Client, rescored: Edition) -> None:
    Method.objects.filter(name="M1.05").update(name='=HYPERLINK("https://example.org")')
    Team.objects.update(name="@team")
    response = keeper.get(f"{SECOND}preview.csv")
    assert response.headers["Content-Type"] == "text/csv; charset=utf-8"
    assert response.headers["Content-Disposition"] == (
        'attachment; filename="tsttc-test-edition-2-preview.csv"'
    )
    rows = list(csv.DictReader(io.StringIO(response.content.decode())))
    expected = preview.rows(preview.preview(rescored))
    assert [row["delta_mid"] for row in rows] == [str(plain["delta_mid"]) for plain in expected]
    assert {row["team"] for row in rows} == {"'@team"}
    assert len([row for row in rows if row["method"].startswith("'=")]) == 1


def test_publishing_again_keeps_what_its_page_promises(
    keeper: Client, rescored: Edition, owner: User, edition: Edition
) -> None:
    publish(rescored)
    roll_back()
    late = builders.submit(owner, builders.predictions(edition, factor=1.01), method="Late")
    text = main_text(keeper, f"{SECOND}publish/")
    assert "Late Owls, submitted" in text
    assert (
        "What is not evaluated is queued; the new board shows unfinished submissions once they are scored."
        in text
    )
    assert "open edition 2 again: select its ground truth" in text
    form = {"replaces": 1, "reason": "Right after all.", "leave_out": "on"}
    assert keeper.post(f"{SECOND}publish/", form).status_code == 302
    builders.score_all()
    assert late.evaluations.get(edition=rescored).status == Status.SCORED
    assert "Late" in main_text(keeper, "/board/test/")


def test_a_former_edition_is_opened_and_closed_again_on_its_pages(keeper: Client, rescored: Edition) -> None:
    publish(rescored)
    roll_back()
    form = {"digest": rescored.ground_truth_id, "protocol": rescored.protocol}
    assert keeper.post(OPEN, form).headers["Location"] == SECOND
    assert "edition 2 former, opened again" in main_text(keeper, SECOND)
    assert "opened again: edition 2" in main_text(keeper, HUB)
    assert "Edition 2 is already opened again" in main_text(keeper, OPEN)
    assert "open edition 2 again" not in main_text(keeper, f"{SECOND}publish/")
    assert "Edition 2 stays a former edition" in main_text(keeper, f"{SECOND}discard/")
    assert keeper.post(f"{SECOND}discard/", {"reason": "Not yet.", "confirm": "on"}).status_code == 302
    assert "Edition 2 is not in preparation" in main_text(keeper, f"{SECOND}discard/")
    assert "opened again" not in main_text(keeper, HUB)


def test_a_comparison_of_many_submissions_has_pages_and_can_show_changed_ranks_alone(
    keeper: Client, rescored: Edition, owner: User
) -> None:
    board = Edition.objects.get(split="test", number=1)
    for _ in range(50):
        queue_rows.queued(board, owner)
    first, second, beyond = (get(keeper, f"{SECOND}{query}") for query in ("", "?page=2", "?page=99"))
    n_rows = [
        len(root.one("table", class_="changes").one("tbody").all("tr")) for root in (first, second, beyond)
    ]
    assert n_rows == [50, 4, 4]
    assert effects(first) == effects(second), "sentences are of all submissions"
    links = [a.attributes["href"] for a in first.one("nav", class_="pages").all("a")]
    assert links == ["?page=2"]
    moved = get(keeper, f"{SECOND}?rows=moved")
    rows = moved.one("table", class_="changes").one("tbody").all("tr")
    assert rows
    assert all("moved" in row.classes for row in rows)
    assert f"Only changed ranks ({len(rows)})" in moved.one("nav", class_="columns").text
    assert moved.all("nav", class_="pages") == []
    assert get(keeper, f"{SECOND}?rows=strange&page=x").one("table", class_="changes")


def test_publishing_names_fifty_submissions_and_counts_the_rest(
    keeper: Client, rescored: Edition, owner: User
) -> None:
    board = Edition.objects.get(split="test", number=1)
    for _ in range(52):
        queue_rows.queued(board, owner)
    root = get(keeper, f"{SECOND}publish/")
    assert root.all("table", class_="changes") == []
    assert root.one("ul", class_="left-out").text.endswith("and 2 more")
