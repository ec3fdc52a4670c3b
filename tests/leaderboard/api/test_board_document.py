"""A board as its serializer says it, and as it is read."""

import pytest
from django.test import Client

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
