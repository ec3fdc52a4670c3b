"""Lists of the API: of what they are, and how long a page is."""

import itertools
from pathlib import Path

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Publication, User
from tests import board_rows, builders
from tests.leaderboard.api.test_submissions import client_of

CHANGELOG = "/api/v1/splits/{}/changelog"


@pytest.fixture
def two_splits(edition: Edition, tmp_path: Path) -> tuple[Edition, Edition]:
    """A published edition of each of two splits; the second has been published three times."""
    other = builders.import_truth(tmp_path, split="val")
    for number in range(2):
        Publication.objects.create(split_id="val", edition=other, at=timezone.now(), reason=f"Again {number}")
    return edition, other


def test_a_changelog_names_one_split_only_newest_first(
    two_splits: tuple[Edition, Edition], client: Client
) -> None:
    for edition in two_splits:
        rows = client.get(CHANGELOG.format(edition.split_id)).json()
        published = Publication.objects.filter(split=edition.split_id).order_by("-at")
        assert [row["reason"] for row in rows] == [row.reason for row in published]
    assert len(client.get(CHANGELOG.format("test")).json()) == 1
    assert client.get(CHANGELOG.format("nowhere")).status_code == 404


@pytest.mark.parametrize("limit", [1, 2, 3, 4])
def test_a_page_has_at_most_as_many_rows_as_are_asked_for_and_the_pages_together_all(
    two_splits: tuple[Edition, Edition], client: Client, limit: int
) -> None:
    pages, address = [], f"{CHANGELOG.format('val')}?limit={limit}"
    while address:
        answer = client.get(address)
        pages.append([row["reason"] for row in answer.json()])
        address = answer.headers.get("Link", "").partition(">")[0].removeprefix("<").partition("8000")[2]
    everything = list(
        Publication.objects.filter(split="val").order_by("-at").values_list("reason", flat=True)
    )
    assert list(itertools.chain(*pages)) == everything
    assert [len(page) for page in pages] == [limit] * (3 // limit) + ([3 % limit] if 3 % limit else [])


def test_submissions_of_a_list_are_those_of_ones_team_in_pages(
    edition: Edition, owner: User, stranger: User
) -> None:
    board_rows.fill(edition, n=1, user=stranger)
    own = [
        builders.send(owner, builders.predictions(edition, factor=1 + i / 10)).submission for i in (1, 2, 3)
    ]
    client = client_of(owner)
    first = client.get("/api/v1/submissions?limit=2")
    second = client.get(first.headers["Link"].partition(">")[0].removeprefix("<"))
    ids = [row["id"] for row in (*first.json(), *second.json())]
    assert (len(first.json()), len(second.json())) == (2, 1)
    assert ids == [str(row.pk) for row in reversed(own)]


def test_a_table_is_found_by_its_own_name_and_an_unknown_one_is_not(db: None, client: Client) -> None:
    names = [table["name"] for table in client.get("/api/v1/published").json()]
    assert len(names) > 1
    for name in names:
        assert client.get(f"/api/v1/published/{name}").json()["name"] == name
    assert client.get("/api/v1/published/nothing").status_code == 404
