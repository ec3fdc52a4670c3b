"""The subcommand board: who leads."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect
from evaluator.cli.failures import echo_json
from evaluator.cli.layout import NO_VALUE, UNITS, Cell, aligned, printable, short_name, width_of
from evaluator.cli.options import json_option, sendable, slug, url_option
from evaluator.protocol import SCORE_NAMES

if TYPE_CHECKING:
    from evaluator.answers import Board, BoardEntry


@click.command(short_help="Show the ranked results of a split.")
@click.argument("split", default="test", callback=slug)
@click.option(
    "--sort",
    callback=sendable,
    default="rank",
    show_default=True,
    metavar="COLUMN",
    help=f"Order by rank, method, team, date, {', '.join(SCORE_NAMES)}; -COLUMN for the reverse.",
)
@url_option
@json_option
def board(*, split: str, sort: str, url: str, as_json: bool) -> None:
    """Show the ranked results of SPLIT (test by default): submissions and published baselines.

    Needs no token. On a terminal the best value of a column is bold and the second underlined.

    \b
    Examples:
      tsttc board
      tsttc board val --sort rte_crucial
    """
    with connect(url, with_token=False) as client:
        found = client.board(split, sort=sort)
    if as_json:
        echo_json(found.document)
        return
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in in_words(found, width=width):
        click.echo(line)


def in_words(found: Board, *, width: int | None) -> Iterator[str]:
    """The board as lines. Where `width` (cells) is too little for all columns, the main ones stay."""
    facts = [found.split]
    if found.edition is not None:
        facts.append(f"edition {found.edition}")
    if found.updated_at:
        facts.append(f"updated {found.updated_at}")
    yield printable(" · ".join(facts))
    if not found.entries:
        yield "No results yet. Be the first: tsttc submit --help"
        return
    yield UNITS
    yield ""
    lines = _table(found.entries, texts=("team", "date"), scores=SCORE_NAMES)
    if width is not None and max(width_of(click.unstyle(line)) for line in lines) > width:
        lines = _table(found.entries, texts=(), scores=("mid", "rte"))
        lines += ["", "Too narrow for all columns; a pipe or --json gets them."]
    yield from lines


def _table(entries: Sequence[BoardEntry], *, texts: Sequence[str], scores: Sequence[str]) -> list[str]:
    from evaluator.ranking import best_and_second  # noqa: PLC0415 -- only once there is a board to mark

    headings = ["rank", "method", *texts, *map(short_name, scores)]
    rows = [[Cell(text, is_bold=True) for text in headings]]
    marks = {name: best_and_second([entry.scores.get(name) for entry in entries]) for name in scores}
    for i, entry in enumerate(entries):
        row = [Cell(NO_VALUE if entry.rank is None else str(entry.rank)), Cell(printable(entry.method))]
        row += [Cell(_team(entry) if name == "team" else printable(entry.date or "")) for name in texts]
        values = _values(entry, scores=scores)
        for name, value in zip(scores, values, strict=True):
            best, second = marks[name]
            row.append(Cell(value, is_bold=i in best, is_underlined=i in second))
        rows.append(row)
    return aligned(rows, align="><" + "<" * len(texts) + "." * len(scores))


def _team(entry: BoardEntry) -> str:
    """The team; for a row printed in a paper its authors, and that it was published."""
    team = entry.team or ""
    if entry.kind != "published":
        return printable(team)
    first, *others = team.split(",")
    authors = f"{first.split()[-1]} et al." if others and first.split() else team
    return printable(f"{authors} (published)")


def _values(entry: BoardEntry, *, scores: Sequence[str]) -> list[str]:
    """A submission's scores with two decimals, a published row's with as many as were printed."""
    from evaluator.report import format_published  # noqa: PLC0415 -- loads numpy, which --help can do without

    known = [value for value in entry.scores.values() if value is not None]
    is_short = entry.kind == "published" and all(round(value, 1) == value for value in known)
    return [
        format_published(entry.scores.get(name), decimals=1 if is_short else 2, missing=NO_VALUE)
        for name in scores
    ]
