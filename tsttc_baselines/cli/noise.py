"""`tsttc baseline noise`: how noisy labels are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evaluator.cli.failures import echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned
from evaluator.cli.options import default_option, json_option
from evaluator.cli.reading import TABLE, naming
from evaluator.metrics.protocol import known_ranges
from tsttc_baselines.cli.options import TRUTH

if TYPE_CHECKING:
    from evaluator.metrics.scale import Floats
    from tsttc_baselines.annotation.noise import LabelNoise


@click.command(short_help="Estimate how noisy labels are.")
@click.argument("source", metavar="FOLDER|TRUTH", type=TABLE)
@default_option(
    "--frames",
    "n_frames",
    type=click.IntRange(1, 100),
    default=10,
    help="Frames from which a label's velocity was made; 1: labels share nothing.",
)
@json_option
def noise(*, source: Path, n_frames: int, as_json: bool) -> None:
    """Estimate the noise of labels, as MiD, from how much they jump between successive frames.

    FOLDER has annotation files or a truth.csv; TRUTH is a ground-truth file with the labels of successive
    frames, as `tsttc baseline annotate --overlapping` writes it. A method that is always right has about
    this error.

    \b
    Examples:
      tsttc baseline noise tsttc/val/
      tsttc baseline noise truth.csv --frames 5
    """
    from tsttc_baselines.annotation.noise import label_noise  # noqa: PLC0415 -- numpy, which --help can do without

    noises = label_noise(*_pairs(source), n_frames=n_frames)
    if as_json:
        echo_json({"frames": n_frames, "ranges": [asdict(each) for each in noises]})
        return
    click.echo("\n".join(_in_words(noises, n_frames)))


def _pairs(source: Path) -> tuple[Floats, Floats]:
    from evaluator import read_truth  # noqa: PLC0415 -- as above
    from evaluator.truth.annotation_folders import read_annotations  # noqa: PLC0415 -- as above
    from tsttc_baselines.annotation.noise import successive, successive_in_sequences  # noqa: PLC0415 -- as above

    own = source / TRUTH
    with naming(own if own.is_file() else source):
        if source.is_dir() and not own.is_file():
            annotated = read_annotations(source, with_ttc=False, with_frames=True)
            return successive_in_sequences(annotated.frame_ttc_s)
        return successive(read_truth(own if source.is_dir() else source).to_table())


def _in_words(noises: Sequence[LabelNoise], n_frames: int) -> Iterator[str]:
    ranges = known_ranges()
    rows = [[Cell(text, is_bold=True) for text in ("TTC range", "pairs", "jitter", "noise")]]
    for each in noises:
        name = ranges[each.name].seconds if each.name in ranges else each.name
        values = [NO_VALUE if value is None else f"{value:.1f}" for value in (each.jitter, each.noise)]
        rows.append([Cell(name), Cell(f"{each.n_pairs:,}"), *map(Cell, values)])
    yield from aligned(rows, align="<>..")
    yield ""
    yield "MiD ×10⁻⁴. Jitter: between a label and the label 0.1 s before, less 0.1 s. Noise: the mean error"
    yield "of a label that explains the jitter. A method that is always right scores about as much."
    shared = "have nothing in common" if n_frames == 1 else f"share {n_frames - 1} of their {n_frames} frames"
    yield f"It assumes that successive labels {shared}, that frames err independently, and that"
    yield "nothing accelerates: acceleration looks like noise, and an error that lasts is not seen."
