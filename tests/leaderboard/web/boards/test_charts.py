"""The page of a board's charts, and the closer look at a submission to an open split."""

from datetime import timedelta
from pathlib import Path

import pytest
from django.test import Client

from leaderboard.models import Edition, Method, Split, Submission, User
from tests import builders, pages


def get(client: Client, address: str, status: int = 200) -> pages.Element:
    response = client.get(address)
    assert response.status_code == status
    return pages.page(response)


def test_every_chart_has_its_drawing_and_the_table_behind_it(
    client: Client, entries: list[Submission]
) -> None:
    builders.infer_all()
    root = get(client, "/board/test/charts/")
    for figure in root.all("figure"):
        assert figure.one("div", class_="panels").all("svg")
        for drawing in figure.one("div", class_="panels").all("svg"):
            assert drawing.attributes["role"] == "img"
            assert "the table below says the same" in drawing.attributes["aria-label"]
        assert figure.one("tbody").all("tr")
    assert [figure.attributes["data-chart"] for figure in root.all("figure")] == [
        "progress",
        "latency",
        "profile",
    ]


def test_the_best_so_far_only_falls(client: Client, entries: list[Submission]) -> None:
    rows = (
        get(client, "/board/test/charts/").one("figure", **{"data-chart": "progress"}).one("tbody").all("tr")
    )
    values = [float(row.attributes["data-y"]) for row in rows]
    marked = [value for value, row in zip(values, rows, strict=True) if "data-marked" in row.attributes]
    assert marked == sorted(set(marked), reverse=True)
    assert marked[-1] == min(values)
    assert [row.attributes["data-x"] for row in rows] == sorted(row.attributes["data-x"] for row in rows)


def test_every_attempt_has_its_own_day_in_the_table(
    client: Client, edition: Edition, entries: list[Submission], owner: User
) -> None:
    first, method = entries[0], entries[0].method
    first.submitted_at -= timedelta(days=40)
    first.save(update_fields=["submitted_at"])
    later = builders.submit(owner, builders.predictions(edition, factor=1.9), method=method.name)
    builders.score_all()
    rows = (
        get(client, "/board/test/charts/").one("figure", **{"data-chart": "progress"}).one("tbody").all("tr")
    )
    days = [row.all("td")[0].text for row in rows if row.all("td")[1].text == method.name]
    assert days == [f"{attempt.submitted_at:%Y-%m-%d}" for attempt in (first, later)]


def test_the_front_is_what_nothing_beats_in_both(client: Client, entries: list[Submission]) -> None:
    for latency_ms, entry in zip((40.0, 3.0, 12.0, 1.0), entries, strict=True):
        Method.objects.filter(pk=entry.method_id).update(latency_ms=latency_ms, hardware="one GPU")
    builders.board_changed("test")
    rows = (
        get(client, "/board/test/charts/").one("figure", **{"data-chart": "latency"}).one("tbody").all("tr")
    )
    points = [(float(row.attributes["data-x"]), float(row.attributes["data-y"])) for row in rows]
    front = [p for p, row in zip(points, rows, strict=True) if "data-marked" in row.attributes]
    assert front == [p for p in points if not any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)]


def test_a_board_with_nothing_to_draw_says_so_and_has_no_empty_chart(client: Client, benchmark: None) -> None:
    root = get(client, "/board/demo/charts/")
    assert root.all("figure") == []
    assert "There is nothing to draw yet" in root.one("main").text
    assert client.get("/board/nowhere/charts/").status_code == 404


def test_private_methods_are_in_no_chart_not_even_their_teams(
    client: Client, entries: list[Submission], owner: User, edition: object
) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.01), method="Secret", visibility="PRIVATE")
    builders.score_all()
    before = client.get("/board/test/charts/").content
    assert b"Secret" not in before
    client.force_login(owner)
    assert b"Secret" not in client.get("/board/test/charts/").content


# --- the closer look -------------------------------------------------------------------------------------


@pytest.fixture
def open_split(tmp_path: Path, benchmark: None, owner: User) -> Submission:
    """A scored submission to `val`, whose truth may be looked into."""
    edition = builders.import_truth(tmp_path, split="val")
    sent = builders.submit(owner, builders.predictions(edition), split="val")
    builders.score_all()
    return sent


def test_team_looks_closer_at_what_it_sent_to_an_open_split(
    client: Client, open_split: Submission, teammate: User, stranger: User
) -> None:
    address = f"/submissions/{open_split.pk}/analysis/"
    client.force_login(teammate)
    assert "is being made" in get(client, address).one("main").text
    builders.infer_all()
    root = get(client, address)
    assert [figure.attributes["data-chart"] for figure in root.all("figure")] == [
        "curve",
        "histogram",
        "scatter",
    ]
    assert all(figure.one("tbody").all("tr") for figure in root.all("figure"))
    worst = [float(row.all("td")[1].text) for row in root.all("table")[-1].one("tbody").all("tr")]
    assert worst == sorted(worst, reverse=True)
    assert address in client.get(f"/submissions/{open_split.pk}/").content.decode()
    client.force_login(stranger)
    assert client.get(address).status_code == 404


def test_hidden_split_has_no_closer_look(client: Client, open_split: Submission, owner: User) -> None:
    builders.infer_all()
    Split.objects.filter(pk="val").update(is_hidden=True)
    client.force_login(owner)
    assert client.get(f"/submissions/{open_split.pk}/analysis/").status_code == 404
    assert "analysis" not in client.get(f"/submissions/{open_split.pk}/").content.decode()


def test_rejected_file_has_no_closer_look(client: Client, open_split: Submission, owner: User) -> None:
    sent = builders.submit(owner, b"{}", split="val", method="Broken")
    builders.score_all()
    client.force_login(owner)
    assert client.get(f"/submissions/{sent.pk}/analysis/").status_code == 404
