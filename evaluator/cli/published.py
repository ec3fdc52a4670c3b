"""The subcommand published: the tables of the paper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.failures import echo_json
from evaluator.cli.layout import Cell, aligned
from evaluator.cli.options import default_option, json_option

if TYPE_CHECKING:
    from evaluator.tables.published import PrintedTable

FORMATS: Final = ("csv", "latex", "markdown", "json")
"""Those of `evaluator.tables.published.WRITERS`."""


@click.command(short_help="Show the tables of the paper.")
@click.argument("name", metavar="[TABLE]", required=False)
@default_option(
    "--format", "as_format", type=click.Choice(["table", *FORMATS]), default="table", help="What to print."
)
@json_option
def published(*, name: str | None, as_format: str, as_json: bool) -> None:
    """Show TABLE of the paper; without TABLE, list all tables.

    Values are those that the paper prints. Where it contradicts itself, a note says so. Needs no network.

    \b
    Examples:
      tsttc published
      tsttc published ablation-frame-gap
      tsttc published main-results --format latex > table.tex
    """
    from evaluator.papers.tables import published_tables  # noqa: PLC0415 -- msgspec, which --help can do without
    from evaluator.tables.published import WRITERS, printed  # noqa: PLC0415 -- as above

    as_format = "json" if as_json else as_format
    if name is None:
        _list(as_format)
        return
    known = [table.name for table in published_tables().tables]
    if name not in known:
        message = f"There is no table {name!r}; expected one of {', '.join(known)}."
        raise click.BadParameter(message, param_hint="TABLE")
    shown = printed(published_tables().table(name))
    if as_format == "table":
        click.echo("\n".join(_in_words(shown)))
    else:
        click.echo(WRITERS[as_format](shown).replace("\r\n", "\n"), nl=False)  # as lines end here


def _list(as_format: str) -> None:
    from evaluator.tables.published import document, printed_tables  # noqa: PLC0415 -- as above

    if as_format == "json":
        echo_json([document(shown) for shown in printed_tables()])
        return
    if as_format != "table":
        raise click.UsageError(f"--format {as_format} prints one table; name it, as in main-results.")
    rows = [[Cell(text, is_bold=True) for text in ("table", "title", "results")]]
    for shown in printed_tables():
        count = str(shown.n_results) if shown.n_results else ""
        rows.append([Cell(shown.table.name), Cell(shown.title), Cell(count)])
    click.echo("\n".join(aligned(rows, align="<<>")))


def _in_words(shown: PrintedTable) -> Iterator[str]:
    from evaluator.tables.published import about  # noqa: PLC0415 -- as above

    table = shown.table
    rows = [[Cell(text, is_bold=True) for text in shown.headings]]
    for row in shown.rows:
        cells = list(row.cells)
        if row.is_default:
            cells[shown.n_names - 1] += " (default)"
        rows.append([Cell(text, is_bold=row.is_default) for text in cells])
    value = "." if table.is_result else "<"
    n_values = len(shown.headings) - shown.n_names
    yield from aligned(rows, align="<" * shown.n_names + value * n_values)
    yield ""
    if shown.units:
        yield f"{shown.units}."
    for note in table.notes:
        yield f"Note: {note}"
    yield about(shown)[-1]
