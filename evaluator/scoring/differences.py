"""The difference of two entries: a sign-flip test, and its confidence interval by test inversion.

D_g is the sum of errors of unit g (a day or a recording) of the first entry minus that of the second, n_g its
number of sequences. Test and interval use the same random signs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from evaluator.metrics.protocol import DEFAULT_PROTOCOL, Protocol, ProtocolName, get_protocol, primary_of
from evaluator.metrics.scale import Floats
from evaluator.predictions.loading import Predictions
from evaluator.scoring.results import rounded
from evaluator.scoring.scores import Scorer
from evaluator.scoring.significance import (
    MIN_DIFFERENT,
    SIGNIFICANT,
    Difference,
    Influence,
    cut_off,
    p_below,
)
from evaluator.scoring.uncertainty import by_units, degrees_of, generator_of, usable_columns
from evaluator.truth.ground_truth import GroundTruth
from evaluator.units import RECORDING, UnitKind

N_SIGN_FLIPS: Final = 9_999
P_DECIMALS: Final = 4
"""As many as a p of so many flips has."""
PUBLISHED_DECIMALS: Final = get_protocol(DEFAULT_PROTOCOL).decimals

_BLOCK: Final = 1_000
# Beside the sum of the differences' sizes, what is below this is left of rounding.
_NO_SUM: Final = 1e-12
_SEEDS: Final = 2**63 - 1


@dataclass(frozen=True, slots=True, eq=False)
class SignFlips:
    """Results by column, float64 (columns,): `p` is below 0.05 exactly where 0 is outside `low` … `high`."""

    p: Floats
    low: Floats
    high: Floats


def sign_flips(
    differences: Floats, counts: Floats, *, rng: np.random.Generator, n_flips: int = N_SIGN_FLIPS
) -> SignFlips:
    """Test each column of `differences` by its `counts`, (G, columns) both, and invert the test.

        p = (1 + #{|Σ ±D_g| ≥ |Σ D_g|}) / (R + 1)

    The test assumes that D_g is symmetric under the null hypothesis. The p of a difference δ is that of D_g −
    δ n_g; the interval is every δ with p ≥ 0.05 (Hartigan, JASA 64, 1969). Signs with the sum S₊ over n₊
    sequences in one half, S₋ over n₋ in the other, count against δ as

        |Σ ±(D_g − δ n_g)| ≥ |Σ (D_g − δ n_g)|   ⇔   δ is between S₊ / n₊ and S₋ / n₋.

    The interval runs from the k-th smallest lower end to the k-th largest upper one, k the smallest number
    with (1 + k) / (R + 1) ≥ 0.05. An empty half counts against every δ. Very few units give −∞ … ∞.
    """
    n_columns = differences.shape[1]
    both = np.concatenate([differences, counts], axis=1)
    total, nothing = both.sum(axis=0), np.zeros(2 * n_columns)
    nothing[:n_columns] = _NO_SUM * np.abs(differences).sum(axis=0)
    lower, upper = np.empty((2, n_columns, n_flips))
    for start in range(0, n_flips, _BLOCK):
        block = slice(start, min(start + _BLOCK, n_flips))
        size = (block.stop - start, len(differences))
        turned = (rng.integers(0, 2, size=size, dtype=np.int8) * 2.0 - 1.0) @ both
        plus, minus = (_nothing_left(total + turned, nothing), _nothing_left(total - turned, nothing))
        lower[:, block], upper[:, block] = _stretches(plus.T, minus.T)
    n_as_large = ((lower <= 0) & (upper >= 0)).sum(axis=1)
    low, high = _ends(lower, upper)
    with np.errstate(invalid="ignore"):
        observed = total[:n_columns] / total[n_columns:]
    # An end may lie beyond what was observed by rounding alone, where all units differ by the same.
    p = np.asarray((1 + n_as_large) / (n_flips + 1))
    return SignFlips(p, np.fmin(low, observed), np.fmax(high, observed))


def _nothing_left(twice: Floats, nothing: Floats) -> Floats:
    # Sums of the same numbers in another order differ by rounding: the rest of nothing is 0.
    twice[np.abs(twice) <= nothing] = 0.0
    return twice


def _stretches(plus: Floats, minus: Floats) -> tuple[Floats, Floats]:
    """Compute the differences about which two halves disagree, from sums and numbers, (2 columns, n)."""
    n_columns = len(plus) // 2
    is_empty = (plus[n_columns:] == 0) | (minus[n_columns:] == 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = plus[:n_columns] / plus[n_columns:], minus[:n_columns] / minus[n_columns:]
    lower, upper = np.minimum(one, other), np.maximum(one, other)
    return np.where(is_empty, -np.inf, lower), np.where(is_empty, np.inf, upper)


def _ends(lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Compute each column's interval, (columns,) low and high, from stretches (columns, R)."""
    n_flips = lower.shape[1]
    k = next(k for k in range(n_flips + 1) if (1 + k) / (n_flips + 1) >= SIGNIFICANT)
    if k == 0:
        return np.full(len(lower), -np.inf), np.full(len(upper), np.inf)
    low = np.partition(lower, k - 1, axis=1)[:, k - 1]
    return low, np.partition(upper, n_flips - k, axis=1)[:, n_flips - k]


def difference(
    first: Floats,
    second: Floats,
    counts: Floats,
    *,
    names: Sequence[str],
    signs: np.random.Generator,
    n_flips: int = N_SIGN_FLIPS,
    unit: str = RECORDING,
) -> dict[str, Difference]:
    """Compare sums (G, columns) of two entries over the same sequences; empty columns are absent."""
    gaps, n, degrees = first - second, counts.sum(axis=0), degrees_of(counts)
    flips = sign_flips(gaps, counts, rng=signs, n_flips=n_flips)
    # With 8 degrees of freedom there are 8 units, and an end is missing after a few dozen flips alone.
    n_different = np.count_nonzero(np.abs(gaps) > _NO_SUM * (np.abs(first) + np.abs(second)), axis=0)
    is_known = usable_columns(counts) & np.isfinite(flips.low) & np.isfinite(flips.high)
    is_known &= n_different >= MIN_DIFFERENT
    return {
        name: Difference(
            float(gaps[:, i].sum() / n[i]),
            low=float(flips.low[i]) if is_known[i] else None,
            high=float(flips.high[i]) if is_known[i] else None,
            p=float(flips.p[i]) if is_known[i] else None,
            n_effective=float(degrees[i]),
            unit=unit,
            n_different=int(n_different[i]),
            n_units=int(np.count_nonzero(counts[:, i])),
        )
        for i, name in enumerate(names)
        if n[i] > 0
    }


def influence(
    differences: Floats, counts: Floats, *, rng: np.random.Generator, n_flips: int = N_SIGN_FLIPS
) -> Influence:
    """Count the units to leave out until a difference is insignificant, and until its sign changes.

    `differences` and `counts` are those of one column, (units,). Units that favour the better entry most are
    left out first. The first number is an upper bound (Broderick, Giordano and Meager, arXiv 2011.14999), the
    second is exact. The first is None if it leaves too few units for a test.
    """
    total = float(differences.sum())
    favours = differences * np.sign(total)
    order = np.argsort(-favours, kind="stable")
    n_favouring = int((favours > 0).sum())
    left = favours.sum() - np.cumsum(favours[order[:n_favouring]])
    # What is left of rounding is no other sign.
    turned = np.flatnonzero(left < -_NO_SUM * np.abs(favours).sum())
    n_to_turn = int(turned[0]) + 1 if turned.size else None
    seed = int(rng.integers(_SEEDS))

    def kept_without(n_left_out: int) -> Floats:
        kept = np.ones(len(order), dtype=np.float64)
        kept[order[:n_left_out]] = 0.0
        return kept

    def is_testable(n_left_out: int) -> bool:
        kept = kept_without(n_left_out)
        n_different = int(np.count_nonzero(differences * kept))
        return n_different >= MIN_DIFFERENT and bool(usable_columns((counts * kept)[:, None])[0])

    def is_significant(n_left_out: int) -> bool:
        kept = kept_without(n_left_out)
        signs = np.random.default_rng(seed)
        rest = sign_flips((differences * kept)[:, None], (counts * kept)[:, None], rng=signs, n_flips=n_flips)
        return bool(rest.p[0] < SIGNIFICANT)

    n_to_undecided = _first_false(is_significant, n_to_turn or n_favouring) if is_significant(0) else None
    if n_to_undecided is not None and not is_testable(n_to_undecided):
        n_to_undecided = None
    return Influence(
        n_units=int((counts > 0).sum()),
        n_to_undecided=n_to_undecided,
        n_to_turn=n_to_turn,
        is_turn_significant=n_to_turn is not None and is_testable(n_to_turn) and is_significant(n_to_turn),
    )


def with_influence(
    compared: Mapping[str, Difference],
    *,
    differences: Floats,
    counts: Floats,
    names: Sequence[str],
    rng: np.random.Generator,
) -> dict[str, Difference]:
    """Add the influence on the difference in the first column, the one that ranks, if that has a p.

    Sums and counts are (units, columns).
    """
    primary = primary_of(names)
    overall = compared.get(primary)
    if overall is None or overall.p_below is None:
        return dict(compared)
    rests_on = influence(differences[:, 0], counts[:, 0], rng=rng)
    return {**compared, primary: replace(overall, influence=rests_on)}


def _first_false(holds: Callable[[int], bool], last: int) -> int:
    """Find the first number up to `last` where `holds` turns false."""
    holding, failing = 0, last
    while failing - holding > 1:
        middle = (holding + failing) // 2
        holding, failing = (middle, failing) if holds(middle) else (holding, middle)
    return failing


def rounded_difference(
    exact: Difference, *, first: float | None, second: float | None, decimals: int
) -> Difference:
    """Round a difference for publication, between two published values.

    It equals the difference of the published values, and its interval holds it. Equal values get p = 1 and an
    interval around 0. Otherwise 0 is outside the interval exactly where the unrounded p is below 0.05: an end
    that would round to 0 becomes one unit of the last digit. Without one of the values, the difference itself
    is rounded.

    >>> rounded_difference(Difference(0.41, 0.003, 0.82, 0.0496), first=1.41, second=1.0, decimals=2)
    Difference(difference=0.41, low=0.01, high=0.82, p=0.0496, p_below=0.05, n_effective=None)
    >>> rounded_difference(Difference(0.003, 0.001, 0.005, 0.0002), first=1.0, second=1.0, decimals=2)
    Difference(difference=0.0, low=0.0, high=0.01, p=1.0, p_below=1.0, n_effective=None)
    """
    if first is None or second is None:
        shown = _rounded(exact.difference, decimals)
    else:
        shown = _rounded(_rounded(first, decimals) - _rounded(second, decimals), decimals)
    if exact.n_effective is not None:
        exact = replace(exact, n_effective=cut_off(exact.n_effective))
    if exact.low is None or exact.high is None or exact.p_below is None:
        return replace(exact, difference=shown)
    low, high = _rounded(exact.low, decimals), _rounded(exact.high, decimals)
    if shown == 0:
        return replace(
            exact, difference=shown, low=min(low, 0.0), high=max(high, 0.0), p=1.0, p_below=p_below(1.0)
        )
    if exact.is_significant:
        unit = _rounded(10.0**-decimals, decimals)
        low, high = (max(low, unit), high) if exact.difference > 0 else (low, min(high, -unit))
    p = None if exact.p is None else _rounded(exact.p, P_DECIMALS)
    return replace(exact, difference=shown, low=min(low, shown), high=max(high, shown), p=p)


def _rounded(value: float, decimals: int) -> float:
    shown = rounded(value, decimals=decimals)
    assert shown is not None  # noqa: S101 - for the type checker: a number stays one
    return shown


def compare_predictions(
    first: Predictions,
    second: Predictions,
    truth: GroundTruth,
    *,
    protocol: ProtocolName | Protocol = DEFAULT_PROTOCOL,
    n_flips: int = N_SIGN_FLIPS,
    decimals: int | None = PUBLISHED_DECIMALS,
    unit: UnitKind | None = None,
) -> dict[str, Difference]:
    """Compare two predictions of the same sequences: first minus second, by score name.

    The result equals an open board's comparison, with random numbers of the truth's revision, rounded to
    `decimals` (None: unrounded). `unit` is as in `confidence_intervals`. A column without sequences is
    absent. Raises as `evaluate` does.
    """
    rules = get_protocol(protocol) if isinstance(protocol, str) else protocol
    one, other = (Scorer(truth, rules).report(each, keep_bags=True) for each in (first, second))
    assert one.bags is not None  # noqa: S101 - they were asked for
    assert other.bags is not None  # noqa: S101 - they were asked for
    units = truth.manifest.units_by(unit)
    sums, other_sums, counts = (
        by_units(each, units) for each in (one.bags.sums, other.bags.sums, one.bags.counts)
    )
    compared = difference(
        sums,
        other_sums,
        counts,
        names=rules.score_names,
        signs=generator_of(truth.digest, purpose="signs"),
        n_flips=n_flips,
        unit=units.kind,
    )
    compared = with_influence(
        compared,
        differences=sums - other_sums,
        counts=counts,
        names=rules.score_names,
        rng=generator_of(truth.digest, purpose="influence"),
    )
    if decimals is None:
        return compared
    values = one.flat(), other.flat()
    return {
        name: rounded_difference(gap, first=values[0][name], second=values[1][name], decimals=decimals)
        for name, gap in compared.items()
    }
