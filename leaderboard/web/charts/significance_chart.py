"""The chart of significance: every pair of the first rows of a board, by the p-value of what ranks them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlencode

from django.urls import reverse

from evaluator.counting import counted
from evaluator.metrics.protocol import metric_of
from evaluator.tables.sentences import p_cell
from leaderboard.boards.rows import Entry
from leaderboard.models import Visibility
from leaderboard.statistics.comparisons import Pair
from leaderboard.web.charts.chart_options import TEXT, Chart, Frame, Mark, Option, call, empty, ranks_axis
from leaderboard.web.charts.chart_series import cells
from leaderboard.web.formatting import signed

_FEW, _FEW_ON_A_PHONE = 8, 6
_MAX_NAMED: Final = 3
SIGNIFICANT: Final = {0.001: "p < 0.001", 0.01: "p < 0.01", 0.05: "p < 0.05"}
UNDECIDED, COMPUTING = "not significant", "computing…"
ANONYMOUS, UNTESTED = "no test (anonymous)", "no test"
_WHY_ANONYMOUS: Final = (
    "Anonymous methods have a rank range but are not tested in pairs, because a test against one method "
    "could reveal the team."
)
_INKS: Final = dict(
    zip(
        (*SIGNIFICANT.values(), UNDECIDED, ANONYMOUS, UNTESTED, COMPUTING),
        ("--heat1", "--heat2", "--heat3", "--hair", "--tint", "--ground", "--doubt-tint"),
        strict=True,
    )
)


@dataclass(frozen=True)
class _Cell:
    column: int
    row: int
    pair: Pair
    split: str

    @property
    def verdict(self) -> str:
        """Return the class of its p-value, or why there is none."""
        difference = self.pair.difference
        if difference is None:
            return COMPUTING
        if difference.p_below is None:
            shown = (self.pair.first.visibility, self.pair.second.visibility)
            return ANONYMOUS if Visibility.ANONYMOUS in shown else UNTESTED
        return SIGNIFICANT.get(difference.p_below, UNDECIDED)

    def texts(self) -> tuple[str, str, str]:
        """Return difference, interval and p."""
        difference, decimals = self.pair.difference, self.pair.first.decimals
        if difference is None:
            return COMPUTING, "", ""
        text = signed(difference.difference, decimals=decimals)
        if difference.low is None or difference.high is None:
            return text, "", UNTESTED
        ends = (signed(end, decimals=decimals) for end in (difference.low, difference.high))
        return text, " to ".join(ends), p_cell(difference.p, difference.p_below)

    def mark(self) -> Mark:
        difference, interval, p = self.texts()
        first, second = self.pair.first, self.pair.second
        words = f"{metric_of(first.primary).symbol} {difference}" + (f" ({interval})" if interval else "")
        read = [f"{_named(first)} vs. {_named(second)}", words]
        read += [f"p {p}: {self.verdict}"] if interval else [self.pair.withheld or self.verdict]
        query = urlencode({"split": self.split, "m": [first.method_id, second.method_id]}, doseq=True)
        return Mark(self.column, self.row, tuple(read), f"{reverse('compare')}?{query}")


def significance(pairs: Sequence[Pair], *, split: str) -> Chart:
    """Draw whether each row is significantly better than each below it."""
    if not pairs:
        return empty("significance")
    entries, symbol = _entries(pairs), metric_of(pairs[0].first.primary).symbol
    index = {entry.method_id: i for i, entry in enumerate(entries)}
    pair_cells = [
        _Cell(index[pair.second.method_id] - 1, index[pair.first.method_id], pair, split) for pair in pairs
    ]
    verdicts = [name for name in _INKS if any(cell.verdict == name for cell in pair_cells)]
    frame = Frame(
        x_axes=[ranks_axis([str(entry.rank) for entry in entries[1:]], name="Rank of the other method")],
        y_axes=[ranks_axis([_named(entry) for entry in entries[:-1]], is_upright=True)],
        series=[_series(name, [cell for cell in pair_cells if cell.verdict == name]) for name in verdicts],
        series_by_width=(
            [{"label": {"show": True}} for _ in verdicts],
            [{"label": {"show": len(entries) <= _FEW_ON_A_PHONE, "fontSize": 9}} for _ in verdicts],
        ),
        names=verdicts,
        # On a phone names have two lines: cut to their beginnings they would be alike.
        left=(220, 126),
        y_labels_by_width=(
            TEXT | {"overflow": "truncate"},
            {"overflow": "break", "fontSize": 10, "lineHeight": 11},
        ),
        top=30,
    )
    return Chart(
        kind="significance",
        label=f"Pairs of the first {len(entries)} methods by the p-value of their difference in {symbol}.",
        options=frame.options(),
        columns=("Method", "vs.", f"Difference in {symbol}", "95% confidence interval", "p"),
        rows=tuple((_named(cell.pair.first), _named(cell.pair.second), *cell.texts()) for cell in pair_cells),
        numbers=(2, 4),
        is_low=len(entries) <= _FEW,
        note=_WHY_ANONYMOUS if ANONYMOUS in verdicts else "",
    )


def alike_words(pairs: Sequence[Pair]) -> str:
    """Say which tested pairs do not differ significantly; empty without a tested pair.

    The tests are not corrected for their number, but rank ranges are.
    """
    tested = [pair for pair in pairs if pair.difference and pair.difference.p_below is not None]
    alike = [pair for pair in tested if not pair.difference.is_significant]  # type: ignore[union-attr]  # tested
    n_waiting = sum(pair.differences is None for pair in pairs)
    rest = f" Still computing: {counted(n_waiting, 'pair')}." if n_waiting else ""
    if not tested:
        return ""
    if len(alike) > _MAX_NAMED:
        n_tested = counted(len(tested), "tested pair")
        return f"{len(alike)} of {n_tested} do not differ significantly (p\u00a0≥\u00a00.05).{rest}"
    if any(_may_be_alike(pair) for pair in tested if pair not in alike):
        rest += " Rank ranges are corrected for the number of tests, so some of them still overlap."
    named = [
        " and ".join(f"{entry.method} (rank {entry.rank})" for entry in (pair.first, pair.second))
        for pair in alike
    ]
    but = f", except {'; '.join(named)}" if named else ""
    those = "pairs tested so far" if n_waiting else "tested pairs"
    return f"All {those} differ significantly (p\u00a0<\u00a00.05){but}.{rest}"


def _may_be_alike(pair: Pair) -> bool:
    better, worse = pair.first.interval, pair.second.interval
    return (better.rank_high or 0) >= (worse.rank_low or math.inf)


def _series(name: str, pair_cells: Sequence[_Cell]) -> Option:
    series = cells(name, [cell.mark() for cell in pair_cells], _INKS[name])
    for item, cell in zip(series["data"], pair_cells, strict=True):
        item["text"] = "" if cell.pair.difference is None else cell.texts()[0]
    if name in (ANONYMOUS, UNTESTED, COMPUTING):
        # Nearly the ground: the outline tells it apart, above the rims of the cells beside it.
        rim = "--doubt" if name == COMPUTING else "--quiet"
        series |= {"itemStyle": {"color": _INKS[name], "borderColor": rim, "borderWidth": 1}, "z": 3}
    ink = "--ground" if name == SIGNIFICANT[0.001] else "--ink"
    return series | {"label": {"show": True, "color": ink, "fontSize": 11, "formatter": call("text")}}


def _entries(pairs: Sequence[Pair]) -> list[Entry]:
    return [pairs[0].first, *(pair.second for pair in pairs if pair.first is pairs[0].first)]


def _named(entry: Entry) -> str:
    return f"{entry.rank}  {entry.method}"
