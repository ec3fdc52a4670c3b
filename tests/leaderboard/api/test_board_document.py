"""A board as its serializer says it, and as it is read."""

import pytest
from django.test import Client

from leaderboard.boards import boards
from leaderboard.models import Edition, Method, User
from tests import board_rows

pytestmark = pytest.mark.slow

API = "/api/v1/splits/test/board"


@pytest.fixture
def filled(edition: Edition, owner: User) -> list[Method]:
    return board_rows.fill(edition, n=5, user=owner)


def test_a_reader_who_signs_in_is_told_the_etag_of_a_board(
    filled: list[Method], client: Client, owner: User
) -> None:
    client.force_login(owner)
    tag = client.get(API)["ETag"]
    assert client.get(API, headers={"If-None-Match": tag}).status_code == 304


def test_a_board_read_in_parts_is_the_board(
    filled: list[Method], edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = boards.public_rows(split=edition.split, edition=edition)
    for size in (1, 2, 5):
        monkeypatch.setattr("leaderboard.db.bulk.in_parts.__kwdefaults__", {"size": size})
        assert boards.public_rows(split=edition.split, edition=edition) == whole
