"""Figures of docs/annotation.md: what a consensus does, and what the choice by radar does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from baselines.annotation.consensus import consensus_velocity, least_squares_velocity
from baselines.annotation.pipeline import frame_ttc
from baselines.annotation.tracks import Tracks
from baselines.drawing import THEMES, Dot, Figure, Line, Text, Theme
from evaluator.metrics.scale import FRAME_RATE_HZ, Floats
from evaluator.truth.annotations import FRAME_STEP_NS

_SIZE: Final = (720, 344)
_GROUND: Final = (48.0, 44.0, 500.0, 250.0)
"""Left, top, width and height of what lies between the axes."""

_LENGTH_M: Final = 4.0
_OFF: Final = (2, 7)


@dataclass(frozen=True)
class _Axes:
    """A ground with numbers at its edges; x and y are in the figure's units."""

    figure: Figure
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def at(self, x: float, y: float) -> tuple[float, float]:
        left, top, width, height = _GROUND
        across = (x - self.x_range[0]) / (self.x_range[1] - self.x_range[0])
        up = (y - self.y_range[0]) / (self.y_range[1] - self.y_range[0])
        return left + across * width, top + (1 - up) * height

    def frame(self, *, x_ticks: Sequence[float], y_ticks: Sequence[float], x_name: str, y_name: str) -> None:
        """Hairlines, numbers and names."""
        left, top, width, height = _GROUND
        theme = self.figure.theme
        for tick in y_ticks:
            _, y = self.at(self.x_range[0], tick)
            self.figure.shapes += [
                Line([(left, y), (left + width, y)], theme.hair),
                Text(_number(tick), left - 8, y + 4, theme.quiet, size=12, anchor="end"),
            ]
        for tick in x_ticks:
            x, _ = self.at(tick, self.y_range[0])
            text = Text(_number(tick), x, top + height + 18, theme.quiet, size=12, anchor="middle")
            self.figure.shapes.append(text)
        self.figure.shapes += [
            Text(y_name, 8, top - 18, theme.quiet, size=12),
            Text(x_name, left + width, top + height + 36, theme.quiet, size=12, anchor="end"),
        ]

    def line(self, x: Floats, y: Floats, colour: str, width: float = 2.0) -> None:
        points = [self.at(*point) for point in zip(x.tolist(), y.tolist(), strict=True)]
        self.figure.shapes.append(Line(points, colour, width))

    def dots(self, x: Floats, y: Floats, colour: str, radius: float = 5.0) -> None:
        for point in zip(x.tolist(), y.tolist(), strict=True):
            self.figure.shapes.append(Dot(*self.at(*point), radius, colour))


def _number(value: float) -> str:
    return f"{value:g}".replace("-", "−")


def _legend(figure: Figure, lines: Sequence[tuple[str, str]], *, top: float = 60.0) -> None:
    """Texts with their colours, to the right of the ground."""
    left = _GROUND[0] + _GROUND[2] + 16
    figure.shapes += [
        Text(text, left, top + 19 * number, colour, size=12) for number, (text, colour) in enumerate(lines)
    ]


def consensus_figure(*, theme: str = "light") -> Figure:
    """Ten frames of which two are off: the line of the other eight, and the least squares over all ten."""
    rng = np.random.default_rng(4)
    time_s = np.arange(-9, 1) / 10
    depth_m = 20 - 5 * time_s + rng.normal(0, 0.05, 10)
    depth_m[list(_OFF)] += np.array([-1.7, 1.9])
    window, there = (time_s[:, np.newaxis], depth_m[:, np.newaxis]), np.ones((10, 1), dtype=np.bool_)
    agreed, all_of = consensus_velocity(*window, there), least_squares_velocity(*window, there)
    colours: Theme = THEMES[theme]
    title = "The depth of ten frames, two of which are off, with the line of the other eight"
    figure = Figure(*_SIZE, colours, title)
    axes = _Axes(figure, (-0.95, 0.05), (18.5, 25.5))
    axes.frame(
        x_ticks=(-0.9, -0.6, -0.3, 0.0),
        y_ticks=(19, 21, 23, 25),
        x_name="s before the target frame",
        y_name="depth of the nearest corner in m",
    )
    ends = np.array([-0.93, 0.03])
    is_off = np.isin(np.arange(10), _OFF)
    for found, used, colour in ((all_of, is_off | ~is_off, colours.mark), (agreed, ~is_off, colours.accent)):
        mps = float(found.mps[0])
        start = float((depth_m - mps * time_s)[used].mean())
        axes.line(ends, start + mps * ends, colour)
    axes.dots(time_s[~is_off], depth_m[~is_off], colours.accent)
    axes.dots(time_s[is_off], depth_m[is_off], colours.mark)
    _legend(
        figure,
        [
            ("consensus of 8 frames:", colours.accent),
            (_velocity(agreed.mps[0], depth_m[-1]), colours.accent),
            ("", colours.ink),
            ("least squares over 10:", colours.mark),
            (_velocity(all_of.mps[0], depth_m[-1]), colours.mark),
            ("", colours.ink),
            ("true: −5 m/s, 4 s", colours.quiet),
        ],
    )
    return figure


def _velocity(mps: float, depth_m: float) -> str:
    return f"{mps:.1f} m/s, τ = {-depth_m / mps:.1f} s".replace("-", "−")


def choice_figure(*, theme: str = "light") -> Figure:
    """The velocity to a vehicle that begins to brake: of ten frames, and the one that is chosen."""
    rng = np.random.default_rng(11)
    time_s = np.arange(30) / FRAME_RATE_HZ
    true_mps = -2 - 3 * np.clip(time_s - 1, 0, None)
    true_m = 40 + np.concatenate([[0.0], np.cumsum((true_mps[1:] + true_mps[:-1]) / 2)]) / FRAME_RATE_HZ
    depth_m = true_m + rng.normal(0, 0.03, 30)
    radar_mps = true_mps + rng.normal(0, 0.05, 30)
    shown = [frame_ttc(_track(depth_m, radar)) for radar in (np.full(30, np.nan), radar_mps)]
    longest, chosen = (-depth_m / found.ttc_s for found in shown)
    colours = THEMES[theme]
    title = "The velocity to a vehicle that begins to brake: ten frames are late, the choice by radar is not"
    figure = Figure(*_SIZE, colours, title)
    axes = _Axes(figure, (0.25, 2.95), (-8.4, -1.2))
    axes.frame(
        x_ticks=(0.5, 1, 1.5, 2, 2.5), y_ticks=(-8, -6, -4, -2), x_name="time in s", y_name="velocity in m/s"
    )
    late = time_s >= 0.3
    axes.line(time_s[late], true_mps[late], colours.quiet)
    axes.line(time_s[late], longest[late], colours.mark)
    axes.line(time_s[late], chosen[late], colours.accent)
    by_radar = late & (shown[1].choice == "radar")
    axes.dots(time_s[by_radar], chosen[by_radar], colours.accent, 4.0)
    lines = [
        ("true", colours.quiet),
        ("10 frames", colours.mark),
        ("chosen; a dot where", colours.accent),
        ("the radar decided", colours.accent),
    ]
    _legend(figure, lines)
    return figure


def _track(depth_m: Floats, radar_mps: Floats) -> Tracks:
    """A vehicle straight ahead with these depths of its nearest corner, at 10 Hz."""
    n = len(depth_m)
    return Tracks(
        key=(("r", "1", "1"),) * n,
        ts_ns=np.arange(n) * FRAME_STEP_NS,
        centre_m=np.column_stack([np.full(n, 2.0), depth_m + _LENGTH_M / 2, np.zeros(n)]),
        size_m=np.tile([_LENGTH_M, 1.8, 1.5], (n, 1)),
        yaw_rad=np.full(n, np.pi / 2),
        box_px=np.tile([0.0, 0.0, 40.0, 30.0], (n, 1)),
        is_truncated=np.zeros(n, dtype=np.bool_),
        radar_mps=radar_mps,
        has_radar=True,
    )
