"""The subcommands score and plot: one's own results, computed offline by the server's own code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from evaluator.cli import gates
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned, printable, result_in_words, short_name, units
from evaluator.cli.options import default_option, json_option, unit_option
from evaluator.cli.reading import (
    TABLE,
    labels_of,
    naming,
    naming_predictions,
    predictions_of,
    units_asked,
    write_bytes,
)
from evaluator.cli.warnings_in_words import echo_warnings
from evaluator.counting import counted
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, OVERALL, PROTOCOLS
from evaluator.tables.results import WRITERS, ResultRow, names_of
from evaluator.tables.sentences import without_interval
from evaluator.units import in_words

if TYPE_CHECKING:
    from evaluator import GroundTruth, Report
    from evaluator.metrics.protocol import ProtocolName
    from evaluator.problems import FileWarning
    from evaluator.scoring.breakdown import GroupName
    from evaluator.scoring.report import PlotKind
    from evaluator.units import Units

GROUPS: Final = ("recording", "camera", "range", "occlusion", "lane", "box-size")
FORMATS: Final = ("table", *WRITERS)
KINDS: Final = ("error", "scatter", "distribution")

several_predictions = click.argument(
    "predictions",
    type=click.Path(exists=True, dir_okay=False, allow_dash=True, path_type=Path),
    nargs=-1,
    required=True,
)
truth_option = click.option(
    "--truth",
    "truth_path",
    type=TABLE,
    required=True,
    metavar="FILE",
    help="Ground truth: a CSV file or an annotation folder of the toolkit.",
)
protocol_option = default_option(
    "--protocol",
    type=click.Choice(list(PROTOCOLS)),
    default=DEFAULT_PROTOCOL,
    help="Protocol: that of the board; toolkit gives the numbers of the dataset's toolkit to the bit.",
)


@dataclass(frozen=True, slots=True)
class _Scored:
    name: str
    report: Report
    warnings: list[FileWarning]

    def document(self) -> dict[str, Any]:
        return {**self.report.as_dict(), "warnings": [asdict(warning) for warning in self.warnings]}


class _Group(click.Choice[str]):
    """One of the groups; box_size, as in Python, is box-size."""

    def normalize_choice(self, choice: object, ctx: click.Context | None) -> str:
        return super().normalize_choice(choice, ctx).replace("_", "-")


@click.command(short_help="Score prediction files against your ground truth.")
@several_predictions
@truth_option
@protocol_option
@click.option("--by", type=_Group(GROUPS), help="Scores of each group of sequences.")
@click.option(
    "--intervals",
    "with_intervals",
    is_flag=True,
    help="Also 95% confidence intervals (bootstrap over days or recordings), as on the board.",
)
@unit_option
@click.option(
    "--per-sequence",
    "per_sequence",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the errors of every sequence to this CSV file.",
)
@default_option(
    "--format",
    "form",
    type=click.Choice(FORMATS),
    default="table",
    help="How the scores are printed; csv has all digits.",
)
@gates.fail_if_option
@json_option
def score(
    *,
    predictions: tuple[Path, ...],
    truth_path: Path,
    protocol: ProtocolName,
    by: GroupName | None,
    with_intervals: bool,
    unit: str | None,
    per_sequence: Path | None,
    form: str,
    fail_if: list[gates.Condition],
    as_json: bool,
) -> None:
    """Score PREDICTIONS, one or more files or - for standard input, against your ground truth.

    The scores equal those of the server: two decimals as on the board, full float64 with --json. If you have
    the dataset, give its annotation folder. Several files make one table. A warning means that the
    predictions hardly correlate with the true times; the usual cause is another order of the sequences.

    \b
    Examples:
      tsttc score predictions.json --truth annotations/val/
      tsttc score predictions.json --truth val.csv --by occlusion --intervals
      tsttc score old.json new.json --truth val.csv --format latex
      tsttc score predictions.json --truth val.csv --json | jq .scores.overall.mid
      tsttc score predictions.json --truth val.csv --fail-if "mid > 15.0 or rte > 13"
    """
    if as_json and form != "table":
        raise click.UsageError("--json and --format exclude each other; choose one of them.")
    if unit is not None and not with_intervals:
        raise click.UsageError("--unit is that of intervals; add --intervals.")
    truth = _truth(truth_path)
    scored_files = list(_scored(predictions, truth, protocol=protocol))
    taken = units_asked(truth, unit) if with_intervals else None
    rows = [row for one in scored_files for row in _rows(one, by=by, taken=taken)]
    if not as_json:
        for one in scored_files:
            _warn(one, alone=len(scored_files) == 1)
    if per_sequence is not None:
        write_bytes(per_sequence, _per_sequence(scored_files), option="--per-sequence")
    if taken and not as_json and not any(any(row.intervals.values()) for row in rows):
        groups = f"No {by} has a confidence interval" if by else "There are no confidence intervals"
        few = f"one needs 8 {in_words(taken.kind)} of equal size, or more of unequal size"
        click.echo(f"{groups}: {few}; found {taken} in all.", err=True)
    if taken and not as_json and by is None:
        for one, row in zip(scored_files, rows, strict=True):
            if any(row.intervals.values()):
                _say_what_has_none(one, row, taken)
    tabular = by is not None or with_intervals or len(scored_files) > 1
    gates.show_and_judge(
        _document(scored_files, rows if tabular else [], by=by, taken=taken),
        show=lambda: click.echo(_shown(scored_files, rows, by=by, form=form), nl=False),
        judge=lambda: _judge(fail_if, scored_files),
        as_json=as_json,
    )


@click.command(short_help="Draw figures of prediction files for a paper: SVG, PDF or PNG.")
@several_predictions
@truth_option
@protocol_option
@default_option(
    "--kind",
    type=click.Choice(KINDS),
    default=KINDS[0],
    help="error by true TTC with its confidence band, scatter of predicted against true, or distribution.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    required=True,
    help="The figure; the ending decides: .svg, .pdf or .png.",
)
@json_option
def plot(
    *,
    predictions: tuple[Path, ...],
    truth_path: Path,
    protocol: ProtocolName,
    kind: PlotKind,
    output: Path,
    as_json: bool,
) -> None:
    """Draw a figure of PREDICTIONS, one or more files or - for standard input. Needs matplotlib.

    Several files are drawn into one figure; the legend names each method after its file.

    \b
    Examples:
      tsttc plot predictions.json --truth annotations/val/ -o error.pdf
      tsttc plot Old.json New.json --truth val.csv --kind scatter -o scatter.svg
    """
    try:
        from evaluator.scoring import plots  # noqa: PLC0415 -- matplotlib is of an extra
    except ModuleNotFoundError as error:
        raise Failure(
            f"tsttc plot needs matplotlib, which is not installed ({error}).",
            exit_code=Exit.USAGE,
            code="not-installed",
            hint="Install it with: pip install matplotlib",
        ) from None
    if output.suffix.lower() not in plots.SUFFIXES:
        expected = ", ".join(plots.SUFFIXES)
        raise click.BadParameter(
            f"found {output.name!r}, expected a name that ends in {expected}.", param_hint="-o"
        )
    scored_files = list(_scored(predictions, _truth(truth_path), protocol=protocol))
    for one in scored_files:
        _warn(one, alone=len(scored_files) == 1)
    names = [Path(one.name).stem for one in scored_files]
    if len(set(names)) < len(names):
        names = [one.name for one in scored_files]
    details = [one.report.require_details() for one in scored_files]
    try:
        plots.draw(kind, dict(zip(names, details, strict=True)), path=output)
    except OSError as error:
        raise click.BadParameter(f"{output} cannot be written: {error.strerror}.", param_hint="-o") from None
    if as_json:
        echo_json({"output": str(output), "kind": kind, "names": names})
    else:
        click.echo(f"{output}: {kind} of {', '.join(map(printable, names))}.")


def _truth(path: Path) -> GroundTruth:
    from evaluator import read_truth  # noqa: PLC0415 -- numpy, which --help can do without

    with naming(path):
        return read_truth(path)


def _scored(paths: Sequence[Path], truth: GroundTruth, *, protocol: ProtocolName) -> Iterator[_Scored]:
    from evaluator import evaluate, read_predictions  # noqa: PLC0415 -- numpy, as above
    from evaluator.predictions.plausibility import warnings_with_truth  # noqa: PLC0415 -- numpy, as above

    if len(set(paths)) < len(paths):
        raise click.UsageError("A file is named twice; expected each once.")
    for path, label in zip(paths, labels_of(paths), strict=True):
        with naming_predictions(path):
            read = read_predictions(predictions_of(path), manifest=truth.manifest)
            report = evaluate(read, truth, protocol=protocol, keep_sequences=True)
        yield _Scored(label, report, warnings_with_truth(read, truth))


def _rows(scored: _Scored, *, by: GroupName | None, taken: Units | None) -> Iterator[ResultRow]:
    report, drawn = scored.report, "" if taken is None else str(taken)
    if by is not None:
        try:
            groups = report.breakdown(by, with_intervals=bool(taken), unit=taken.kind if taken else None)
        except ValueError as fault:  # the ground truth lacks the column
            raise click.BadParameter(str(fault), param_hint="--by") from None
        for one in groups:
            ends = one.intervals if taken else {}
            yield ResultRow(
                scored.name, one.group, one.n_sequences, one.n_recordings, one.scores, ends, drawn
            )
        return
    yield ResultRow(
        scored.name,
        None,
        report.n_sequences,
        report.require_details().truth.manifest.n_recordings,
        report.flat(),
        _intervals(report, taken) if taken else {},
        drawn,
    )


def _say_what_has_none(scored: _Scored, row: ResultRow, taken: Units) -> None:
    from evaluator.scoring.scores import Scorer  # noqa: PLC0415 -- numpy, as above
    from evaluator.scoring.uncertainty import by_units, degrees_of  # noqa: PLC0415 -- likewise

    details = scored.report.require_details()
    counts = {OVERALL: scored.report.n_sequences, **details.truth.counts_of(details.protocol.ranges)}
    rules = details.protocol
    degrees = degrees_of(by_units(Scorer(details.truth, rules).recording_counts, taken))
    reasons = without_interval(
        {name: row.scores[name] for name, ends in row.intervals.items() if ends is None},
        counts=counts,
        decimals=rules.decimals,
        n_effective=dict(zip(rules.score_names, degrees.tolist(), strict=True)),
        unit=taken.kind,
    )
    for reason in reasons:
        click.echo(f"No interval of {reason}.", err=True)


def _intervals(report: Report, taken: Units) -> dict[str, tuple[float, float] | None]:
    from evaluator import confidence_intervals  # noqa: PLC0415 -- numpy, as above

    details = report.require_details()
    return confidence_intervals(
        details.predictions, details.truth, protocol=details.protocol, unit=taken.kind
    )


def _warn(scored: _Scored, *, alone: bool) -> None:
    if scored.warnings and not alone:
        click.echo(f"{printable(scored.name)}:", err=True)
    echo_warnings(scored.warnings)


def _document(
    scored_files: Sequence[_Scored], rows: Sequence[ResultRow], *, by: str | None, taken: Units | None
) -> dict[str, Any]:
    documents: list[dict[str, Any]] = []
    for one in scored_files:
        document = one.document()
        own = [row for row in rows if row.file == one.name]
        if by is not None:
            document["by"] = by
            document["groups"] = [_group_document(row) for row in own]
        elif own and own[0].intervals:
            document["intervals"] = own[0].intervals
        if taken:
            document |= {"unit": taken.kind, "n_units": len(taken)}
        documents.append(document)
    if len(documents) == 1:
        return documents[0]
    return {"files": [{"file": one.name, **each} for one, each in zip(scored_files, documents, strict=True)]}


def _group_document(row: ResultRow) -> dict[str, Any]:
    return {
        "group": row.group,
        "n_sequences": row.n_sequences,
        "n_recordings": row.n_recordings,
        "scores": dict(row.scores),
        **({"intervals": dict(row.intervals)} if row.intervals else {}),
    }


def _shown(scored_files: Sequence[_Scored], rows: Sequence[ResultRow], *, by: str | None, form: str) -> str:
    if form != "table":
        return WRITERS[form](rows, by=by)
    if by is None and len(scored_files) == 1:
        lines = list(_in_words(scored_files[0].report, rows[0]))
    else:
        report = scored_files[0].report
        counts = f"{counted(report.n_sequences, 'sequence')}, protocol {report.protocol}"
        lines = [*_table(rows, by=by), "", units(rows[0].scores), f"{counts}, truth {report.truth_digest}"]
        lines += [f"95% confidence intervals; bootstrap over {rows[0].units}"] if rows[0].units else []
    return "".join(f"{line}\n" for line in lines)


def _in_words(report: Report, row: ResultRow) -> Iterator[str]:
    yield from result_in_words(
        report.flat(),
        counts={name: score.count for name, score in report.scores.items()},
        n_out_of_range=report.n_out_of_range,
        truncated=report.truncated,
        intervals=row.intervals,
    )
    yield ""
    yield f"protocol     {report.protocol}"
    yield f"truth        {report.truth_digest}"
    yield f"predictions  {report.predictions_digest}"
    if row.units:
        yield f"intervals    95%, bootstrap over {row.units}"


def _table(rows: Sequence[ResultRow], *, by: str | None) -> list[str]:
    from evaluator import format_rounded  # noqa: PLC0415 -- numpy, as above

    names, scores = names_of(rows, by=by), list(rows[0].scores)

    def line(texts: Sequence[str], values: Sequence[float | None], last: str) -> list[Cell]:
        cells = [format_rounded(value, missing=NO_VALUE) for value in values]
        return [Cell(printable(text)) for text in (*texts, *cells, last)]

    heads = [*(title for title, _ in names), *map(short_name, scores), "sequences"]
    lines = [[Cell(head, is_bold=True) for head in heads]]
    for row in rows:
        lines.append(line([of(row) for _, of in names], list(row.scores.values()), f"{row.n_sequences:,}"))
        for end, words in ((0, "  95% from"), (1, "  95% to")) if any(row.intervals.values()) else ():
            ends = [row.intervals[name] for name in scores]
            values = [None if pair is None else pair[end] for pair in ends]
            lines.append(line([words, *[""] * (len(names) - 1)], values, ""))
    return aligned(lines, align="<" * len(names) + "." * len(scores) + ">")


def _per_sequence(scored_files: Sequence[_Scored]) -> bytes:
    from evaluator.tables.formats import csv_lines  # noqa: PLC0415 -- needed here alone

    tables = [one.report.records() for one in scored_files]
    columns = ["file", *tables[0]]
    records = (
        dict(zip(columns, (one.name, *values), strict=True))
        for one, table in zip(scored_files, tables, strict=True)
        for values in zip(*table.values(), strict=True)
    )
    return "".join(csv_lines(records, columns=columns)).encode()


def _judge(conditions: list[gates.Condition], scored_files: Sequence[_Scored]) -> None:
    for one in scored_files:
        try:
            gates.judge(gates.verdicts_of(conditions, one.report.flat()))
        except Failure as failure:
            if len(scored_files) > 1:
                failure.message = f"{printable(one.name)}: {failure.message}"
                failure.document["title"] = failure.message
            raise
