"""Metrics: errors of single sequences, their names and units, and ranks.

To add one, define it here and name it in a protocol of `protocol.py`.
"""

# numpy is imported late: `tsttc --help` answers without it.

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from evaluator.metrics.scale import Floats

WARNING_S: Final = 2.7
"""The time to contact of a forward collision warning, which the paper cites."""


@dataclass(frozen=True, slots=True)
class Terms:
    """The input of a metric: float64 arrays of one shape; `true_log_scale_ratio` is ln α₁₀(τ)."""

    predicted_ttc_s: Floats
    true_ttc_s: Floats
    predicted_scale_ratio: Floats  # α₁₀
    true_log_scale_ratio: Floats

    @classmethod
    def of(cls, predicted_ttc_s: ArrayLike, true_ttc_s: ArrayLike) -> Terms:
        """Compute the scale ratios of times to contact in seconds, whose shapes broadcast."""
        import numpy as np  # noqa: PLC0415 -- as the docstring above says

        from evaluator.arrays import as_floats  # noqa: PLC0415 -- loads numpy
        from evaluator.metrics.scale import exact_log, scale_ratio_10hz  # noqa: PLC0415 -- loads numpy

        predicted, true = np.broadcast_arrays(as_floats(predicted_ttc_s), as_floats(true_ttc_s))
        return cls(predicted, true, scale_ratio_10hz(predicted), exact_log(scale_ratio_10hz(true)))


@dataclass(frozen=True, slots=True)
class Metric:
    """An error of a prediction: at least 0 and finite, lower is better; a score is its mean.

    `name` (lower-case letters, digits) is part of score names; tables show `symbol` and `unit`; `decimals` is
    the default of editions.
    """

    name: str
    symbol: str
    unit: str
    title: str
    decimals: int
    function: Callable[[Terms], Floats]

    def errors(self, predicted_ttc_s: ArrayLike, true_ttc_s: ArrayLike) -> Floats:
        """Compute the errors of predictions (seconds, shapes broadcast); NaN where undefined.

        >>> round(float(MID.errors(5.0, 4.0)), 6), float(RTE.errors(5.0, 4.0))
        (48.899805, 25.0)
        """
        return self.function(Terms.of(predicted_ttc_s, true_ttc_s))

    @property
    def heading(self) -> str:
        """Symbol and unit, such as "RTE %"."""
        return f"{self.symbol} {self.unit}".rstrip()

    @property
    def unit_of_value(self) -> str:
        """The unit after a value in a sentence, with its space if it has one; empty for a power of ten.

        >>> MID.unit_of_value, RTE.unit_of_value
        ('', '%')
        """
        if self.unit.startswith("×"):
            return ""
        return self.unit if self.unit in {"", "%"} else f" {self.unit}"

    @property
    def unit_of_difference(self) -> str:
        """The unit after a difference of two values."""
        return " percentage points" if self.unit == "%" else self.unit_of_value


def _motion_in_depth_error(terms: Terms) -> Floats:
    """Compute MiD = |ln α₁₀(τ) − ln α₁₀(τ̂)| · 10⁴; NaN where α₁₀ is not positive."""
    # numpy's logarithm is fast, but its last bit depends on the processor. Where the two logarithms nearly
    # cancel, that bit shows, so the C library's is used there.
    import numpy as np  # noqa: PLC0415 -- as the docstring above says

    from evaluator.metrics.scale import exact_log  # noqa: PLC0415 -- loads numpy

    true_log, ratio = terms.true_log_scale_ratio, terms.predicted_scale_ratio
    with np.errstate(divide="ignore", invalid="ignore"):
        # In place, here and below: the arrays decide how much memory an evaluation takes.
        error = np.asarray(np.log(ratio))
        np.subtract(true_log, error, out=error)
        np.abs(error, out=error)
        limit = np.asarray(np.abs(true_log))
        limit *= 1e-3
        close = error < limit
    if close.any():
        error[close] = np.abs(true_log[close] - exact_log(ratio[close]))
    error *= 1e4
    return error


def _relative_ttc_error(terms: Terms) -> Floats:
    """Compute RTE = |(τ̂ − τ) / τ| · 100%."""
    import numpy as np  # noqa: PLC0415 -- as the docstring above says

    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        error = np.asarray(terms.predicted_ttc_s - terms.true_ttc_s)
        error /= terms.true_ttc_s
        np.abs(error, out=error)
        error *= 100.0
    return error


def is_warning(ttc_s: Floats, *, threshold_s: float | Floats) -> NDArray[np.bool_]:
    """Whether a collision warning is due at each of these times: 0 < τ ≤ threshold."""
    return (ttc_s > 0.0) & (ttc_s <= threshold_s)


def _warning_error(terms: Terms) -> Floats:
    """Compute 100% where one of τ̂ and τ is in (0 s, 2.7 s] and the other is not, else 0; NaN of NaN."""
    import numpy as np  # noqa: PLC0415 -- as the docstring above says

    warned, due = (
        is_warning(ttc_s, threshold_s=WARNING_S) for ttc_s in (terms.predicted_ttc_s, terms.true_ttc_s)
    )
    error = np.where(warned != due, 100.0, 0.0)
    error[np.isnan(terms.predicted_ttc_s) | np.isnan(terms.true_ttc_s)] = math.nan
    return error


MID: Final = Metric("mid", "MiD", "×10⁻⁴", "Motion-in-depth error", 2, _motion_in_depth_error)
RTE: Final = Metric("rte", "RTE", "%", "Relative TTC error", 2, _relative_ttc_error)
WARNING: Final = Metric("warning", "WE", "%", "Warning error", 2, _warning_error)


def rank(values: Sequence[float | None]) -> list[int | None]:
    """Rank values as 1, 2, 2, 4: equal values share a rank; None has none.

    >>> rank([14.8, 14.3, None, 14.8, 40.5])
    [2, 1, None, 2, 4]
    """
    first_rank: dict[float, int] = {}
    for position, value in enumerate(_ascending(values), 1):
        first_rank.setdefault(value, position)
    return [None if value is None else first_rank[value] for value in values]


def best_and_second(values: Sequence[float | None]) -> tuple[frozenset[int], frozenset[int]]:
    """Return the indices of the smallest and of the second smallest distinct value, ties included.

    >>> best, second = best_and_second([14.8, 14.3, None, 14.8])
    >>> sorted(best), sorted(second)
    ([1], [0, 3])
    """
    distinct = sorted(set(_ascending(values)))
    marks = [frozenset(i for i, value in enumerate(values) if value == wanted) for wanted in distinct[:2]]
    marks += [frozenset()] * (2 - len(marks))
    return marks[0], marks[1]


def _ascending(values: Sequence[float | None]) -> list[float]:
    given = [value for value in values if value is not None]
    if any(math.isnan(value) for value in given):
        raise ValueError("NaN has no rank; a missing value is None.")
    return sorted(given)
