"""`listing.board`: the order of the rows, and who sees which."""

from datetime import UTC, datetime

import pytest
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone

from evaluator import get_protocol
from leaderboard.boards import listing
from leaderboard.models import Edition, Method, PublishedResult, Split, Submission, User, Visibility
from tests import builders

ANYBODY = AnonymousUser()


def split_called(name: str = "test") -> Split:
    return Split.objects.select_related("current_edition").get(pk=name)


def ranks(board: listing.Board) -> list[tuple[int | None, str]]:
    return [(entry.rank, entry.method) for entry in board.entries]


@pytest.mark.usefixtures("benchmark")
def test_published_rows_stand_in_rank_order_before_any_submission() -> None:
    board = listing.board(split=split_called(), viewer=ANYBODY)
    assert ranks(board) == [
        (1, "Deep Scale"),
        (2, "Deep Scale (NeRF)"),
        (3, "Pixel MSE"),
        (4, "SOT"),
        (5, "Detection"),
    ]
    assert not board.is_open
    assert all(entry.kind == "published" and entry.source for entry in board.entries)


def test_best_and_second_of_each_column_are_marked(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.0000001), method="Near")
    builders.score_all()
    near, deep, *_ = listing.board(split=split_called(), viewer=ANYBODY).entries
    assert (near.method, near.rank) == ("Near", 1)
    assert "mid" in near.best
    assert "mid" in deep.second


def test_equal_published_values_share_a_rank_and_the_next_is_skipped(edition: Edition, owner: User) -> None:
    for method, factor in (("A", 1.0000001), ("B", 1.0000002)):
        builders.submit(owner, builders.predictions(edition, factor=factor), method=method)
    builders.score_all()
    board = listing.board(split=split_called(), viewer=ANYBODY)
    assert ranks(board)[:3] == [(1, "A"), (1, "B"), (3, "Deep Scale")]


def test_waiting_and_rejected_submissions_are_not_on_the_board(edition: Edition, owner: User) -> None:
    builders.submit(owner, b"{}", method="Broken")
    builders.score_all()
    builders.submit(owner, builders.predictions(edition), method="Waiting")
    board = listing.board(split=split_called(), viewer=owner)
    assert board.n_submissions == 0
    assert len(board.entries) == 5


def test_a_method_is_represented_by_its_best_active_submission(edition: Edition, owner: User) -> None:
    best = builders.submit(owner, builders.predictions(edition, factor=1.05))
    builders.submit(owner, builders.predictions(edition, factor=1.5))
    builders.score_all()

    def shown() -> list[object]:
        entries = listing.board(split=split_called(), viewer=ANYBODY).entries
        return [entry.submission_id for entry in entries if entry.kind == "submission"]

    assert shown() == [best.pk]
    Submission.objects.filter(pk=best.pk).update(withdrawn_at=timezone.now())
    assert len(shown()) == 1
    assert shown() != [best.pk]


def test_private_method_is_seen_by_its_team_alone_and_takes_nobodys_rank(
    edition: Edition, owner: User, teammate: User, stranger: User, maintainer: User
) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.0000001), method="Secret")
    builders.score_all()
    Method.objects.update(visibility=Visibility.PRIVATE)
    without = listing.board(split=split_called(), viewer=ANYBODY)
    for viewer in (stranger, maintainer):
        assert listing.board(split=split_called(), viewer=viewer).entries == without.entries
    for viewer in (owner, teammate):
        board = listing.board(split=split_called(), viewer=viewer)
        assert ranks(board)[:2] == [(1, "Secret"), (1, "Deep Scale")]
        secret = next(entry for entry in board.entries if entry.method == "Secret")
        assert secret.is_mine
        assert not secret.best
        others = [entry for entry in board.entries if entry.method != "Secret"]
        assert others == list(without.entries)


@pytest.mark.slow
def test_every_column_sorts_and_ranks_do_not_change(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    expected = sorted(ranks(listing.board(split=split_called(), viewer=ANYBODY)))
    known = {*listing.TEXT_COLUMNS, *get_protocol(edition.protocol).score_names}
    for column in (f"{sign}{name}" for sign in ("", "-") for name in known):
        board = listing.board(split=split_called(), viewer=ANYBODY, sort=column)
        assert sorted(ranks(board)) == expected
        name = column.removeprefix("-")
        if name not in listing.TEXT_COLUMNS:
            values = [entry.scores[name] for entry in board.entries]
            assert values == sorted(values, reverse=column.startswith("-"))  # type: ignore[type-var]  # all have values


def test_a_row_without_the_value_is_last_in_either_direction_and_has_no_rank(
    benchmark: None, tmp_path, owner: User
) -> None:
    result = PublishedResult.objects.get(split="test", slug="sot")
    result.scores = {**result.scores, "mid": None}
    result.save()
    for sort in ("mid", "-mid", "rank"):
        last = listing.board(split=split_called(), viewer=ANYBODY, sort=sort).entries[-1]
        assert (last.method, last.rank) == ("SOT", None)


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("2026-11-20", datetime(2026, 11, 20, 23, 59, 59, 999999, tzinfo=UTC)),
        ("2026-11-20T18:00", datetime(2026, 11, 20, 18, tzinfo=UTC)),
        ("2026-11-20T18:00:00+02:00", datetime(2026, 11, 20, 16, tzinfo=UTC)),
    ],
)
def test_date_means_its_end_and_a_time_its_moment(text: str, moment: datetime) -> None:
    assert listing.parse_time(text) == moment


@pytest.mark.parametrize("text", ["", "soon", "2026-13-40", "0001-01-01T00:00:00+14:00", "2026-11-20T25:00"])
def test_what_is_no_moment_is_named_as_such(text: str) -> None:
    with pytest.raises(listing.BadTime, match="is not a date or a time; expected one such as 2026-11-20"):
        listing.parse_time(text)
