"""Export formats are rows of one table, which the site and the command read."""

import importlib
from collections.abc import Iterator

import pytest
from click.testing import CliRunner
from django.test import Client

from evaluator.cli import boards
from evaluator.tables import formats
from evaluator.tables.formats import Format
from evaluator.tables.layouts import Export
from leaderboard.models import Edition, User
from tests import board_rows
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.leaderboard.exports.test_exports import text_of
from tests.leaderboard.exports.test_exports_of_ones_own import links


def write(export: Export) -> str:
    return "".join(f"{row.rank}. {row.method}\n" for row in export.rows)


@pytest.fixture
def _added(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Add a format as a developer does: a writer, and this row."""
    row = Format(name="names", title="Names", suffix="lst", media_type="text/plain", write=write)
    with monkeypatch.context() as patched:
        patched.setattr(formats, "FORMATS", (*formats.FORMATS, row))
        importlib.reload(boards)  # as a process that starts with this table
        yield
    importlib.reload(boards)


@pytest.mark.slow
@pytest.mark.usefixtures("_added")
def test_format_of_one_row_is_on_the_page_at_its_address_and_on_the_command_line(
    edition: Edition, owner: User, client: Client
) -> None:
    board_rows.fill(edition, n=2, user=owner)
    ((*_, plain, _, _, _, _, sure),) = links(client).values()
    assert (plain, sure) == ("/board/test.lst", "/board/test.lst?intervals=1")
    text = text_of(client, "lst")
    assert "1. " in text
    answer = client.get("/board/test/editions/1.lst")
    assert (answer.text, answer["Content-Type"]) == (text, "text/plain; charset=utf-8")
    assert 'filename="tsttc-test-edition-1.lst"' in answer["Content-Disposition"]
    assert "|names]" in CliRunner().invoke(boards.board, ["--help"]).stdout
    with RecordedSite() as site:
        site.put("GET /api/v1/splits/test/board", Reply(client.get("/api/v1/splits/test/board").json()))
        site.put("GET /board/test/editions/1.lst", Reply(answer.content))
        asked = CliRunner().invoke(boards.board, ["--format", "names", "--url", site.url])
    assert asked.stdout == text
