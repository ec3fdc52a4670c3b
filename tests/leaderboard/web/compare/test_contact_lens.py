"""The contact lens of a comparison: errors in seconds and metres by the true time to contact."""

import pytest
from django.test import Client

from leaderboard.models import Method, Split, Submission, User
from tests import builders, pages

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("open_values")]


def lens_rows(client: Client, entries: list[Submission]) -> list[pages.Element]:
    query = {"split": "test", "m": [str(entry.method_id) for entry in entries[:2]]}
    client.get("/compare/", query)
    builders.infer_all()
    root = pages.page(client.get("/compare/", query))
    tables = root.all("table", id="lens-table")
    return tables[0].one("tbody").all("tr") if tables else []


def test_error_in_seconds_is_the_relative_error_of_a_range_times_its_middle(
    client: Client, entries: list[Submission]
) -> None:
    rows = lens_rows(client, entries)
    curve = entries[0].evaluations.get().analysis.content["curve"]
    expected = {(row["low_s"], row["high_s"]): row["rte"] for row in curve if row["low_s"] >= 0}
    assert len(rows) == len(expected)
    assert rows[0].attributes["data-high"] == "20", "it begins far away"
    for row in rows:
        low, high = float(row.attributes["data-low"]), float(row.attributes["data-high"])
        seconds = expected[low, high] / 100 * (low + high) / 2
        cell = row.all("td")[0]
        assert float(cell.attributes["data-seconds"]) == pytest.approx(seconds, abs=1e-4)
        assert cell.text == f"{seconds:.2f} s, {seconds * 80 / 3.6:.1f} m"


def test_hidden_splits_have_no_lens(client: Client, entries: list[Submission]) -> None:
    assert lens_rows(client, entries)
    Split.objects.filter(pk="test").update(is_hidden=True)
    builders.board_changed("test")
    assert lens_rows(client, entries) == []


def test_an_anonymous_row_of_another_team_has_no_lens(
    client: Client, entries: list[Submission], owner: User
) -> None:
    Method.objects.filter(pk=entries[0].method_id).update(visibility="ANONYMOUS")
    builders.board_changed("test")
    assert lens_rows(client, entries) == []
    client.force_login(owner)
    assert lens_rows(client, entries)
