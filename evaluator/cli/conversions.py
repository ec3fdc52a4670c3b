"""The subcommand convert: the same predictions in another unit, at another rate, or under natural keys."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from evaluator.cli.options import default_option, output_option, predictions_argument
from evaluator.cli.reading import FOLDER, TABLE, naming, predictions_of, write_bytes

if TYPE_CHECKING:
    from evaluator import Manifest

GAP = click.IntRange(1, 5)


@click.command(short_help="Convert scale ratios to seconds and back, and anno_ids to natural keys.")
@predictions_argument
@click.option(
    "--frame-gap", type=GAP, metavar="G", help="PREDICTIONS contains scale ratios of frames with this gap."
)
@default_option(
    "--to", type=click.Choice(["ttc", "scale_ratio"]), default="ttc", help="Output: seconds or scale ratios."
)
@click.option("--to-frame-gap", type=GAP, metavar="G", help="With --to scale_ratio: the frame gap (5).")
@click.option(
    "--annotations",
    type=FOLDER,
    metavar="FOLDER",
    help="Write natural keys; the anno_ids are those of the toolkit for this folder on this machine.",
)
@click.option(
    "--manifest",
    "manifest_path",
    type=TABLE,
    metavar="FILE",
    help="Write natural keys; the anno_ids are those of this manifest, for which the file was made.",
)
@click.option(
    "--to-manifest",
    "to_manifest_path",
    type=TABLE,
    metavar="FILE",
    help="Leave out the sequences that this manifest lacks.",
)
@output_option("the file")
def convert(
    *,
    predictions: Path,
    frame_gap: int | None,
    to: Literal["ttc", "scale_ratio"],
    to_frame_gap: int | None,
    annotations: Path | None,
    manifest_path: Path | None,
    to_manifest_path: Path | None,
    output: Path | None,
) -> None:
    """Convert PREDICTIONS, a prediction file or - for standard input, to another unit, rate, or kind of keys.

    An envelope states the kind of its values. A flat file, from key to number, contains scale ratios if
    --frame-gap is given, and seconds otherwise.

    The toolkit numbers the sequences in the order in which the file system lists the annotation files, which
    differs between machines. --annotations gives a result file of the toolkit natural keys, which mean the
    same everywhere. Run the command on the machine and the folder on which the toolkit ran.

    A new edition can give an anno_id to another sequence. --manifest gives a file of an earlier edition
    natural keys. --to-manifest leaves out the sequences that the new edition lacks.

    \b
    Examples:
      tsttc convert results.json --annotations annotations/val/ -o predictions.json
      tsttc convert old.json --manifest old.csv --to-manifest new.csv -o predictions.json
      tsttc convert ratios.json --frame-gap 1 -o predictions.json
      tsttc convert predictions.json --to scale_ratio --to-frame-gap 3 -o ratios.json
    """
    from evaluator.predictions.conversion import convert as converted  # noqa: PLC0415 -- loads numpy

    if to == "ttc" and to_frame_gap is not None:
        raise click.UsageError("Seconds have no rate: --to-frame-gap belongs to --to scale_ratio.")
    if annotations is not None and manifest_path is not None:
        raise click.UsageError("Give either --annotations or --manifest: the source of the file's anno_ids.")
    natural_keys = None
    if annotations is not None:
        from evaluator.truth.numbering import read_numbering  # noqa: PLC0415 -- loads numpy

        with naming(annotations):
            natural_keys = read_numbering(annotations).natural_keys
    data = predictions_of(predictions)
    with naming(predictions):
        try:
            encoded = converted(
                data,
                to=to,
                frame_gap=frame_gap,
                to_frame_gap=to_frame_gap,
                natural_keys=natural_keys,
                manifest=_manifest(manifest_path),
                to_manifest=_manifest(to_manifest_path),
            )
        except ValueError as fault:
            raise click.UsageError(str(fault)) from None
    if output is None:
        click.echo(encoded)
        return
    write_bytes(output, encoded)
    unit = "seconds" if to == "ttc" else "scale ratios"
    is_natural = annotations is not None or manifest_path is not None
    keys = " by natural key" if is_natural else ""
    only = f", only for the sequences of {to_manifest_path}" if to_manifest_path else ""
    click.echo(f"{output}: {unit}{keys}{only}.")


def _manifest(path: Path | None) -> Manifest | None:
    from evaluator import read_manifest  # noqa: PLC0415 -- loads numpy

    if path is None:
        return None
    with naming(path):
        return read_manifest(path)
