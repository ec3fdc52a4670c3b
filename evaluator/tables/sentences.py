"""Sentences about the difference of two methods: the same on pages and on the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Final

from evaluator.metrics.protocol import column_words, metric_of, split_name
from evaluator.metrics.registry import WARNING
from evaluator.scoring.significance import (
    LEAST_P,
    MIN_DEGREES,
    MIN_DIFFERENT,
    SIGNIFICANT,
    Difference,
    best_of,
    too_few_units,
)
from evaluator.units import in_words

_MAX_NAMED: Final = 3
_DECIMALS_IN_WORDS: Final = {1: "one decimal", 2: "two decimals"}


def p_text(p: float | None, below: float | None = None) -> str:
    """Format a p-value with four decimals, or as the class `below` if p is withheld.

    >>> p_text(0.0496), p_text(0.3), p_text(1.0), p_text(0.0001)
    ('p = 0.0496', 'p = 0.3000', 'p = 1', 'p ≤ 0.0001')
    >>> p_text(None, 0.01), p_text(None, 1.0)
    ('p < 0.01', 'p ≥ 0.05')
    """
    if p is None or p <= LEAST_P:
        return f"p {p_cell(p, below) or f'≥ {SIGNIFICANT:g}'}"
    return "p = 1" if p == 1 else f"p = {p:.4f}"


def p_cell(p: float | None, below: float | None) -> str:
    """Format a p-value for a table; empty without p and class.

    >>> p_cell(0.0496, 0.05), p_cell(1.0, 1.0), p_cell(None, 0.01), p_cell(None, 1.0), p_cell(None, None)
    ('0.0496', '1.0000', '< 0.01', '≥ 0.05', '')
    >>> p_cell(0.0001, 0.001)  # the test gives no smaller one
    '≤ 0.0001'
    """
    if p is not None:
        return f"≤ {LEAST_P:g}" if p <= LEAST_P else f"{p:.4f}"
    if below is None:
        return ""
    return f"< {below:g}" if below <= SIGNIFICANT else f"≥ {SIGNIFICANT:g}"


def sentence(
    first: str, second: str, *, name: str, difference: Difference, decimals: int = 2, withheld: str = ""
) -> str:
    """Describe a difference in one column; `decimals` are those of published values.

    `withheld` is the reason for a missing interval, by default too few units.

    >>> sentence("A", "B", name="mid", difference=Difference(-4.1, -5.3, -2.9, 0.0003))
    'The MiD of A is 4.1 lower than that of B (95% confidence interval: 2.9 to 5.3 lower; p = 0.0003).'
    >>> sentence("A", "B", name="rte", difference=Difference(0.7, 0.2, 1.2, 0.02))  # doctest: +ELLIPSIS
    'The RTE of A is 0.70 percentage points higher than that of B (95% confidence interval: 0.20 to 1.20 ...
    """
    column, unit = column_words(name), metric_of(name).unit_of_difference
    if round(difference.difference, decimals) == 0:
        alike = f"{first} and {second} have the same {column} to {_DECIMALS_IN_WORDS[decimals]}."
        if not withheld and difference.n_different is not None and difference.p_below is None:
            every = in_words(difference.unit, difference.n_units)
            alike += f" They differ in {difference.n_different:,} of {every}."
        return f"{alike} {withheld}".rstrip()
    digits = _digits(difference, decimals)
    gap = (
        f"The {column} of {first} is {_amount(difference.difference, digits)}{unit} "
        f"{_direction(difference.difference)} than that of {second}"
    )
    if withheld:
        return f"{gap}. {withheld}"
    if difference.low is None or difference.high is None or difference.p_below is None:
        if difference.n_effective is not None and difference.n_effective >= MIN_DEGREES:
            return f"{gap}; {difference.why_untested}."
        return f"{gap}; there are {difference.why_untested} to say whether that is significant."
    ends = _ends(difference.difference, difference.low, difference.high, digits)
    if difference.is_significant and 0 in (difference.low, difference.high):
        # So it is on a hidden split alone, where p judges and the ends only say how large.
        ends += ", rounded outwards"
    statement = f"{gap} (95% confidence interval: {ends}; {p_text(difference.p, difference.p_below)})."
    detectable = difference.detectable_difference
    if detectable is None:
        return statement
    return (
        f"{statement} The difference is not significant. The test detects a difference above "
        f"{_amount(detectable, digits)}{unit} with about 80% power."
    )


def _direction(difference: float) -> str:
    return "lower" if difference < 0 else "higher"


def _ends(difference: float, low: float, high: float, digits: int) -> str:
    """Order an interval's ends by size, each with its direction if the directions differ."""
    near, far = (high, low) if difference < 0 else (low, high)
    start = _amount(near, digits)
    if near and (near < 0) != (far < 0):
        start = f"{start} {_direction(near)}"
    return f"{start} to {_amount(far, digits)} {_direction(far or difference)}"


def _amount(value: float, digits: int) -> str:
    # What is not 0 has at least one unit of the last digit.
    unit = 10.0**-digits
    return f"{max(abs(value), unit) if value else 0.0:.{digits}f}"


def _digits(difference: Difference, decimals: int) -> int:
    """Choose decimals, at most `decimals`, that show the difference and two digits of the half width."""
    if difference.low is None or difference.high is None:
        return decimals
    half = (difference.high - difference.low) / 2
    fewest = 0 if half >= 10 else 1 if half >= 0.995 else 2
    smallest = min(abs(value) for value in (difference.difference, difference.low, difference.high) if value)
    # The smallest keeps one significant digit: 0.6 is not shown as 1.
    return min(decimals, max(fewest, next((n for n in (0, 1) if smallest >= 10.0**-n), 2)))


def influence(first: str, second: str, *, difference: Difference) -> str:
    """Say on how few units a difference rests; empty if unknown.

    >>> from evaluator.scoring.significance import Influence
    >>> difference = Difference(-0.4, -0.5, -0.2, 0.0003, influence=Influence(700, 39, 59))
    >>> print(influence("A", "B", difference=difference))
    If the 39 of 700 recordings that most favour A are left out, the difference is no longer significant. \
If 59 are left out, B is better.
    >>> influence("A", "B", difference=Difference(0.1, -0.2, 0.4, 0.4, influence=Influence(700, None, 2)))
    'If the 2 of 700 recordings that most favour B are left out, A is better.'
    """
    known = difference.influence
    if known is None or not difference.difference:
        return ""
    better, worse = (first, second) if difference.difference < 0 else (second, first)
    few, turn = known.n_to_undecided, known.n_to_turn
    if few is None and turn is None:
        return ""
    is_better = f"is {'significantly ' if known.is_turn_significant else ''}better"
    of_all = f"of {in_words(difference.unit, known.n_units)} that most favour {better} are left out"
    if few is None:
        return f"If the {turn:,} {of_all}, {worse} {is_better}."
    head = f"If the {few:,} {of_all}, the difference is no longer significant."
    return head if turn is None else f"{head} If {turn:,} are left out, {worse} {is_better}."


def selection(n_tried: Mapping[str, int]) -> str:
    """Describe selection among submissions, by methods' numbers of scored submissions; empty without any.

    >>> print(selection({"A": 3, "B": 1, "C": 10}))
    A is the best of 3 scored submissions, C of 10. Picking the best of several equally good submissions \
makes a method look better by chance: by up to about 0.60 standard errors of the difference if the best of 3 \
is picked, and 1.09 if the best of 10.
    """
    chosen = {name: n for name, n in n_tried.items() if n > 1}
    if not chosen:
        return ""
    (name, n), *rest = chosen.items()
    who = ", ".join(
        [f"{name} is the best of {n:,} scored submissions", *(f"{each} of {m:,}" for each, m in rest)]
    )
    first, *others = sorted(set(chosen.values()))
    amounts = [f"{best_of(first):.2f} standard errors of the difference if the best of {first:,} is picked"]
    amounts += [f"{best_of(each):.2f} if the best of {each:,}" for each in others]
    listed = ", and ".join([", ".join(amounts[:-1]), amounts[-1]] if others else amounts)
    return (
        f"{who}. Picking the best of several equally good submissions makes a method look better by chance: "
        f"by up to about {listed}."
    )


def without_interval(
    scores: Mapping[str, float | None],
    *,
    counts: Mapping[str, int],
    decimals: int,
    n_effective: Mapping[str, float],
    unit: str,
) -> list[str]:
    """Say why these scores of a row have no interval, though others have; what 0 errors say.

    `counts` are numbers of sequences by TTC range, `n_effective` are effective numbers of units by score.

    >>> counts = {"overall": 28_600, "large": 12_270}
    >>> scores = {"mid_large": 0.1, "rte_large": 0.2, "warning_large": 0.0}
    >>> for line in without_interval(scores, counts=counts, decimals=2, n_effective={}, unit="day"):
    ...     print(line)
    MiD large, RTE large: fewer than 6 days have an error
    WE large: an error in 0 of 12,270 sequences (below 0.03% at 95%, if sequences were independent)
    """
    labels: dict[str, list[str]] = {}
    for name, value in scores.items():
        if value is None:
            continue
        metric, ttc_range = metric_of(name), split_name(name)[1]
        reason = why_no_interval(
            name,
            value,
            n_sequences=counts.get(ttc_range),
            decimals=decimals,
            n_effective=n_effective.get(name, MIN_DEGREES),
            unit=unit,
        )
        labels.setdefault(reason, []).append(f"{metric.symbol} {ttc_range}")
    return [f"{', '.join(names)}: {reason}" for reason, names in labels.items()]


def why_no_interval(
    name: str, value: float, *, n_sequences: int | None, decimals: int, n_effective: float, unit: str
) -> str:
    """Say why this score has no interval, though others have.

    >>> why_no_interval("mid_large", 0.1, n_sequences=12_270, decimals=2, n_effective=700.0, unit="day")
    'fewer than 6 days have an error'
    """
    if n_effective < MIN_DEGREES:
        return too_few_units(n_effective, unit=unit)
    if value or not n_sequences:
        return f"fewer than {MIN_DIFFERENT} {in_words(unit)} have an error"
    if metric_of(name) == WARNING:
        return _no_warning_error(n_sequences, decimals)
    return "no sequence has an error"


def _no_warning_error(n_sequences: int, decimals: int) -> str:
    # A share that is published as 0.00 may be a few errors of very many sequences.
    most = max(0, math.ceil(0.5 * 10.0**-decimals * n_sequences / 100) - 1)
    limit = _rounded_up(100 * _poisson_bound(most) / n_sequences)
    return (
        f"an error in {'at most ' if most else ''}{most:,} of {n_sequences:,} sequences "
        f"(below {limit}% at 95%, if sequences were independent)"
    )


def _poisson_bound(n: int) -> float:
    """Compute the 95% upper limit of a mean after `n` events: 3.0 after none.

    >>> [round(_poisson_bound(n), 2) for n in (0, 1, 2)]
    [3.0, 4.74, 6.3]
    """
    low, high = 0.0, n + 10 * math.sqrt(n + 1)
    for _ in range(60):
        mean = (low + high) / 2
        below = math.exp(-mean) * math.fsum(math.pow(mean, k) / math.factorial(k) for k in range(n + 1))
        low, high = (mean, high) if below > SIGNIFICANT else (low, mean)
    return high


def _rounded_up(value: float) -> str:
    """Round up to one significant digit.

    >>> _rounded_up(0.0244), _rounded_up(0.3), _rounded_up(1.2)
    ('0.03', '0.3', '2')
    """
    digits = -math.floor(math.log10(value))
    steps = math.ceil(round(value * 10.0**digits, 9))
    return f"{steps * 10.0**-digits:.{max(digits, 0)}f}"


def resolutions(pairs: Sequence[Mapping[str, Difference]]) -> dict[str, float]:
    """Return each column's resolution: the median of those of neighbours on a board.

    >>> some = [{"mid": Difference(-1, -2, 0, 0.1), "rte": Difference(-1, -1.5, -0.5, 0.01)}]
    >>> {name: round(value, 2) for name, value in resolutions(some).items()}
    {'mid': 1.43, 'rte': 0.71}
    """
    names = dict.fromkeys(name for pair in pairs for name in pair)
    known = {name: [r for pair in pairs if name in pair and (r := pair[name].resolution)] for name in names}
    return {name: median(values) for name, values in known.items() if values}


def others(differences: Mapping[str, Difference], *, primary: str) -> str:
    """Count the columns besides `primary` that differ significantly, and name up to three of them.

    Empty if no column has a p.

    >>> alike, far = Difference(0.1, -0.2, 0.4, 0.5), Difference(-4.1, -5.3, -2.9, 0.0003)
    >>> others({"mid": far, "mid_small": alike, "rte": alike}, primary="mid")
    'None of the 2 other metrics differs significantly (p < 0.05, uncorrected).'
    >>> others({"mid": alike, "mid_small": far, "rte": alike}, primary="mid")
    '1 of the 2 other metrics differs significantly (p < 0.05, uncorrected): MiD small.'
    """
    tested = [name for name, gap in differences.items() if name != primary and gap.p_below is not None]
    if not tested:
        return ""
    different = [
        f"{metric_of(name).symbol} {split_name(name)[1]}"
        for name in tested
        if differences[name].is_significant
    ]
    differ = "differs" if len(different) <= 1 else "differ"
    named = f": {', '.join(different)}" if 0 < len(different) <= _MAX_NAMED else ""
    ending = f"significantly (p < {SIGNIFICANT:g}, uncorrected){named}."
    if len(tested) == 1:
        return f"The other metric {'differs' if different else 'does not differ'} {ending}"
    return f"{len(different) or 'None'} of the {len(tested)} other metrics {differ} {ending}"
