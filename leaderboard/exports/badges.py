"""A badge for a README with a method's rank and score."""

from typing import Final
from xml.sax.saxutils import escape, quoteattr

from evaluator.metrics.protocol import metric_of
from evaluator.scoring.results import format_rounded
from evaluator.tables.escaping import one_line
from leaderboard.boards.rows import Entry

_HEIGHT_PX: Final = 20
_MARGIN_PX: Final = 6
# As wide as the letters of common fonts at 11 px; the drawing's own `textLength` makes the rest fit.
_WIDE_PX, _USUAL_PX, _NARROW_PX = 9.5, 6.6, 3.8
_NARROW: Final = frozenset(" .,:;|!'()[]ijlftrI·1")
_WIDE: Final = frozenset("MWmw@%")
_FONT: Final = "Verdana,DejaVu Sans,Geneva,sans-serif"


def words(entry: Entry | None) -> str:
    if entry is None:
        return "no entry"
    if entry.withdrawn_at is not None:
        return "withdrawn"
    metric = metric_of(entry.primary)
    if entry.value is None:
        return f"no {metric.symbol}"
    rank = f"rank {entry.rank}, " if entry.rank is not None else ""
    value = format_rounded(entry.value, decimals=entry.decimals)
    return f"{rank}{metric.symbol} {value}{metric.unit_of_value}"


def svg(*, label: str, text: str) -> str:
    """A badge with two fields, readable without colours and by screen readers."""
    label, text = one_line(label), one_line(text)
    left, right = _width_px(label), _width_px(text)
    whole = left + right
    spoken = f"{label}: {text}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{whole:g}" height="{_HEIGHT_PX}" '
        f'viewBox="0 0 {whole:g} {_HEIGHT_PX}" role="img" aria-label={quoteattr(spoken)}>'
        f"<title>{escape(spoken)}</title>"
        f'<rect width="{left:g}" height="{_HEIGHT_PX}" fill="#333b42"/>'
        f'<rect x="{left:g}" width="{right:g}" height="{_HEIGHT_PX}" fill="#0b5cad"/>'
        f'<g fill="#fff" font-family="{_FONT}" font-size="11">'
        f"{_field(label, 0, left)}{_field(text, left, right)}</g></svg>"
    )


def _field(text: str, x_px: float, width_px: float) -> str:
    length = width_px - 2 * _MARGIN_PX
    return f'<text x="{x_px + _MARGIN_PX:g}" y="14" textLength="{length:g}">{escape(text)}</text>'


def _width_px(text: str) -> float:
    widths = (_NARROW_PX if c in _NARROW else _WIDE_PX if c in _WIDE else _USUAL_PX for c in text)
    return round(sum(widths) + 2 * _MARGIN_PX)
