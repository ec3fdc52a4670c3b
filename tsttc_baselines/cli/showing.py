"""`tsttc baseline show`: what Pixel MSE saw of one sequence, as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure
from evaluator.cli.reading import FOLDER, naming, write_bytes
from tsttc_baselines.cli import require_opencv
from tsttc_baselines.cli.options import TRUTH, gap_option, out_option, truth_option

if TYPE_CHECKING:
    from tsttc_baselines.drawing import Figure
    from tsttc_baselines.folders import SequenceFolder

SUFFIXES: Final = (".svg", ".png")


@click.command(short_help="Draw what Pixel MSE saw of a sequence, and its choice.")
@click.argument("folder", type=FOLDER)
@click.argument("anno_id", type=click.IntRange(min=0))
@out_option("Write the figure to this file, .svg or .png.", name="--output", metavar="FIGURE")
@gap_option
@truth_option("Ground truth whose value is shown. [default: truth.csv in FOLDER, if it is there]")
@click.option("--dark", is_flag=True, help="Light lines on a dark ground.")
def show(
    *, folder: Path, anno_id: int, output: Path, frame_gap: int, truth_path: Path | None, dark: bool
) -> None:
    """Draw reference and target of a sequence with their boxes, the difference over all scale ratios, and α.

    \b
    Examples:
      tsttc baseline show val/ 17 -o 17.svg
      tsttc baseline show frames/ 3 -o 3.png --gap 2 --dark
    """
    if output.suffix.lower() not in SUFFIXES:
        message = f"{output} ends in {output.suffix or 'nothing'}; expected {' or '.join(SUFFIXES)}."
        raise click.BadParameter(message, param_hint="-o")
    require_opencv()
    from tsttc_baselines.folders import read_folder  # noqa: PLC0415 -- OpenCV, which --help can do without

    with naming(folder):
        sequences = read_folder(folder)
    true_ttc_s = _true_ttc_s(truth_path or folder / TRUTH, anno_id)
    with naming(folder):
        figure = _drawn(sequences, anno_id, frame_gap=frame_gap, true_ttc_s=true_ttc_s, dark=dark)
    is_svg = output.suffix.lower() == ".svg"
    write_bytes(output, figure.svg().encode() if is_svg else figure.png())
    click.echo(f"{output}: {figure.title}.")


def _true_ttc_s(path: Path, anno_id: int) -> float | None:
    from evaluator import read_truth  # noqa: PLC0415 -- numpy, which --help can do without

    if not path.exists():
        return None
    with naming(path):
        truth = read_truth(path)
    row = truth.manifest.row_of_id.get(str(anno_id))
    return None if row is None else float(truth.ttc_s[row])


def _drawn(
    sequences: SequenceFolder, anno_id: int, *, frame_gap: int, true_ttc_s: float | None, dark: bool
) -> Figure:
    from evaluator.problems import Rejected  # noqa: PLC0415 -- as above
    from tsttc_baselines.estimates import SequenceFault, Unusable  # noqa: PLC0415 -- OpenCV, as above
    from tsttc_baselines.figures import search_figure  # noqa: PLC0415 -- as above
    from tsttc_baselines.images import ImageCache  # noqa: PLC0415 -- as above
    from tsttc_baselines.pixel_mse import PixelMse  # noqa: PLC0415 -- as above

    row = sequences.manifest.row_of_id.get(str(anno_id))
    if row is None:
        ids = sequences.manifest.anno_id
        message = (
            f"{sequences.path} has no sequence {anno_id}; expected one of its {len(ids):,} anno_ids, "
            f"from {ids.min()} to {ids.max()}."
        )
        raise click.BadParameter(message, param_hint="ANNO_ID")
    try:
        clip = sequences.clip(row, cache=ImageCache())
        return search_figure(
            clip,
            estimator=PixelMse(),
            frame_gap=frame_gap,
            true_ttc_s=true_ttc_s,
            theme="dark" if dark else "light",
        )
    except SequenceFault as fault:
        raise Rejected([fault.problem]) from None
    except Unusable as fault:
        message = f"Pixel MSE has no estimate for sequence {anno_id}: {fault}."
        raise Failure(message, exit_code=Exit.REJECTED, code="no-estimate") from None
