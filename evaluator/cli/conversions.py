"""The subcommand convert: the same predictions in another unit, or at another rate."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from evaluator.cli.options import predictions_argument
from evaluator.cli.reading import bytes_of, naming, write_bytes

GAP = click.IntRange(1, 5)
RATE = click.FloatRange(min=0, min_open=True)


@click.command(short_help="Turn scale ratios at any frame gap into seconds, and back.")
@predictions_argument
@click.option(
    "--frame-gap", type=GAP, metavar="G", help="PREDICTIONS has scale ratios of frames this far apart."
)
@click.option("--fps", "fps_hz", type=RATE, metavar="HZ", help="The same as a rate: 10 Hz / frame gap.")
@click.option(
    "--to",
    type=click.Choice(["ttc", "scale_ratio"]),
    default="ttc",
    show_default=True,
    help="What to write: seconds, or scale ratios.",
)
@click.option(
    "--to-frame-gap", type=GAP, metavar="G", help="With --to scale_ratio: of frames this far apart (5)."
)
@click.option("--to-fps", "to_fps_hz", type=RATE, metavar="HZ", help="The same as a rate.")
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the file here instead of to standard output.",
)
def convert(
    *,
    predictions: Path,
    frame_gap: int | None,
    fps_hz: float | None,
    to: Literal["ttc", "scale_ratio"],
    to_frame_gap: int | None,
    to_fps_hz: float | None,
    output: Path | None,
) -> None:
    """Write PREDICTIONS, a JSON file or - for standard input, in another unit or at another rate.

    An envelope says itself what its numbers are. A flat file, from key to number, has scale ratios if
    --frame-gap or --fps is given, and seconds otherwise.

    \b
    Examples:
      tsttc convert ratios.json --frame-gap 1 -o predictions.json
      tsttc convert predictions.json --to scale_ratio --to-frame-gap 3 -o ratios.json
    """
    from evaluator.conversion import convert as converted  # noqa: PLC0415 -- loads numpy

    if frame_gap is not None and fps_hz is not None:
        raise click.UsageError("--frame-gap and --fps say the same thing; give one of them.")
    if to_frame_gap is not None and to_fps_hz is not None:
        raise click.UsageError("--to-frame-gap and --to-fps say the same thing; give one of them.")
    if to == "ttc" and (to_frame_gap is not None or to_fps_hz is not None):
        raise click.UsageError(
            "Seconds have no rate: --to-frame-gap and --to-fps belong to --to scale_ratio."
        )
    data = bytes_of(predictions)
    with naming(predictions):
        try:
            found = converted(
                data,
                to=to,
                fps_hz=fps_hz,
                frame_gap=frame_gap,
                to_fps_hz=to_fps_hz,
                to_frame_gap=to_frame_gap,
            )
        except ValueError as fault:
            raise click.UsageError(str(fault)) from None
    if output is None:
        click.echo(found)
        return
    write_bytes(output, found)
    click.echo(f"{output}: {'seconds' if to == 'ttc' else 'scale ratios'}.")
