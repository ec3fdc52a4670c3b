"""The subcommands that need files alone: check and manifest. They run the server's own code."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.connection import connect
from evaluator.cli.exits import Exit
from evaluator.cli.failures import echo_json
from evaluator.cli.options import json_option, output_option, predictions_argument, site_options, slug
from evaluator.cli.reading import (
    FOLDER,
    TABLE,
    name_of,
    naming,
    naming_predictions,
    predictions_of,
    write_bytes,
)
from evaluator.cli.warnings_in_words import (
    echo_warnings,
    numbering_in_words,
    numbering_warnings,
)
from evaluator.counting import counted

if TYPE_CHECKING:
    from evaluator import GroundTruth, Manifest
    from evaluator.truth.numbering import Numbering


@click.command(short_help="Check whether a prediction file is complete and well-formed.")
@predictions_argument
@click.option(
    "--manifest",
    "manifest_path",
    type=TABLE,
    metavar="FILE",
    help="The manifest of the split (list of sequences), or its ground truth.",
)
@click.option(
    "--annotations",
    type=FOLDER,
    metavar="FOLDER",
    help="The annotation folder of the toolkit: also check its numbering against the manifest.",
)
@click.option("--strict", is_flag=True, help="Exit with code 1 if there is a warning.")
@json_option
def check(
    *,
    predictions: Path,
    manifest_path: Path | None,
    annotations: Path | None,
    strict: bool,
    as_json: bool,
) -> None:
    """Check whether PREDICTIONS, a prediction file or - for standard input, is complete and well-formed.

    The command uses the rules of the server, also its limit of 20 MB, and sends nothing. A warning is not an
    error: the values probably belong to other sequences. Without --manifest, --annotations defines the
    sequences.

    \b
    Examples:
      tsttc check predictions.json --manifest manifest.csv
      tsttc check results.json --annotations annotations/val/
    """
    from evaluator import read_predictions  # noqa: PLC0415 -- numpy, which --help can do without
    from evaluator.predictions.documents import MAX_FILE_BYTES  # noqa: PLC0415 -- as above
    from evaluator.predictions.plausibility import warnings_of  # noqa: PLC0415 -- as above

    sequences, numbering = _sequences(manifest_path, annotations)
    with naming_predictions(predictions):
        parsed = read_predictions(predictions_of(predictions), manifest=sequences, max_bytes=MAX_FILE_BYTES)
    warnings = warnings_of(parsed)
    if numbering is not None and annotations is not None:
        warnings += numbering_warnings(numbering, parsed, predictions=predictions, annotations=annotations)
    n_infinite = sum(map(math.isinf, parsed.ttc_s.tolist()))
    exit_code = Exit.REJECTED if strict and warnings else Exit.GOOD
    if as_json:
        echo_json(
            {
                "predictions_digest": parsed.digest,
                "manifest_digest": sequences.digest,
                "n_sequences": sequences.n_sequences,
                "n_renumbered": None if numbering is None else numbering.n_renumbered,
                "n_infinite": n_infinite,
                "problems": [],
                "warnings": [asdict(warning) for warning in warnings],
            }
        )
        click.get_current_context().exit(exit_code)
    good = "well-formed" if warnings else "good"
    n_predicted = counted(sequences.n_sequences, "sequence")
    click.echo(f"{name_of(predictions)} is {good}: {n_predicted}, each predicted once.")
    if parsed.keys == "anno_id" and numbering is None:
        click.echo(_ONLY_HERE)
    if n_infinite:
        click.echo(f"{counted(n_infinite, 'value')} infinite: no growth, or an overflow; scored as ±20 s.")
    if numbering is not None:
        click.echo(numbering_in_words(numbering))
    echo_warnings(warnings)
    click.get_current_context().exit(exit_code)


_ONLY_HERE: Final = (
    "Its keys are anno_ids, which other editions may give to other sequences. If it is from an earlier "
    "edition, run: tsttc convert FILE --manifest OLD.csv"
)


def _sequences(manifest_path: Path | None, annotations: Path | None) -> tuple[Manifest, Numbering | None]:
    from evaluator import read_manifest  # noqa: PLC0415 -- numpy, as above
    from evaluator.truth.numbering import read_numbering  # noqa: PLC0415 -- numpy, as above

    sequences = None
    if manifest_path is not None:
        with naming(manifest_path):
            sequences = read_manifest(manifest_path)
    if annotations is not None:
        with naming(annotations):
            numbering = read_numbering(annotations, manifest=sequences)
        return numbering.manifest, numbering
    if sequences is None:
        raise click.UsageError("Missing option '--manifest', or '--annotations' in its place.")
    return sequences, None


@click.command(short_help="Write the manifest of a ground truth or a split: its public list of sequences.")
@click.argument("truth", metavar="[TRUTH_OR_FOLDER]", type=TABLE, required=False)
@click.option(
    "--split",
    callback=lambda c, p, value: value and slug(c, p, value),
    help="Get the manifest of this split from the leaderboard.",
)
@click.option("--edition", type=int, metavar="N", help="With --split: of an earlier edition, by its number.")
@output_option("the CSV table")
@site_options
@json_option
def manifest(
    *,
    truth: Path | None,
    split: str | None,
    edition: int | None,
    output: Path | None,
    url: str,
    as_json: bool,
) -> None:
    """Write the manifest of TRUTH_OR_FOLDER: every column of the ground truth but the values.

    With --split, the command gets the manifest of that split from the leaderboard; it needs no token.

    TRUTH_OR_FOLDER is a CSV file or a folder of the toolkit's annotations. The manifest lists
    the anno_id and the natural key of every sequence, without true values. For a folder, the command reports
    on standard error whether the toolkit gives the same anno_ids on this machine.

    \b
    Examples:
      tsttc manifest truth.csv -o manifest.csv
      tsttc manifest annotations/val/ -o manifest.csv
      tsttc manifest --split test -o manifest.csv
    """
    if (truth is None) == (split is None):
        raise click.UsageError("Give either TRUTH_OR_FOLDER or --split.")
    if edition is not None and split is None:
        raise click.UsageError("--edition needs --split.")
    table, numbering = _manifest_of_split(str(split), edition, url) if truth is None else _manifest_of(truth)
    if output is not None:
        if truth is not None and output.exists() and output.samefile(truth):
            raise click.BadParameter("this is the ground truth itself; choose another file.", param_hint="-o")
        write_bytes(output, table.to_csv())
    counts = {"n_sequences": table.n_sequences, "n_recordings": table.n_recordings}
    n_renumbered = None if numbering is None else numbering.n_renumbered
    document = {"manifest_digest": table.digest, **counts, "n_renumbered": n_renumbered}
    _tell_table(table, document, manifest=table, output=output, as_json=as_json)
    if numbering is not None and not as_json:
        click.echo(numbering_in_words(numbering), err=True)


def _manifest_of_split(split: str, edition: int | None, url: str) -> tuple[Manifest, Numbering | None]:
    from evaluator import read_manifest  # noqa: PLC0415 -- numpy, as above

    with connect(url, with_token=False) as client, naming(Path(f"{url.rstrip('/')}: {split}")):
        return read_manifest(client.manifest(split, edition=edition)), None


def _manifest_of(truth: Path) -> tuple[Manifest, Numbering | None]:
    from evaluator import read_manifest  # noqa: PLC0415 -- numpy, as above
    from evaluator.truth.numbering import read_numbering  # noqa: PLC0415 -- numpy, as above

    with naming(truth):
        if truth.is_dir():
            numbering = read_numbering(truth)
            return numbering.manifest, numbering
        return read_manifest(truth), None


@click.command(short_help="Write the ground truth of an annotation folder as a CSV table.")
@click.argument("folder", metavar="FOLDER", type=TABLE)
@output_option("the CSV table")
@json_option
def truth(*, folder: Path, output: Path | None, as_json: bool) -> None:
    """Write the ground truth of FOLDER, the toolkit's annotations, as a CSV table.

    score and compare read the table faster than the folder. It also states occlusion, lane and box of each
    object, for score --by.

    \b
    Example:
      tsttc truth annotations/val/ -o val.csv
    """
    from evaluator import read_truth  # noqa: PLC0415 -- numpy, as above

    with naming(folder):
        ground_truth = read_truth(folder)
    if output is not None:
        if output.exists() and output.samefile(folder):
            raise click.BadParameter("this is the ground truth itself; choose another file.", param_hint="-o")
        write_bytes(output, ground_truth.to_csv())
    document = {
        "truth_digest": ground_truth.digest,
        "manifest_digest": ground_truth.manifest.digest,
        "n_sequences": ground_truth.n_sequences,
        "n_recordings": ground_truth.manifest.n_recordings,
    }
    _tell_table(ground_truth, document, manifest=ground_truth.manifest, output=output, as_json=as_json)


def _tell_table(
    table: Manifest | GroundTruth,
    document: Mapping[str, object],
    *,
    manifest: Manifest,
    output: Path | None,
    as_json: bool,
) -> None:
    if as_json:
        text = {} if output is not None else {"csv": table.to_csv().decode()}
        echo_json({**document, "output": None if output is None else str(output), **text})
    elif output is None:
        click.echo(table.to_csv(), nl=False)
    else:
        n_recordings = counted(manifest.n_recordings, "recording")
        click.echo(f"{output}: {counted(manifest.n_sequences, 'sequence')} of {n_recordings}.")
