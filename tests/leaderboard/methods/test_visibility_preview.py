"""A team's program gets what everybody would see of a method, before it shows the method."""

import json
from typing import Any

import pytest
from django.test import Client

from leaderboard.models import Edition, Method, User, Visibility
from tests import builders
from tests.leaderboard.methods.test_visibility import SECRETS, change

BOARD = "/api/v1/splits/test/board"


def preview_of(client: Client, method: Method, token: str, query: str) -> tuple[int, dict[str, Any]]:
    response = client.get(
        f"/api/v1/methods/{method.pk}/visibility{query}", headers={"Authorization": f"Bearer {token}"}
    )
    return response.status_code, response.json()


@pytest.mark.slow
@pytest.mark.parametrize("to", ["ANONYMOUS", "PUBLIC"])
def test_program_previews_what_everybody_then_sees(
    client: Client, method: Method, owner: User, to: str
) -> None:
    edition = Edition.objects.get()
    for name, shown_as in (("Hidden too", "PRIVATE"), ("Shown", "PUBLIC")):
        builders.submit(owner, builders.predictions(edition, factor=1.5), method=name, visibility=shown_as)
    builders.score_all()
    token, anybody = builders.token(owner), Client()
    before = {row["method"]: row["rank"] for row in anybody.get(BOARD).json()["entries"]}
    status, preview = preview_of(client, method, token, f"?as={to}")
    assert (status, preview["visibility"]) == (200, to)
    method.refresh_from_db()
    assert method.visibility == Visibility.PRIVATE
    assert {row["method"]: row["rank"] for row in anybody.get(BOARD).json()["entries"]} == before

    change(method, to, owner)
    shown = {row["method"]: row for row in anybody.get(BOARD).json()["entries"]}
    (board,) = preview["splits"]
    assert (board["split"], board["edition"], board["n_ranked"], board["before"]) == ("test", 1, 7, None)
    assert board["after"] == shown[preview["name"]]
    assert board["n_attempts_before"] == 1
    assert board["after"]["n_attempts"] == (2 if to == "PUBLIC" else 1)
    moved = {row["method"]: (row["rank_before"], row["rank_after"]) for row in board["moved"]}
    assert moved == {name: (rank, shown[name]["rank"]) for name, rank in before.items()}
    assert len(moved) == 6
    document = anybody.get(f"/api/v1/methods/{method.pk}").json()
    fields = ("name", "team", "description", "paper_url", "code_url", "details")
    assert {name: preview[name] for name in fields} == {name: document[name] for name in fields}
    hidden = [secret for secret in SECRETS if secret in json.dumps(preview)]
    assert (hidden == []) == (to == "ANONYMOUS")


def test_revealing_an_anonymous_method_moves_nobody(client: Client, method: Method, owner: User) -> None:
    change(method, "ANONYMOUS", owner)
    (board,) = preview_of(client, method, builders.token(owner), "?as=PUBLIC")[1]["splits"]
    assert (board["before"]["method"], board["after"]["method"]) == (method.pseudonym, "Secret sauce")
    assert (board["before"]["rank"], board["after"]["rank"], board["moved"]) == (1, 1, [])


def test_what_a_method_cannot_become_has_no_preview(client: Client, method: Method, owner: User) -> None:
    token = builders.token(owner)
    for query in ("", "?as=", "?as=PRIVATE", "?as=public"):
        status, answer = preview_of(client, method, token, query)
        assert (status, answer["code"], answer["problems"][0]["where"]) == (400, "bad-visibility", "as")
    change(method, "PUBLIC", owner)
    status, answer = preview_of(client, method, token, "?as=ANONYMOUS")
    assert (status, answer["code"]) == (422, "shown-for-good")
