"""The ground on which charts are drawn: sizes, scales, hairlines and their numbers."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from django.utils.html import format_html
from django.utils.safestring import SafeString

from leaderboard.web.drawing import tick_text


@dataclass(frozen=True)
class Frame:
    """The ground of a drawing: its size, and where values stand in it."""

    width: float
    height: float
    xs: tuple[float, float]
    ys: tuple[float, float]
    left: float = 42.0
    right: float = 14.0
    top: float = 10.0
    bottom: float = 30.0

    def x(self, value: float) -> str:
        """Pixels from the left."""
        return self._px(value, self.xs, self.left, self.width - self.right)

    def y(self, value: float) -> str:
        """Pixels from the top: large values stand high."""
        return self._px(value, self.ys, self.height - self.bottom, self.top)

    @staticmethod
    def _px(value: float, ends: tuple[float, float], start: float, end: float) -> str:
        return f"{start + (end - start) * (value - ends[0]) / (ends[1] - ends[0]):.1f}"

    def svg(self, title: str, parts: Iterable[SafeString]) -> SafeString:
        """The whole drawing; `title` is what it is called for those who cannot see it."""
        return format_html(
            '<svg viewBox="0 0 {} {}" role="img" aria-label="{}">{}</svg>',
            f"{self.width:g}",
            f"{self.height:g}",
            title,
            SafeString("".join(parts)),
        )

    def rows(self, ticks: Sequence[float], *, is_log: bool = False) -> list[SafeString]:
        """Hairlines across, with their numbers at the left; `is_log`: the ticks are their logarithms."""
        return [
            format_html(
                '<path class="grid" d="M{} {y}H{}"/>'
                '<text x="{}" y="{y}" dy=".35em" text-anchor="end">{}</text>',
                f"{self.left:g}",
                f"{self.width - self.right:g}",
                f"{self.left - 6:g}",
                tick_text(float(f"{10**tick:.3g}") if is_log else tick),
                y=self.y(tick),
            )
            for tick in ticks
        ]

    def column_label(self, value: float, text: str) -> SafeString:
        """A word or a number below the ground, with a small mark."""
        foot = self.height - self.bottom
        return format_html(
            '<path class="grid" d="M{x} {}v4"/><text x="{x}" y="{}" text-anchor="middle">{}</text>',
            f"{foot:g}",
            f"{foot + 18:g}",
            text,
            x=self.x(value),
        )


def decade_ticks(low: float, high: float) -> list[float]:
    """Logarithms of 1, 2, 5, 10, … around these, few enough to be read.

    >>> [round(10**x, 3) for x in decade_ticks(math.log10(3), math.log10(40))]
    [2.0, 5.0, 10.0, 20.0, 50.0]
    """
    steps: tuple[float, ...] = (1.0, 2.0, 5.0) if high - low < 2 else (1.0,)
    every = [
        math.log10(factor) + power
        for power in range(math.floor(low) - 1, math.ceil(high) + 2)
        for factor in steps
    ]
    first = max(i for i, x in enumerate(every) if x <= low + 1e-9)
    last = min(i for i, x in enumerate(every) if x >= high - 1e-9 and i > first)
    return every[first : last + 1]


def log_ground(
    *, xs: tuple[float, float], ys: Sequence[float], width: float = 400.0, height: float = 240.0
) -> tuple[Frame, list[SafeString]]:
    """A frame for logarithms of errors, and its hairlines: one method may err twenty times as much."""
    ticks = decade_ticks(min(ys), max(ys))
    frame = Frame(width, height, xs=xs, ys=(ticks[0], ticks[-1]))
    return frame, frame.rows(ticks, is_log=True)
