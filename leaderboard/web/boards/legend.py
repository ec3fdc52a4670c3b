"""How to read a board's table, in sentences."""

from collections.abc import Sequence
from typing import NamedTuple

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

from evaluator.metrics.protocol import TTCRange
from leaderboard.boards.listing import Board
from leaderboard.web.boards.rank_ladder import Ladder
from leaderboard.web.boards.tables import BoardTable
from leaderboard.web.formatting import day, grouped


class Legend(NamedTuple):
    """The sentences of a legend; empty where the table has nothing of the kind."""

    marks: SafeString  # in one line
    drawings: str
    rank_ranges: str
    ttc_ranges: SafeString


def legend(board: Board, table: BoardTable, *, ladder: Ladder | None) -> Legend:
    return Legend(
        marks=_marks(board, table, ladder=ladder),
        drawings=_drawings(board, table),
        rank_ranges=_rank_ranges(table),
        ttc_ranges=_ttc_ranges(table.ttc_ranges),
    )


def _marks(board: Board, table: BoardTable, *, ladder: Ladder | None) -> SafeString:
    all_rows = f" of all {grouped(board.n_in_all)}" if table.query.filters.is_set else ""
    parts: list[str] = [
        format_html("Lower is better. <strong>Bold</strong>: best{}", all_rows),
        format_html(", <u>{}</u>: second best", "underlined"),
    ]
    if table.has_rank_ranges:
        parts.append(
            format_html(
                ', <span class="with-best-sample">{}</span>: may be the best (95% confidence)', "grey"
            )
        )
        if ladder and not ladder.is_certain:
            # A word joiner: the line does not break after the dash.
            parts.append(", (a–\N{WORD JOINER}b): 95% rank range")
    elif table.has_intervals:
        parts.append(format_html('<span class="interval">{}</span>', ", band: interval of the best"))
    if table.moved_since:
        parts.append(format_html(", ▲▼: moved since {}", day(table.moved_since)))
    return format_html("{}.", format_html_join("", "{}", ((part,) for part in parts)))


def _drawings(board: Board, table: BoardTable) -> str:
    scale = ", on a logarithmic scale" if table.is_log else ""
    if table.has_intervals and board.edition:
        sentences = [
            f"The tick is the value, the bar its 95% confidence interval "
            f"(bootstrap over {board.edition.units}){scale}.",
            "The vertical grey band is the interval of the best method.",
            "An arrow: the value is off the scale.",
        ]
        if table.sources:
            sentences.append(
                "Rings are values quoted from papers. They have no confidence interval, "
                "because papers report no values per recording."
            )
        return " ".join(sentences)
    if table.sources:
        return (
            f"A ring is the value quoted from a paper{scale}. Papers report no values per recording, "
            "so we cannot tell whether a small difference is significant."
        )
    return ""


def _rank_ranges(table: BoardTable) -> str:
    if not table.has_intervals or not table.has_rank_ranges:
        return ""
    if table.sources:
        without = (
            "A submission without a range can only have its rank (95% confidence); "
            "rows quoted from papers never have a range. For this, a value quoted from a paper counts as if "
            "it had a confidence interval as wide as that of the submission."
        )
        quoted = ", or a row quoted from a paper"
    else:
        without = "No range: only this rank is possible (95% confidence)."
        quoted = ""
    return (
        "(a–b) below a rank: the true rank is between a and b (95% confidence). "
        f"{without} With 95% confidence, the best of a column is one of its grey values{quoted}."
    )


def _ttc_ranges(ranges: Sequence[tuple[TTCRange, int | None]]) -> SafeString:
    is_counted = any(n is not None for _, n in ranges)
    texts = []
    for ttc_range, n in ranges:
        count = "" if n is None else f" ({grouped(n)})"
        texts.append((f"{ttc_range.seconds} {ttc_range.name}{count}",))
    return format_html(
        "TTC ranges by the true time to contact{}: {}.",
        " (number of sequences)" if is_counted else "",
        format_html_join(", ", "<span>{}</span>", texts),
    )
