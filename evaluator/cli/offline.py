"""The subcommands that need files alone: check, score, manifest. They run the server's own code."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evaluator.cli import gates
from evaluator.cli.failures import echo_json
from evaluator.cli.layout import result_in_words
from evaluator.cli.options import json_option, output_option, predictions_argument
from evaluator.cli.reading import FOLDER, TABLE, bytes_of, name_of, naming, write_bytes
from evaluator.cli.warnings_in_words import (
    echo_warnings,
    numbering_in_words,
    numbering_warnings,
)
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, PROTOCOLS

if TYPE_CHECKING:
    from evaluator import Manifest, Report
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
@json_option
def check(*, predictions: Path, manifest_path: Path | None, annotations: Path | None, as_json: bool) -> None:
    """Check whether PREDICTIONS, a JSON file or - for standard input, is complete and well-formed.

    The command uses the rules of the server and sends nothing. A warning is not an error: the values probably
    belong to other sequences. Without --manifest, --annotations defines the sequences.

    \b
    Examples:
      tsttc check predictions.json --manifest manifest.csv
      tsttc check results.json --annotations annotations/val/
    """
    from evaluator import read_predictions  # noqa: PLC0415 -- numpy, which --help can do without
    from evaluator.predictions.plausibility import warnings_of  # noqa: PLC0415 -- as above

    sequences, numbering = _sequences(manifest_path, annotations)
    with naming(predictions):
        found = read_predictions(bytes_of(predictions), manifest=sequences)
    warnings = warnings_of(found)
    if numbering is not None and annotations is not None:
        warnings += numbering_warnings(numbering, found, predictions=predictions, annotations=annotations)
    if as_json:
        echo_json(
            {
                "predictions_digest": found.digest,
                "manifest_digest": sequences.digest,
                "n_sequences": sequences.n_sequences,
                "n_renumbered": None if numbering is None else numbering.n_renumbered,
                "problems": [],
                "warnings": [asdict(warning) for warning in warnings],
            }
        )
        return
    good = "well-formed" if warnings else "good"
    click.echo(f"{name_of(predictions)} is {good}: {sequences.n_sequences:,} sequences, each predicted once.")
    if numbering is not None:
        click.echo(numbering_in_words(numbering))
    echo_warnings(warnings)


def _sequences(manifest_path: Path | None, annotations: Path | None) -> tuple[Manifest, Numbering | None]:
    """The sequences to check against, and how the toolkit numbers them where a folder says so."""
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


@click.command(short_help="Score a prediction file against your ground truth.")
@predictions_argument
@click.option(
    "--truth",
    "truth_path",
    type=TABLE,
    required=True,
    metavar="FILE",
    help="Ground truth: a CSV file or an annotation folder of the toolkit.",
)
@click.option(
    "--protocol",
    type=click.Choice(list(PROTOCOLS)),
    default=DEFAULT_PROTOCOL,
    show_default=True,
    help="Protocol: tsttc-1 as on the board; toolkit gives the numbers of the dataset's toolkit to the bit.",
)
@gates.fail_if_option
@json_option
def score(
    *, predictions: Path, truth_path: Path, protocol: str, fail_if: list[gates.Condition], as_json: bool
) -> None:
    """Score PREDICTIONS, a JSON file or - for standard input, against your ground truth.

    The scores equal those of the server: two decimals as on the board, full float64 with --json. If you have
    the dataset, give its annotation folder. A warning means that the predictions hardly correlate with the
    true times; the usual cause is another order of the sequences.

    \b
    Examples:
      tsttc score predictions.json --truth annotations/val/
      tsttc score predictions.json --truth val.csv --json | jq .scores.overall.mid
      tsttc score predictions.json --truth val.csv --fail-if "mid > 15.0 or rte > 13"
    """
    from evaluator import evaluate, read_predictions, read_truth  # noqa: PLC0415 -- numpy, as above
    from evaluator.predictions.plausibility import warnings_with_truth  # noqa: PLC0415 -- numpy, as above

    with naming(truth_path):
        truth = read_truth(truth_path)
    with naming(predictions):
        found = read_predictions(bytes_of(predictions), manifest=truth.manifest)
        report = evaluate(found, truth, protocol=protocol)
    warnings = warnings_with_truth(found, truth)
    if not as_json:
        echo_warnings(warnings)
    gates.told(
        {**report.as_dict(), "warnings": [asdict(warning) for warning in warnings]},
        show=lambda: click.echo("\n".join(_in_words(report))),
        judge=lambda: gates.judge(fail_if, report.flat()),
        as_json=as_json,
    )


@click.command(short_help="Write the manifest of a ground truth: its public list of sequences.")
@click.argument("truth", metavar="TRUTH_OR_FOLDER", type=TABLE)
@output_option("the CSV table")
@json_option
def manifest(*, truth: Path, output: Path | None, as_json: bool) -> None:
    """Write the manifest of TRUTH_OR_FOLDER: every column of the ground truth but the values.

    TRUTH_OR_FOLDER is a CSV file or a folder of the toolkit's annotations. The manifest lists
    the anno_id and the natural key of every sequence, without true values. For a folder, the command reports
    on standard error whether the toolkit gives the same anno_ids on this machine.

    \b
    Examples:
      tsttc manifest truth.csv -o manifest.csv
      tsttc manifest annotations/val/ -o manifest.csv
    """
    from evaluator import read_manifest  # noqa: PLC0415 -- numpy, as above
    from evaluator.truth.numbering import read_numbering  # noqa: PLC0415 -- numpy, as above

    numbering = None
    with naming(truth):
        if truth.is_dir():
            numbering = read_numbering(truth)
        table = read_manifest(truth) if numbering is None else numbering.manifest
    if output is not None:
        if output.exists() and output.samefile(truth):
            raise click.BadParameter("this is the ground truth itself; choose another file.", param_hint="-o")
        write_bytes(output, table.to_csv())
    if as_json:
        echo_json(
            {
                "manifest_digest": table.digest,
                "n_sequences": table.n_sequences,
                "n_recordings": table.n_recordings,
                "n_renumbered": None if numbering is None else numbering.n_renumbered,
                "output": None if output is None else str(output),
                **({"csv": table.to_csv().decode()} if output is None else {}),
            }
        )
    elif output is None:
        click.echo(table.to_csv(), nl=False)
    else:
        click.echo(f"{output}: {table.n_sequences:,} sequences of {table.n_recordings:,} recordings.")
    if numbering is not None and not as_json:
        click.echo(numbering_in_words(numbering), err=True)


def _in_words(report: Report) -> Iterator[str]:
    yield from result_in_words(
        report.flat(),
        counts={name: interval.count for name, interval in report.scores.items()},
        n_out_of_range=report.n_out_of_range,
        truncated=report.truncated,
    )
    yield ""
    yield f"protocol     {report.protocol}"
    yield f"truth        {report.truth_digest}"
    yield f"predictions  {report.predictions_digest}"
