"""The subcommand board: the ranked rows of a split."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect
from evaluator.cli.failures import echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned, printable, short_name, units, width_of
from evaluator.cli.options import default_option, json_option, sendable, site_options, slug
from evaluator.cli.values import authors_or_team, overall_of, texts_of
from evaluator.metrics.protocol import known_names, primary_of
from evaluator.tables import layouts
from evaluator.tables.formats import FORMATS
from evaluator.units import RECORDING

if TYPE_CHECKING:
    from evaluator.client.answers import Board, BoardEntry


@click.command(short_help="Show the ranked results of a split.")
@click.argument("split", default="test", callback=slug)
@default_option(
    "--sort",
    callback=sendable,
    default="rank",
    metavar="COLUMN",
    help=f"Sort by rank, method, team, date, {', '.join(known_names())}; -COLUMN for the reverse.",
)
@default_option(
    "--format",
    "as_format",
    type=click.Choice(["table", *(each.name for each in FORMATS)]),
    default="table",
    help="What to print.",
)
@click.option("--mine", is_flag=True, help="Include the private and anonymous methods of your team, marked.")
@click.option(
    "--intervals", "has_intervals", is_flag=True, help="Show the 95% confidence interval of each value."
)
@click.option(
    "--edition",
    type=click.IntRange(min=1),
    metavar="N",
    help="The board of edition N (default: the current edition).",
)
@click.option(
    "--at",
    callback=sendable,
    metavar="MOMENT",
    help="The board as of a date, or of a time such as 2026-11-20T18:00:00Z.",
)
@site_options
@json_option
def board(
    *,
    split: str,
    sort: str,
    as_format: str,
    mine: bool,
    has_intervals: bool,
    edition: int | None,
    at: str | None,
    url: str,
    as_json: bool,
) -> None:
    """Show the ranked results of SPLIT (test by default): submissions and published baselines.

    Needs no token, except with --mine. On a terminal the best value of a column is bold and the second
    underlined.

    \b
    Examples:
      tsttc board
      tsttc board val --sort rte_crucial
      tsttc board val --format latex --intervals > table.tex
      tsttc board test --edition 1
      tsttc board test --format bibtex > board.bib
    """
    if edition is not None and at:
        raise click.UsageError("--edition and --at exclude each other; give one of them.")
    form = "json" if as_json else as_format
    if mine and form not in {"table", "json"}:
        raise click.UsageError(
            f"--mine does not go with --format {form}. The page of the board has this format with your own "
            "rows, when you are signed in."
        )
    with connect(url, with_token=mine) as client:
        split_board = client.board(split, sort=sort, edition=edition, at=at, has_intervals=has_intervals)
        if form not in {"table", "json"}:
            suffix = next(each.suffix for each in FORMATS if each.name == form)
            text = client.export(split_board, suffix, sort=sort, at=at, has_intervals=has_intervals)
            click.echo(text.replace("\r\n", "\n"), nl=False)  # as lines end here
            return
    if form == "json":
        echo_json(split_board.document)
    else:
        _show(split_board, is_mine=mine)


def _show(board: Board, *, is_mine: bool) -> None:
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in in_words(board, width=width):
        click.echo(line)
    if is_mine:
        click.echo(
            "\nOnly your team sees its private methods; they do not affect the public ranks. "
            "Other teams see anonymous methods under a pseudonym."
        )


def in_words(board: Board, *, width: int | None) -> Iterator[str]:
    """Format the board as lines; if `width` (cells) is too small, only the main columns stay."""
    facts = [board.split]
    if board.edition is not None:
        facts.append(f"edition {board.edition}")
    if board.updated:
        facts.append(f"updated {board.updated}")
    yield printable(" · ".join(facts))
    if not board.entries:
        yield "No results yet. Be the first: tsttc submit --help"
        return
    yield units(board.score_names)
    yield ""
    lines = _table(board, texts=("team", "date"), scores=board.score_names)
    if width is not None and max(width_of(click.unstyle(line)) for line in lines) > width:
        lines = _table(board, texts=(), scores=overall_of(board.score_names))
        lines += ["", "The terminal is too narrow for all columns; use a pipe or --json."]
    yield from lines
    if any(entry.intervals for entry in board.entries):
        yield ""
        yield layouts.brackets(board.unit or RECORDING, board.n_units)
    if board.floor:
        from evaluator.scoring.scores import floor_sentence  # noqa: PLC0415 -- loads numpy

        yield ""
        yield floor_sentence(board.floor, decimals=board.decimals or 2)


def _table(board: Board, *, texts: Sequence[str], scores: Sequence[str]) -> list[str]:
    headings = ["rank", "method", *texts, *map(short_name, scores)]
    rows = [[Cell(text, is_bold=True) for text in headings]]
    marks = {name: _marks_of(board, name) for name in scores}
    for i, entry in enumerate(board.entries):
        ranks = entry.interval(primary_of(entry.scores))
        mark = layouts.mark_of(visibility=entry.visibility, pseudonym=entry.pseudonym)
        row = [
            Cell(layouts.rank_text(entry.rank, low=ranks.rank_low, high=ranks.rank_high)),
            Cell(layouts.marked(printable(entry.method), mark)),
        ]
        row += [
            Cell(printable(authors_or_team(entry)) if name == "team" else printable(entry.date or ""))
            for name in texts
        ]
        values = texts_of(entry, missing=NO_VALUE, scores=tuple(scores))
        for name, value in zip(scores, values, strict=True):
            best, second = marks[name]
            row.append(
                Cell(value + _interval_text(entry, name), is_bold=i in best, is_underlined=i in second)
            )
        rows.append(row)
    return aligned(rows, align="><" + "<" * len(texts) + "." * len(scores))


def _marks_of(board: Board, name: str) -> tuple[frozenset[int], frozenset[int]]:
    from evaluator.metrics.registry import best_and_second  # noqa: PLC0415 -- only once there is a board to mark

    return best_and_second(
        [None if entry.visibility == "PRIVATE" else entry.scores.get(name) for entry in board.entries]
    )


def _interval_text(entry: BoardEntry, name: str) -> str:
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- loads numpy, which --help can do without

    interval = entry.interval(name)
    low, high = (
        format_rounded(end, decimals=entry.decimals, missing="") for end in (interval.low, interval.high)
    )
    return f" [{low}, {high}]" if low and high else ""
