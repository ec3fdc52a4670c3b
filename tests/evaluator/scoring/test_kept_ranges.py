"""What is kept of the pairs of a board says the same as all pairs do, whatever came and went."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluator.scoring.pairs import Pairs
from evaluator.scoring.ranges import KeptRanges, Quoted, rank_ranges
from tests.evaluator.recordings import Floats, some_sums

USABLE = np.array([True, False, True])


class Board:
    """Entries of three columns and what is kept of them; some have no value in the last one."""

    def __init__(self, seed: int, *, step: float, papers: list[float]) -> None:
        sums, counts = some_sums(seed, n_entries=12, step=step)
        others, _ = some_sums(seed + 1, n_entries=12, step=step)
        self.sums = np.concatenate([sums, sums, others], axis=2)
        self.published = np.round(self.sums.sum(axis=1) / counts.sum(axis=0), 1)
        self.published[[2, 9], 2] = np.nan
        self.quoted = quoted_of(papers, counts)
        self.kept = KeptRanges(
            n_recordings=len(counts), usable=USABLE, rng=np.random.default_rng(5), quoted=self.quoted
        )
        self.present: list[int] = []

    def add(self, entries: list[int]) -> None:
        new = [each for each in entries if each not in self.present]
        self.kept.add(new, sums=self.sums[new], published=self.published[new])
        self.present += new

    def remove(self, entries: list[int]) -> None:
        gone = [each for each in entries if each in self.present]
        self.kept.remove(gone)
        self.present = [each for each in self.present if each not in gone]

    def check(self) -> None:
        """The ranges of all who are there, of the pairs kept and of all pairs."""
        kept = self.kept.ranges(self.present)
        anew = rank_ranges(
            self.sums[self.present],
            published=self.published[self.present],
            usable=USABLE,
            rng=np.random.default_rng(5),
            quoted=self.quoted,
        )
        assert np.array_equal(kept.low, anew.low)
        assert np.array_equal(kept.high, anew.high)


def quoted_of(papers: list[float], counts: Floats) -> Quoted | None:
    if not papers:
        return None
    values = np.tile(np.array(papers)[:, None], 3)
    values[0, 2] = np.nan
    return Quoted(values, np.where(np.isnan(values), np.nan, 0.05), np.tile(counts, 3))


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1_000),
    step=st.sampled_from([0.0, 0.2, 0.5, 2.0]),
    papers=st.sampled_from([[], [20.0], [18.2, 20.3, 21.0]]),
    changes=st.lists(
        st.tuples(st.booleans(), st.lists(st.integers(0, 11), min_size=1, max_size=4, unique=True)),
        min_size=1,
        max_size=6,
    ),
)
def test_any_additions_and_withdrawals_leave_what_all_pairs_give(
    seed: int, step: float, papers: list[float], changes: list[tuple[bool, list[int]]]
) -> None:
    board = Board(seed, step=step, papers=papers)
    board.add([0, 1, 2, 3])
    for is_added, entries in changes:
        (board.add if is_added else board.remove)(entries)
        board.check()


def test_what_is_kept_is_the_same_bit_for_bit_in_whatever_order_entries_came() -> None:
    board = Board(7, step=0.5, papers=[])
    column = board.sums[:, :, 0], board.published[:, 0]
    signs = np.random.default_rng(5).choice([-1.0, 1.0], size=(column[0].shape[1], 2_000))
    one, other = Pairs(signs, n_slots=12), Pairs(signs, n_slots=14)
    slots = np.arange(12)
    for pairs, order in ((one, slots), (other, slots[::-1].copy())):
        for some in np.array_split(order, 1 if pairs is one else 5):
            pairs.add(some, sums=column[0][some], values=column[1][some], kind=0, between=lambda: None)
    other.add(np.array([12, 13]), sums=column[0][:2] * 1.01, values=column[1][:2] + 0.2, kind=0, between=int)
    other.remove(np.array([13, 12]), between=lambda: None)
    for name in ("_turned", "_largest"):
        assert getattr(one, name).tobytes() == getattr(other, name)[: len(getattr(one, name))].tobytes()
    assert one.step_down(between=int) == other.step_down(between=int)


def test_a_board_grows_beyond_the_room_that_it_began_with() -> None:
    board = Board(3, step=0.2, papers=[20.3])
    n_bytes = board.kept.nbytes
    many = np.repeat(board.sums, 8, axis=0) * np.linspace(0.9, 1.1, 96)[:, None, None]
    published = np.repeat(board.published, 8, axis=0) + np.arange(96)[:, None]
    board.kept.add([f"many {i}" for i in range(96)], sums=many, published=published)
    board.add([0, 5])
    assert board.kept.nbytes > n_bytes
    board.kept.remove([f"many {i}" for i in range(96)])
    board.check()
