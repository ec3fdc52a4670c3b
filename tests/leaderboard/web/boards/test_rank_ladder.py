"""The rank ladder below a board."""

from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.models import Visibility
from leaderboard.web.boards.rank_ladder import MAX_STEPS, rank_ladder


def entry(
    rank: int | None, low: int | None, high: int | None, *, visibility: str = Visibility.PUBLIC
) -> Entry:
    interval = ConfidenceInterval(rank_low=low, rank_high=high)
    return Entry(
        kind="submission",
        method=f"M{rank}",
        team="T",
        scores={"mid": 1.0},
        rank=rank,
        intervals={"mid": interval},
        visibility=visibility,
    )


def test_ladder_begins_with_the_best_whatever_the_board_is_sorted_by() -> None:
    ladder = rank_ladder([entry(3, 2, 3), entry(1, 1, 1), entry(2, 2, 3)], primary="mid")
    assert ladder is not None
    assert [(step.entry.rank, step.low, step.high) for step in ladder.steps] == [
        (1, 1, 1),
        (2, 2, 3),
        (3, 2, 3),
    ]
    assert (ladder.n_certain, ladder.n_ranks, ladder.n_left_out) == (1, 3, 0)
    assert not ladder.is_certain


def test_private_rows_and_rows_without_a_range_are_no_steps() -> None:
    rows = [
        entry(1, 1, 2),
        entry(2, None, None),
        entry(2, 1, 2),
        entry(1, 1, 2, visibility=Visibility.PRIVATE),
    ]
    ladder = rank_ladder(rows, primary="mid")
    assert ladder is not None
    assert [step.entry.rank for step in ladder.steps] == [1, 2]
    assert rank_ladder(rows[:2], primary="mid") is None, "one range alone is no ladder"


def test_a_long_board_says_how_many_methods_are_left_out() -> None:
    ladder = rank_ladder([entry(rank, rank, rank) for rank in range(1, MAX_STEPS + 3)], primary="mid")
    assert ladder is not None
    assert (len(ladder.steps), ladder.n_left_out) == (MAX_STEPS, 2)
    assert ladder.is_certain, "also of those left out"


def test_note_of_a_ladder_counts_the_certain_ranks_and_names_the_metric_where_asked() -> None:
    ladder = rank_ladder([entry(1, 1, 1), entry(2, 2, 3), entry(3, 2, 3)], primary="mid")
    assert ladder is not None
    assert ladder.note() == (
        "1 of 3 ranks with intervals are certain at 95% confidence. "
        "If the bars of two methods overlap, their order is not certain."
    )
    assert ladder.note(by="MiD").startswith("1 of 3 ranks with intervals by MiD are certain")
    assert ladder.note(is_filtered=True).endswith(
        "not certain. All methods with intervals, also those that the filter hides."
    )
    assert [step.range for step in ladder.steps] == ["1", "2–3", "2–3"]


def test_note_of_a_ladder_whose_ranks_are_all_certain_is_one_sentence() -> None:
    ladder = rank_ladder([entry(1, 1, 1), entry(2, 2, 2)], primary="mid")
    assert ladder is not None
    assert ladder.note(by="MiD") == "Every rank is certain at 95% confidence."
