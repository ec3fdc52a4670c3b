"""How finely intervals and p-values of hidden splits are published, and for what pairs.

A file can be made so that such numbers give labels away. On a hidden split the ends of intervals are
therefore rounded outwards, to a step of the edition or to about a tenth of their width if that is more, p is
a class, and only public methods of different teams are compared; teams get the same of their own methods. See
`docs/security.md` and `tests/security/probing.py`.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator import Difference
from evaluator.metrics.protocol import PROTOCOLS
from evaluator.metrics.registry import MID, RTE
from leaderboard.boards.rows import Entry
from leaderboard.models import Edition, Submission, Visibility
from leaderboard.storage import hidden_marks

Floats = NDArray[np.float64]

STEPS_IN_A_WIDTH: Final = 10
_ROUND: Final = (5, 2, 1)
HIDDEN_METRICS: Final = frozenset({MID, RTE})
"""The metrics of hidden splits; any other one would reveal more than `docs/hidden-values.md` says."""


# --- how fine --------------------------------------------------------------------------------------------


def step_of(width: float, *, decimals: int, least: float | None = None) -> float:
    """Return the grid of an interval's ends: 1, 2 or 5 times a power of ten, at most a tenth of `width`.

    Never finer than scores are published, nor than `least`, the step of the edition: a narrow interval would
    otherwise have fine ends, and an attacker's files can have narrow intervals.

    >>> step_of(7.1, decimals=1), step_of(0.3, decimals=1), step_of(24.0, decimals=1)
    (0.5, 0.1, 2.0)
    >>> step_of(0.3, decimals=1, least=0.5), step_of(24.0, decimals=1, least=0.5)
    (0.5, 2.0)
    """
    finest = max(round(10.0**-decimals, decimals), least or 0.0)
    tenth = width / STEPS_IN_A_WIDTH
    if not tenth > finest:
        return finest
    power = 10.0 ** math.floor(math.log10(tenth))
    step = next(n * power for n in _ROUND if n * power <= tenth or n == 1)
    return max(round(step, decimals), finest)


def coarse_ends(low: float, high: float, *, decimals: int, least: float | None = None) -> tuple[float, float]:
    """Round both ends of an interval outwards to their grid.

    >>> coarse_ends(13.61, 20.68, decimals=1), coarse_ends(-0.31, 0.02, decimals=1)
    ((13.5, 21.0), (-0.4, 0.1))
    >>> coarse_ends(-0.31, 0.02, decimals=1, least=0.5)
    (-0.5, 0.5)
    """
    step = step_of(high - low, decimals=decimals, least=least)
    # What is left of rounding must not move an end that stands on the grid.
    slack = 1e-9
    ends = math.floor(low / step + slack) * step, math.ceil(high / step - slack) * step
    return round(ends[0], decimals) + 0.0, round(ends[1], decimals) + 0.0


def is_hidden(edition: Edition) -> bool:
    """Tell whether the ground truth is hidden, for workers: a mark outweighs the database."""
    return edition.split.is_hidden or hidden_marks.is_marked(edition.ground_truth_id)


def hidden_protocols() -> tuple[str, ...]:
    """Return the names of the protocols that a hidden split may have."""
    return tuple(name for name, each in PROTOCOLS.items() if HIDDEN_METRICS.issuperset(each.metrics))


def published_ends(low: Floats, high: Floats, *, edition: Edition) -> tuple[Floats, Floats]:
    """Round the ends of intervals as an edition publishes them; NaN stays."""
    if not is_hidden(edition):
        return np.round(low, edition.decimals), np.round(high, edition.decimals)
    shown = np.array(
        [
            (np.nan, np.nan) if np.isnan(a) or np.isnan(b) else _ends_of(a, b, edition=edition)
            for a, b in zip(low.ravel().tolist(), high.ravel().tolist(), strict=True)
        ]
    ).reshape(-1, 2)
    return shown[:, 0].reshape(low.shape), shown[:, 1].reshape(high.shape)


def published_difference(computed: Difference, shown: Difference, *, edition: Edition) -> Difference:
    """Round a difference as an edition publishes it: `computed` unrounded, `shown` with its decimals.

    On a hidden split the ends are rounded outwards, so 0 may be an end although p is below 0.05: `p_below`
    alone says what is significant.
    """
    if not is_hidden(edition):
        return shown
    # In how many units two files differ would tell of others' predictions.
    shown = replace(shown, n_different=None, n_units=None)
    if computed.low is None or computed.high is None:
        return shown
    low, high = _ends_of(computed.low, computed.high, edition=edition)
    low, high = min(low, shown.difference), max(high, shown.difference)
    return replace(shown, low=low, high=high, p=None)


def _ends_of(low: float, high: float, *, edition: Edition) -> tuple[float, float]:
    return coarse_ends(low, high, decimals=edition.decimals, least=edition.least_step)


# --- of which pairs --------------------------------------------------------------------------------------


def why_withheld(first: Entry, second: Entry, *, edition: Edition) -> str:
    """Say why interval and p of a pair, as their reader sees it, are withheld; "" if they are published."""
    for entry in (first, second):
        if entry.visibility == Visibility.ANONYMOUS and not entry.is_mine:
            return (
                f"Differences from {entry.method} have no interval or p-value until the method is public, "
                "because they could reveal its team."
            )
    if not edition.split.is_hidden:
        return ""
    for entry in (first, second):
        if entry.visibility != Visibility.PUBLIC:
            return (
                f"No confidence interval and no p-value: {entry.method} is not public, and the ground "
                f"truth of {edition.split.title} is hidden. {_POSSIBLE}"
            )
    # Teams that show a method have different names, by a constraint of the database.
    if first.team == second.team:
        return (
            "No confidence interval and no p-value: both methods are of one team, and the ground truth of "
            f"{edition.split.title} is hidden. {_POSSIBLE}"
        )
    return ""


def why_withheld_by_mark(first: Submission, second: Submission, *, edition: Edition) -> str:
    """Say the same for workers: a mark may call hidden what the database calls open."""
    if edition.split.is_hidden or not hidden_marks.is_marked(edition.ground_truth_id):
        return ""
    methods = (first.method, second.method)
    if methods[0].team_id != methods[1].team_id and all(m.visibility == Visibility.PUBLIC for m in methods):
        return ""
    return (
        f"No confidence interval and no p-value: the ground truth of {edition.split.title} was imported as "
        f"hidden. {_POSSIBLE}"
    )


_POSSIBLE: Final = (
    "There, only public methods of different teams are compared; compare these two on a split with open "
    "ground truth, or their files offline with tsttc compare."
)
