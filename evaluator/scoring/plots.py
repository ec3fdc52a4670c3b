"""Figures for a paper: error by true time, predicted against true, distribution. Needs `[plots]`."""

# Matplotlib draws on a canvas of its own: no window opens, and other figures of the program stay.

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from evaluator.metrics.protocol import metric_of
from evaluator.metrics.registry import Metric
from evaluator.scoring.breakdown import curve_of, scores_of
from evaluator.scoring.results import Details

SUFFIXES: Final = (".svg", ".pdf", ".png")
# Told apart without colour vision (Okabe and Ito), and by their dashes in print.
COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#000000")
DASHES: Final = ("-", "--", "-.", ":")
MAX_POINTS: Final = 5_000
# Texts stay texts in SVG, and fonts are embedded as TrueType in PDF, which publishers ask for.
SETTINGS: Final[dict[str, Any]] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "tsttc",
    "pdf.fonttype": 42,
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
}


def draw(kind: str, scored: Mapping[str, Details], *, path: str | Path | None = None) -> Figure:
    """Draw `kind`, one of `KINDS`, of details by legend name; raises `ValueError` for others."""
    if kind not in KINDS:
        raise ValueError(f"Unknown kind {kind!r}; expected one of {', '.join(KINDS)}.")
    if path is not None and Path(path).suffix.lower() not in SUFFIXES:
        raise ValueError(
            f"The figure's name is {Path(path).name!r}; expected one that ends in {', '.join(SUFFIXES)}."
        )
    with rc_context(SETTINGS):
        figure = Figure(figsize=(6.4, 3.6), layout="constrained")
        KINDS[kind](figure, scored)
        if path is not None:
            # Without the date the same figure is the same file.
            dated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
            figure.savefig(path, metadata=dated.get(Path(path).suffix.lower()), dpi=200)
    return figure


def _error(figure: Figure, scored: Mapping[str, Details]) -> None:
    metrics = [metric_of(name) for name in next(iter(scored.values())).errors]
    axes = figure.subplots(1, len(metrics), squeeze=False)[0]
    for number, (name, details) in enumerate(scored.items()):
        curve = curve_of(details)
        groups = {f"{low}": rows for (low, _), rows in curve.items()}
        bins = scores_of(details, groups=groups, has_ranges=False, with_intervals=True)
        middles = np.array([(low + high) / 2 for low, high in curve])
        for axis, metric in zip(axes, metrics, strict=True):
            style = {"color": COLOURS[number % len(COLOURS)], "linestyle": DASHES[number % len(DASHES)]}
            means = np.array([row.scores[metric.name] for row in bins], dtype=float)
            ends = np.array([row.intervals[metric.name] or (np.nan, np.nan) for row in bins])
            # No line leads over 0, where nothing is approached or left.
            for side in (middles < 0, middles > 0):
                label = name if side[-1] else None
                axis.plot(middles[side], means[side], marker="o", markersize=2.5, label=label, **style)
                axis.fill_between(middles[side], *ends[side].T, color=style["color"], alpha=0.2, linewidth=0)
    for axis, metric in zip(axes, metrics, strict=True):
        axis.set(xlabel="true TTC (s)", ylabel=f"{_heading(metric)}, mean", yscale="log")
    _legend(figure, axes[0], scored)


def _scatter(figure: Figure, scored: Mapping[str, Details]) -> None:
    panels = figure.subplots(1, len(scored), squeeze=False, sharex=True, sharey=True)[0]
    for number, (axis, (name, details)) in enumerate(zip(panels, scored.items(), strict=True)):
        drawn = np.random.default_rng(0).permutation(details.truth.n_sequences)[:MAX_POINTS]
        axis.plot(
            details.truth.ttc_s[drawn],
            details.predicted_ttc_s[drawn],
            ".",
            markersize=2,
            alpha=0.5,
            color=COLOURS[number % len(COLOURS)],
            rasterized=len(drawn) > 1_000,
        )
        limit = details.protocol.limit_s
        axis.plot([-limit, limit], [-limit, limit], color="0.4", linewidth=0.8)
        axis.set(
            xlabel="true TTC (s)", title=name, aspect="equal", xlim=(-limit, limit), ylim=(-limit, limit)
        )
    panels[0].set_ylabel("predicted TTC (s)")


def _distribution(figure: Figure, scored: Mapping[str, Details]) -> None:
    metrics = [metric_of(name) for name in next(iter(scored.values())).errors]
    axes = figure.subplots(1, len(metrics), squeeze=False, sharey=True)[0]
    for number, (name, details) in enumerate(scored.items()):
        for axis, metric in zip(axes, metrics, strict=True):
            values = np.sort(details.errors[metric.name])
            shares = 100 * np.arange(1, len(values) + 1) / len(values)
            style = {"color": COLOURS[number % len(COLOURS)], "linestyle": DASHES[number % len(DASHES)]}
            axis.step(values, shares, where="post", label=name, **style)
            axis.set(
                xlabel=f"{_heading(metric)} of a sequence", xscale="log", xlim=(0.1, None), ylim=(0, 100)
            )
    axes[0].set_ylabel("sequences (%)")
    _legend(figure, axes[0], scored)


def _heading(metric: Metric) -> str:
    unit = {"×10⁻⁴": r"($\times 10^{-4}$)", "%": "(%)"}.get(metric.unit, metric.unit)
    return f"{metric.symbol} {unit}".rstrip()


def _legend(figure: Figure, axis: Any, scored: Mapping[str, Details]) -> None:
    if len(scored) > 1:
        handles, names = axis.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=len(names), frameon=False)


KINDS: Final[dict[str, Callable[[Figure, Mapping[str, Details]], None]]] = {
    "error": _error,
    "scatter": _scatter,
    "distribution": _distribution,
}
