"""The subcommand compare: two methods of a board, or two files against ground truth that you have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.gates import named
from evaluator.cli.layout import NO_VALUE, Cell, aligned, printable, short_name, units
from evaluator.cli.options import (
    default_option,
    json_option,
    sendable,
    slug,
    timeout_option,
    unit_option,
    url_option,
)
from evaluator.cli.reading import TABLE, labels_of, naming, naming_predictions, predictions_of, units_asked
from evaluator.cli.tokens import has_token
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, PROTOCOLS, primary_of
from evaluator.scoring.significance import Difference
from evaluator.tables.sentences import influence, others, p_cell, sentence
from evaluator.units import in_words

if TYPE_CHECKING:
    from evaluator.client.answers import Compared
    from evaluator.metrics.protocol import ProtocolName

Scores = Mapping[str, float | None]


@click.command(short_help="Compare two methods or two files, with confidence intervals and p-values.")
@click.argument("first", callback=sendable)
@click.argument("second", callback=sendable)
@default_option(
    "--split",
    default="test",
    callback=slug,
    help="The board of the methods.",
)
@click.option(
    "--truth",
    "truth_path",
    type=TABLE,
    metavar="FILE",
    help="Ground truth: compare FIRST and SECOND as prediction files, offline.",
)
@click.option(
    "--protocol",
    type=click.Choice(list(PROTOCOLS)),
    help=f"Protocol of an offline comparison, as the board's edition says; default: {DEFAULT_PROTOCOL}. "
    "tsttc-2 also has the warning error.",
)
@unit_option
@timeout_option("Stop waiting for the server's comparison after this time.", default=120.0)
@url_option
@json_option
def compare(
    *,
    first: str,
    second: str,
    split: str,
    truth_path: Path | None,
    protocol: ProtocolName | None,
    unit: str | None,
    timeout_s: float,
    url: str,
    as_json: bool,
) -> None:
    """Compare FIRST with SECOND, methods of a board by name or id, or with --truth two prediction files.

    Each column shows the difference, its 95% confidence interval and the p-value of a two-sided test. Both
    resample whole days or recordings, because sequences of one recording resemble each other, and recordings
    of one day. Negative means that FIRST is better.

    \b
    Examples:
      tsttc compare "Foo++" "Bar" --split val
      tsttc compare new.json old.json --truth annotations/val/
    """
    if truth_path is not None:
        _compare_files(
            Path(first),
            Path(second),
            truth_path,
            protocol=protocol or DEFAULT_PROTOCOL,
            unit=unit,
            as_json=as_json,
        )
        return
    if protocol is not None:
        raise click.UsageError("--protocol needs --truth; a board's edition has its own protocol.")
    if unit is not None:
        raise click.UsageError("--unit needs --truth; a board's edition keeps its own unit.")
    with connect(url, with_token=has_token(url), timeout_s=timeout_s) as client:
        board = client.board(split)
        entries = [named(board, name) for name in (first, second)]
        ids = [entry.method_id for entry in entries if entry.method_id]
        if len(ids) < len(entries):
            raise Failure(
                "A row quoted from a paper cannot be compared: papers do not report values per recording.",
                exit_code=Exit.USAGE,
                code="bad-comparison",
            )
        comparison = client.compare(split, ids, timeout_s=timeout_s)
    if as_json:
        echo_json(comparison.document)
        return
    for line in _server_s_words(
        comparison,
        names=(entries[0].method, entries[1].method),
        scores=(entries[0].scores, entries[1].scores),
    ):
        click.echo(line)


def _server_s_words(
    comparison: Compared, *, names: tuple[str, str], scores: tuple[Scores, Scores]
) -> Iterator[str]:
    edition = f" · edition {comparison.edition}" if comparison.edition is not None else ""
    yield printable(f"{comparison.split}{edition}")
    yield units(scores[0])
    if any(gap.low is not None for gap in comparison.differences().values()):
        yield f"95% confidence intervals and p-values over {in_words(comparison.unit, comparison.n_units)}"
    yield ""
    yield from table(names, scores, comparison.differences(), decimals=comparison.decimals)
    pair_sentence = comparison.pairs[0].sentence if comparison.pairs else ""
    if pair_sentence or comparison.reason:
        yield ""
        yield printable(pair_sentence or comparison.reason)
    yield from filter(None, (others(comparison.differences(), primary=primary_of(scores[0])),))


def _compare_files(
    first: Path,
    second: Path,
    truth_path: Path,
    *,
    protocol: ProtocolName,
    unit: str | None,
    as_json: bool,
) -> None:
    from evaluator import compare_predictions, evaluate, read_predictions, read_truth, rounded  # noqa: PLC0415 -- numpy

    with naming(truth_path):
        truth = read_truth(truth_path)
    taken = units_asked(truth, unit)
    read, reports = [], []
    for path in (first, second):
        with naming_predictions(path):
            predictions = read_predictions(predictions_of(path), manifest=truth.manifest)
            read.append(predictions)
            reports.append(evaluate(predictions, truth, protocol=protocol))
    differences = compare_predictions(read[0], read[1], truth, protocol=protocol, unit=taken.kind)
    if as_json:
        documents = {
            name: {
                **asdict(gap),
                "is_significant": gap.is_significant,
                "detectable_difference": rounded(gap.detectable_difference),
            }
            for name, gap in differences.items()
        }
        echo_json(
            {
                "first": reports[0].as_dict(),
                "second": reports[1].as_dict(),
                "unit": taken.kind,
                "n_units": len(taken),
                "differences": documents,
            }
        )
        return
    first_label, second_label = labels_of((first, second))
    names = first_label, second_label
    for line in table(names, (reports[0].flat(), reports[1].flat()), differences):
        click.echo(line)
    click.echo("")
    click.echo(units(reports[0].flat()))
    if any(gap.low is not None for gap in differences.values()):
        click.echo(f"95% confidence intervals and p-values over {taken}")
    primary = primary_of(reports[0].flat())
    if primary in differences:
        click.echo(printable(sentence(*names, name=primary, difference=differences[primary])))
        if rests_on := influence(*names, difference=differences[primary]):
            click.echo(printable(rests_on))
    if lead := others(differences, primary=primary):
        click.echo(lead)


def table(
    names: tuple[str, str],
    scores: tuple[Scores, Scores],
    differences: Mapping[str, Difference],
    *,
    decimals: int = 2,
) -> list[str]:
    """Tabulate both results, and below them each column's difference with interval and p."""
    from evaluator.scoring.results import format_rounded, rounded  # noqa: PLC0415 -- loads numpy

    columns = list(scores[0])
    rows = [[Cell(""), *(Cell(short_name(name), is_bold=True) for name in columns)]]
    for name, values in zip(names, scores, strict=True):
        texts = [format_rounded(values.get(score), decimals=decimals, missing=NO_VALUE) for score in columns]
        rows.append([Cell(printable(name)), *map(Cell, texts)])

    def column(kind: str) -> list[Cell]:
        values = [rounded(getattr(differences.get(name), kind, None), decimals=decimals) for name in columns]
        return [Cell(NO_VALUE if value is None else f"{value:+.{decimals}f}") for value in values]

    gaps = [differences.get(name) for name in columns]
    chances = [NO_VALUE if gap is None else p_cell(gap.p, gap.p_below) or NO_VALUE for gap in gaps]

    rows += [
        [Cell("difference", is_bold=True), *column("difference")],
        [Cell("95% from"), *column("low")],
        [Cell("95% to"), *column("high")],
        [Cell("p"), *map(Cell, chances)],
    ]
    return aligned(rows, align="<" + "." * len(columns))
