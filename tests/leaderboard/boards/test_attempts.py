"""The number of attempts next to a row: those of its team that the row may reveal."""

from typing import Any

import pytest
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone

from leaderboard.boards import listing
from leaderboard.boards.rows import Entry
from leaderboard.methods import visibility
from leaderboard.models import Edition, Method, Split, User
from tests import builders

pytestmark = pytest.mark.slow

ANYBODY = AnonymousUser()


def rows(viewer: Any = ANYBODY) -> dict[str, Entry]:
    split = Split.objects.select_related("current_edition__ground_truth").get(pk="test")
    return {entry.method: entry for entry in listing.board(split=split, viewer=viewer).entries}


def test_attempts_are_those_of_what_the_team_shows_and_of_an_anonymous_method_its_own(
    edition: Edition, owner: User
) -> None:
    def send(name: str, shown: str, *factors: float) -> None:
        for factor in factors:
            data = builders.predictions(edition, factor=factor)
            builders.submit(owner, data, method=name, visibility=shown)

    send("Hidden", "PRIVATE", 1.1, 1.2, 1.3)
    send("Veiled", "ANONYMOUS", 1.4, 1.5)
    send("One", "PUBLIC", 1.6)
    send("Two", "PUBLIC", 1.7, 1.8)
    builders.submit(owner, b"{}", method="Two")
    builders.score_all()
    veiled = Method.objects.get(name="Veiled").pseudonym
    seen = {name: entry.n_attempts for name, entry in rows().items() if entry.kind == "submission"}
    assert seen == {veiled: 2, "One": 3, "Two": 3}
    assert rows(owner)["Hidden"].n_attempts == 3
    assert {entry.n_attempts for entry in rows().values() if entry.kind == "published"} == {None}
    hidden = Method.objects.get(name="Hidden")
    visibility.change(method=hidden, visibility="PUBLIC", actor=owner, now=timezone.now())
    assert {name: rows()[name].n_attempts for name in ("One", "Two", "Hidden")} == {
        "One": 6,
        "Two": 6,
        "Hidden": 6,
    }
