"""Public pages are drawn once, are current and consistent, and reveal nothing private."""

from collections.abc import Callable
from pathlib import Path

import pytest
from django.conf import settings
from django.db import connection, transaction
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from leaderboard import board_versions
from leaderboard.boards import listing, snapshots
from leaderboard.methods import editing, visibility
from leaderboard.models import (
    BoardVersion,
    Edition,
    Evaluation,
    Method,
    PublishedResult,
    Split,
    Status,
    Submission,
    User,
    Visibility,
)
from leaderboard.models.benchmark import Listing
from leaderboard.people import teams
from leaderboard.submissions import intake
from tests import board_rows, builders
from tests.caching import forget_boards
from tests.editions import corrected, open_edition, publish
from tests.public_pages import addresses_of

API = "/api/v1/splits/test/board"
PAGE = "/board/test/"
MAX_QUERIES, MAX_QUERIES_AS_OF = 4, 9


@pytest.fixture
def filled(edition: Edition, owner: User) -> list[Method]:
    """A board of a dozen rows."""
    return board_rows.fill(edition, n=12, user=owner)


def by_hand(change: Callable[[], object], *, split: str = "test") -> None:
    """Change rows past the verbs, and say so as a verb would."""
    with transaction.atomic():
        change()
        board_versions.bump(split)


def n_queries(client: Client, address: str) -> int:
    with CaptureQueriesContext(connection) as captured:
        assert client.get(address).status_code == 200, address
    # A test is one transaction: what would begin and end one within is none of the page's statements.
    return sum(not query["sql"].startswith(("SAVEPOINT", "RELEASE")) for query in captured)


# --- it is what it was read from ---------------------------------------------------------------------------


def test_what_is_kept_is_what_the_database_says(edition: Edition, filled: list[Method]) -> None:
    for _ in range(2):  # read, and kept
        shown = snapshots.shown(split=edition.split, edition=edition)
        assert shown.entries == listing.public_rows(split=edition.split, edition=edition)
        assert len(shown.entries) == 12 + edition.split.published_results.count()
        assert {attempt.method_id for attempt in shown.attempts} == {method.pk for method in filled}


def test_a_kept_row_has_its_scores_in_the_order_of_its_protocol(
    edition: Edition, filled: list[Method]
) -> None:
    """Equal mappings may differ in it, and pages show it."""
    for _ in range(2):
        shown = snapshots.shown(split=edition.split, edition=edition)
        assert {tuple(entry.scores) for entry in shown.entries} == {edition.rules.score_names}


def test_the_order_in_which_rows_lie_changes_no_byte(
    edition: Edition, filled: list[Method], client: Client
) -> None:
    before = client.get(API).content
    for row in Evaluation.objects.order_by("-pk"):
        # PostgreSQL writes it anew, behind all others.
        Evaluation.objects.filter(pk=row.pk).update(last_error="")
    for result in PublishedResult.objects.order_by("-pk"):
        PublishedResult.objects.filter(pk=result.pk).update(year=result.year)
    forget_boards()
    assert client.get(API).content == before


def test_published_editions_of_splits_that_are_not_switched_off_can_be_read(
    edition: Edition, tmp_path: Path
) -> None:
    val = builders.import_truth(tmp_path, split="val")
    second = open_edition(corrected(tmp_path, factor=1.3))
    assert set(snapshots.editions()) == {edition, val}
    publish(second)
    assert set(snapshots.editions()) == {edition, val, second}
    Split.objects.filter(pk="val").update(listing=Listing.OFF)
    assert set(snapshots.editions()) == {edition, second}


def test_splits_are_in_the_order_of_position_then_name_and_archived_ones_come_last(benchmark: None) -> None:
    for name, position, listing_ in (("val", 1, "LISTED"), ("test", 1, "LISTED"), ("demo", 0, "ARCHIVED")):
        Split.objects.filter(pk=name).update(position=position, listing=listing_)
    assert [split.pk for split in snapshots.splits()] == ["test", "val", "demo"]
    Split.objects.update(listing=Listing.LISTED)
    assert [split.pk for split in snapshots.splits()] == ["demo", "test", "val"]


# --- it is never old ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_change_is_seen_by_the_very_next_reader(edition: Edition, owner: User, client: Client) -> None:
    def rows() -> int:
        return len([e for e in client.get(API).json()["entries"] if e["kind"] == "submission"])

    assert rows() == 0
    submission = builders.submit(owner, builders.predictions(edition), method="Foo")
    assert rows() == 0
    builders.score_all()
    assert rows() == 1
    assert "Foo" in client.get(PAGE).text
    intake.withdraw(submission=submission, actor=owner, now=timezone.now())
    [entry] = [e for e in client.get(API).json()["entries"] if e["kind"] == "submission"]
    assert entry["withdrawn_at"] is not None
    assert "withdrawn" in client.get(PAGE).text


def test_a_board_that_was_read_without_its_version_is_as_new_as_one_with_it(
    edition: Edition, filled: list[Method]
) -> None:
    def names() -> list[set[str]]:
        [listed] = snapshots.splits()[:1]
        [of_editions] = snapshots.editions()
        read = [(edition.split, edition), (listed, edition), (edition.split, of_editions)]
        shown = [snapshots.shown(split=split, edition=each).entries for split, each in read]
        return [{entry.method for entry in entries} for entries in shown]

    assert filled[0].name in names()[0]
    by_hand(lambda: Method.objects.filter(pk=filled[0].pk).update(name="Renamed"))
    assert all("Renamed" in each for each in names())
    BoardVersion.objects.all().delete()
    assert all("Renamed" in each for each in names())
    by_hand(lambda: Method.objects.filter(pk=filled[0].pk).update(name="Once more"))
    assert all("Once more" in each for each in names())


def test_what_a_file_says_of_a_method_that_is_shown_at_that_moment_is_counted(
    edition: Edition, owner: User
) -> None:
    builders.submit(owner, builders.predictions(edition), visibility="PRIVATE")
    builders.score_all()
    number, is_shown = board_versions.number_of("test"), list[bool]()

    def show_meanwhile(execute, sql, params, many, context):
        # Before the row of its team is held, which whoever changes a method waits for.
        if sql.startswith("SELECT") and "leaderboard_method" in sql and not is_shown:
            is_shown.append(True)
            Method.objects.update(visibility=Visibility.PUBLIC, shown_at=timezone.now())
        return execute(sql, params, many, context)

    data = builders.predictions(edition, factor=1.2)
    with connection.execute_wrapper(show_meanwhile):
        builders.send(owner, data, description="Said anew.")
    assert is_shown
    assert board_versions.number_of("test") == number + 1


def test_changing_outside_of_a_transaction_is_refused() -> None:
    with pytest.raises(RuntimeError, match="outside of the transaction"):
        board_versions.bump("test")


def test_nobody_hears_of_a_change_that_was_taken_back(edition: Edition, filled: list[Method]) -> None:
    before = board_versions.sum_of_all()
    with transaction.atomic():
        board_versions.bump("test")
        transaction.set_rollback(True)
    assert board_versions.sum_of_all() == before


def test_editions_in_preparation_move_no_number(
    edition: Edition, entries: list[Submission], second: Edition
) -> None:
    before = board_versions.sum_of_all()
    assert builders.score_all() > 0
    assert second.evaluations.filter(status=Status.SCORED).count() == len(entries)
    assert board_versions.sum_of_all() == before


# --- what it costs -----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n", [3, 300])
def test_a_public_page_takes_four_statements_whatever_its_size(
    edition: Edition, owner: User, client: Client, n: int
) -> None:
    rows = board_rows.fill(edition, n=n, user=owner)
    client.get(PAGE)  # whoever finds a changed board draws it, for all who follow
    addresses = addresses_of(rows)
    for address in addresses:
        # Whoever compares first asks a worker to, and whoever asks for a time first reads its board.
        if (
            address.startswith(("/compare/", "/methods/"))
            or address.endswith("/charts/")
            or "?at=" in address
        ):
            client.get(address)
    forget_boards()
    client.get(PAGE, headers={"HX-Request": "true"})  # reads the rows, and is not kept itself
    counts = {address: n_queries(client, address) for address in addresses}
    allowed = {address: MAX_QUERIES_AS_OF if "?at=" in address else MAX_QUERIES for address in addresses}
    # A method's page asks for its differences to its neighbours as well.
    allowed |= {each: MAX_QUERIES + 1 for each in addresses if each.startswith("/methods/")}
    assert {address: n for address, n in counts.items() if n > allowed[address]} == {}
    # What workers still compute changes by itself, and a board of another time is for its one reader.
    uncached = ("compare", "/charts/", "?at=")
    kept = [address for address in addresses if not any(part in address for part in uncached)]
    kept = [address for address in kept if not address.startswith("/methods/")]
    assert len(kept) > 7
    assert {n_queries(client, address) for address in kept} == {1}


# --- conditional requests -----------------------------------------------------------------------------------


@pytest.mark.parametrize("address", [PAGE, "/api/v1/methods/{}"])
def test_who_knows_an_answer_is_not_sent_it_again(
    edition: Edition, filled: list[Method], client: Client, address: str
) -> None:
    address = address.format(filled[0].pk)
    first = client.get(address)
    tag = first["ETag"]
    assert tag.startswith('"')
    assert first["Cache-Control"] == "public, no-cache"
    assert {"Cookie", "Authorization", "Accept-Encoding"} <= set(first["Vary"].split(", "))
    second = client.get(address, headers={"If-None-Match": f'"other", {tag}'})
    assert (second.status_code, second.content, second["ETag"]) == (304, b"", tag)
    assert client.get(address, headers={"If-None-Match": f"W/{tag}"}).status_code == 304
    by_hand(lambda: Method.objects.filter(pk=filled[0].pk).update(name="Renamed"))
    third = client.get(address, headers={"If-None-Match": tag})
    assert third.status_code == 200
    assert "Renamed" in third.text


def test_a_method_is_absent_until_it_is_shown_and_then_appears_as_it_is(
    edition: Edition, owner: User, client: Client
) -> None:
    method = Method.objects.create(team=teams.team_of(user=owner), name="Secret")
    address = f"/api/v1/methods/{method.pk}"
    assert client.get(address).status_code == 404
    visibility.change(method=method, visibility="ANONYMOUS", actor=owner, now=timezone.now())
    assert client.get(address).json()["name"] == method.pseudonym
    assert n_queries(client, address) == 1
    mine = Client()
    mine.force_login(owner)
    assert mine.get(address).json()["name"] == "Secret"
    assert client.get(address).json()["name"] == method.pseudonym
    editing.edit(method=method, changes={"n_frames": 3}, actor=owner)
    assert client.get(address).json()["details"]["n_frames"] == 3
    visibility.change(method=method, visibility="PUBLIC", actor=owner, now=timezone.now())
    assert client.get(address).json()["name"] == "Secret"
    teams.rename(team=method.team, name="Eagle Owls", actor=owner, now=timezone.now())
    assert client.get(address).json()["team"] == "Eagle Owls"


def test_nobody_chooses_what_others_are_answered_from_memory(edition: Edition, tmp_path: Path) -> None:
    publish(open_edition(corrected(tmp_path, factor=1.3)))
    address = "/api/v1/splits/test/editions?limit=1"
    first = Client().get(address, headers={"accept": "application/json; indent=8", "host": "evil.example"})
    then = Client().get(address)
    assert then.content == first.content
    assert b"\n" not in then.content
    assert then.headers["Link"].startswith(f"<{settings.SITE_URL}{address}&after=")
