"""The contact lens: errors of compared methods in seconds and metres, as contact comes closer."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple
from uuid import UUID

from evaluator.metrics.registry import RTE
from leaderboard.boards.rows import Entry
from leaderboard.models import Visibility

SPEEDS_KMH: Final = (30, 50, 80, 120)
START_KMH: Final = 80
_KMH_PER_MS: Final = 3.6

Curve = Sequence[Mapping[str, Any]]


class Step(NamedTuple):
    """One bin of true times to contact, with each method's mean error in seconds, None where it has none."""

    low_s: float
    high_s: float
    errors_s: tuple[float | None, ...]

    @property
    def errors(self) -> list[tuple[float | None, float | None]]:
        """Each method's error in seconds, and in metres at the speed of the start."""
        per_s = START_KMH / _KMH_PER_MS
        return [(error_s, None if error_s is None else error_s * per_s) for error_s in self.errors_s]


class Lens(NamedTuple):
    """The steps of a lens, from the farthest to contact."""

    entries: tuple[Entry, ...]
    steps: tuple[Step, ...]
    speeds_kmh: tuple[int, ...] = SPEEDS_KMH
    start_kmh: int = START_KMH


def contact_lens(entries: Sequence[Entry], curves: Mapping[UUID, Curve]) -> Lens | None:
    """Return the lens of the entries that have a curve, by their evaluation; None where fewer than two have.

    A row of somebody else without a name has none here: a curve tells more of its network than its scores do.
    A mean relative error of a bin times the middle of the bin is its error in seconds.
    """
    drawn = [
        (entry, curve)
        for entry in entries
        if entry.evaluation_id
        and (entry.is_mine or entry.visibility != Visibility.ANONYMOUS)
        and (curve := curves.get(entry.evaluation_id)) is not None
    ]
    by_bin = [
        {
            (row["low_s"], row["high_s"]): row[RTE.name]
            for row in curve
            if row["low_s"] >= 0 and RTE.name in row
        }
        for _, curve in drawn
    ]
    bins = sorted(set().union(*by_bin), reverse=True)
    if len(drawn) < 2 or not bins:
        return None
    steps = (
        Step(low_s, high_s, tuple(_seconds(each.get((low_s, high_s)), low_s, high_s) for each in by_bin))
        for low_s, high_s in bins
    )
    return Lens(tuple(entry for entry, _ in drawn), tuple(steps))


def _seconds(error_percent: float | None, low_s: float, high_s: float) -> float | None:
    return None if error_percent is None else error_percent / 100 * (low_s + high_s) / 2
