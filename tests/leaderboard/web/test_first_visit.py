"""What the first look at a board, or at the landing page, costs a visitor."""

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
# Of these a browser loads the one that suits its screen.
ONE_OF_THEM = re.compile(r"task/(?!wide-light)")


@pytest.mark.parametrize("address", ["/", "/board/test/"])
def test_a_page_over_a_board_of_hundreds_and_all_that_it_loads_stay_below_100_kb(
    edition: Edition, owner: User, client: Client, address: str
) -> None:
    board_rows.fill(edition, n=300, user=owner)
    page = client.get(address, headers={"Accept-Encoding": "gzip"})
    text = gzip.decompress(page.content).decode()
    names = set(re.findall(r'(?:href|src|srcset)="/static/([^"]+)"', text))
    assert "site.css" in names
    assert ("task/wide-light.svg" in names) == (address == "/")
    files = {name: finders.find(name) for name in names if not ONE_OF_THEM.match(name)}
    sizes = {name: len(gzip.compress(Path(str(path)).read_bytes())) for name, path in files.items()}
    assert len(page.content) + sum(sizes.values()) < MAX_BYTES, sizes
