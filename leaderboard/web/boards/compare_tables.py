"""Comparisons as they are drawn: the verdict in words, the values, and each pair's differences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from django.utils.html import format_html
from django.utils.safestring import SafeString

from evaluator import Difference
from evaluator.protocol import SCORE_NAMES
from evaluator.report import format_published
from evaluator.sentences import p_cell
from evaluator.significance import too_few_recordings
from leaderboard.comparisons import Compared, Pair
from leaderboard.standings import Entry
from leaderboard.web import charts, drawing
from leaderboard.web.charts import Chart
from leaderboard.web.drawing import Scale
from leaderboard.web.tables import Group, Heading, figure_css, score_groups, score_heading

_DIFFERENCE_PX: Final = 150.0
_NUMBERS: Final = {3: "three", 4: "four", 5: "five"}


@dataclass(frozen=True)
class DifferenceRow:
    """One column of the board: both values, and first minus second."""

    heading: Heading
    first: str
    second: str
    difference: str
    interval: str  # both ends as wide as the widest, so that points stand in line
    p: str
    reason: str  # why there is neither interval nor p; empty where there are
    is_significant: bool
    drawn: SafeString


@dataclass(frozen=True)
class DifferenceGroup:
    """One of the two errors: its rows on one scale."""

    group: Group
    axis: SafeString
    rows: tuple[DifferenceRow, ...]


@dataclass(frozen=True)
class PairTable:
    """Two methods: what came out in words, and their differences; no groups while they are being computed.

    `others` are sentences of the columns beside overall MiD, `others_lead` says what they are.
    """

    pair: Pair
    sentence: str
    others_lead: str
    others: tuple[str, ...]
    groups: tuple[DifferenceGroup, ...]
    has_intervals: bool


@dataclass(frozen=True)
class Comparison:
    """Everything that the compare page places."""

    compared: Compared
    verdict: str
    pairs: tuple[PairTable, ...]
    profile: Chart


def comparison(compared: Compared) -> Comparison:
    """What was compared, ready to be placed."""
    return Comparison(
        compared=compared,
        verdict=verdict(compared),
        pairs=tuple(_pair_table(pair) for pair in compared.pairs),
        profile=charts.profile(compared.entries),
    )


def verdict(compared: Compared) -> str:
    """What came out, in words: a sentence for two; for more the best, and what it is better than.

    Empty while a worker still computes it.
    """
    if not compared.is_complete:
        return ""
    if len(compared.entries) == len(("first", "second")):
        return compared.pairs[0].sentence()
    best = min(compared.entries, key=lambda entry: entry.scores["mid"] or 0.0)
    worse, alike = _told_apart(best, compared.pairs)
    head = (
        f"Of these {_NUMBERS[len(compared.entries)]}, {best.method} has the lowest MiD, "
        f"{format_published(best.scores['mid'], decimals=best.decimals)}."
    )
    if compared.reason:
        return f"{head} There are too few recordings to say what the differences mean."
    relations = (("significantly better than", worse), ("not significantly better than", alike))
    parts = [f"{relation} {_listed(names)}" for relation, names in relations if names]
    said = [head, f"On these recordings it is {', and '.join(parts)}."] if parts else [head]
    return " ".join([*said, *dict.fromkeys(pair.withheld for pair in compared.pairs if pair.withheld)])


def _told_apart(best: Entry, pairs: Sequence[Pair]) -> tuple[list[str], list[str]]:
    """The methods that the best is significantly better than in MiD, and the others."""
    worse: list[str] = []
    alike: list[str] = []
    for pair in pairs:
        if best in (pair.first, pair.second) and pair.differences and not pair.withheld:
            other = pair.second if pair.first == best else pair.first
            found = pair.differences.get("mid")
            (worse if found and found.is_significant else alike).append(other.method)
    return worse, alike


def _listed(names: Sequence[str]) -> str:
    """Names in a sentence.

    >>> _listed(["A"]), _listed(["A", "B", "C"])
    ('A', 'A, B and C')
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _pair_table(pair: Pair) -> PairTable:
    differences = pair.differences or {}
    others_lead, others = pair.others()
    return PairTable(
        pair=pair,
        sentence=pair.sentence(),
        others_lead=others_lead,
        others=others,
        groups=tuple(
            _difference_group(group, names, pair, differences)
            for group, names in zip(score_groups(), (SCORE_NAMES[:5], SCORE_NAMES[5:]), strict=True)
        )
        if differences
        else (),
        has_intervals=any(found.low is not None for found in differences.values()),
    )


def _difference_group(
    group: Group, names: Sequence[str], pair: Pair, differences: Mapping[str, Difference]
) -> DifferenceGroup:
    ends = [
        end
        for name in names
        if name in differences
        for end in (differences[name].low, differences[name].high, differences[name].difference)
        if end is not None
    ]
    scale = drawing.zero_scale(ends, width_px=_DIFFERENCE_PX)
    css = figure_css(signed(end, decimals=pair.first.decimals) for end in ends)
    rows = tuple(
        _difference_row(name, pair, differences[name], scale, css) for name in names if name in differences
    )
    return DifferenceGroup(group=group, axis=drawing.axis(scale), rows=rows)


def _difference_row(name: str, pair: Pair, found: Difference, scale: Scale, css: str) -> DifferenceRow:
    decimals = pair.first.decimals  # both are of one edition
    return DifferenceRow(
        heading=score_heading(name),
        first=format_published(pair.first.scores[name], decimals=pair.first.decimals),
        second=format_published(pair.second.scores[name], decimals=pair.second.decimals),
        difference=signed(found.difference, decimals=decimals),
        interval=""
        if found.low is None or found.high is None
        else format_html(
            '<span class="{css}">{}</span> to <span class="{css}">{}</span>',
            signed(found.low, decimals=decimals),
            signed(found.high, decimals=decimals),
            css=css,
        ),
        p=p_cell(found.p, found.p_below),
        reason="" if found.p_below is not None else too_few_recordings(found.n_effective),
        is_significant=found.is_significant,
        drawn=drawing.difference(scale, found.difference, found.low, found.high),
    )


def signed(value: float, *, decimals: int = 2) -> str:
    """A difference with its sign, and a minus that is one.

    >>> signed(-4.1), signed(0.204), signed(-0.001), signed(-4.1, decimals=1)
    ('−4.10', '+0.20', '0.00', '−4.1')
    """
    text = format_published(abs(value), decimals=decimals)
    if not float(text):
        return text
    return f"{'−' if value < 0 else '+'}{text}"
