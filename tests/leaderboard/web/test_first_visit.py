"""What somebody's first look at a board costs them."""

import gzip
import re
from pathlib import Path

import pytest
from django.contrib.staticfiles import finders
from django.test import Client

from leaderboard.models import Edition, User
from tests import board_rows

pytestmark = pytest.mark.slow

MAX_BYTES = 100_000


def test_a_board_of_hundreds_and_all_that_it_loads_stay_below_100_kb(
    edition: Edition, owner: User, client: Client
) -> None:
    board_rows.fill(edition, n=300, user=owner)
    page = client.get("/board/test/", headers={"Accept-Encoding": "gzip"})
    text = gzip.decompress(page.content).decode()
    names = set(re.findall(r'(?:href|src)="/static/([^"]+)"', text))
    assert "site.css" in names
    files = {name: finders.find(re.sub(r"\.[0-9a-f]{12}(?=\.\w+$)", "", name)) for name in names}
    sizes = {name: len(gzip.compress(Path(str(path)).read_bytes())) for name, path in files.items()}
    assert len(page.content) + sum(sizes.values()) < MAX_BYTES, sizes
