"""The rank ladder: the ranks that each method of a board may have, drawn below each other."""

from collections.abc import Iterable
from typing import Final, NamedTuple

from django.utils.safestring import SafeString

from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.web.boards import whiskers
from leaderboard.web.boards.whiskers import WhiskerScale

MAX_STEPS: Final = 40


class Step(NamedTuple):
    """One method of the ladder, from the ranks `low` to `high`."""

    entry: Entry
    low: int
    high: int
    drawing: SafeString

    @property
    def range(self) -> str:
        return str(self.low) if self.low == self.high else f"{self.low}–{self.high}"


class Ladder(NamedTuple):
    """The first methods of a board, the best first, on one scale of ranks."""

    steps: tuple[Step, ...]
    n_ranks: int  # of the scale
    n_certain: int  # methods whose rank is the only one at 95%
    n_ranked: int
    axis: SafeString

    @property
    def is_certain(self) -> bool:
        """Tell whether no method could have another rank."""
        return self.n_certain == self.n_ranked

    @property
    def n_left_out(self) -> int:
        """Methods beyond the first that are drawn."""
        return self.n_ranked - len(self.steps)

    def note(self, *, by: str = "", is_filtered: bool = False) -> str:
        """Say how many ranks are certain; `by` names the metric where its board shows another one first."""
        if self.is_certain:
            certain = "Every rank is certain at 95% confidence."
        else:
            metric = f" by {by}" if by else ""
            certain = (
                f"{self.n_certain} of {self.n_ranked} ranks with intervals{metric} are certain "
                "at 95% confidence. If the bars of two methods overlap, their order is not certain."
            )
        if is_filtered:
            return f"{certain} All methods with intervals, also those that the filter hides."
        return certain


def rank_ladder(entries: Iterable[Entry], *, primary: str) -> Ladder | None:
    """Draw the rank range of each public entry by `primary`; None where fewer than two have one."""
    ranked = sorted(
        (
            (entry.rank, interval.rank_low, interval.rank_high, entry)
            for entry in entries
            if entry.rank is not None and entry.is_visible_to_all
            for interval in [entry.intervals.get(primary, ConfidenceInterval())]
            if interval.rank_low is not None and interval.rank_high is not None
        ),
        key=lambda step: step[:3],
    )
    if len(ranked) < 2:
        return None
    shown = ranked[:MAX_STEPS]
    n_ranks = max(high for _, _, high, _ in shown)
    # A rank is a step of width 1 and its value the middle: rank 1 goes from 0 to 1.
    scale = WhiskerScale(0.0, float(n_ranks), margin=2.0)
    steps = tuple(
        Step(entry, low, high, whiskers.whisker(scale, rank - 0.5, (low - 1.0, float(high))))
        for rank, low, high, entry in shown
    )
    return Ladder(
        steps=steps,
        n_ranks=n_ranks,
        n_certain=sum(low == high for _, low, high, _ in ranked),
        n_ranked=len(ranked),
        axis=whiskers.axis(scale, {rank - 0.5: rank for rank in (1, n_ranks)}),
    )
