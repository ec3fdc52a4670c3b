"""What everybody would see of a method, told to its team's programs before they show it."""

import json
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard import visibility
from leaderboard.models import Edition, Method, User, Visibility
from tests import builders

BOARD = "/api/v1/splits/test/board"
SECRETS = ("Owls", "Secret sauce", "Words of its own", "secret-paper", "Laptop of Ada")


@pytest.fixture
def method(edition: Edition, owner: User) -> Method:
    """A private one that is better than everything printed."""
    builders.submit(
        owner,
        builders.predictions(edition, factor=1.0000001),
        method="Secret sauce",
        visibility="PRIVATE",
        description="Words of its own",
        paper_url="https://example.org/secret-paper",
    )
    Method.objects.update(n_frames=6, latency_ms=12.5, hardware="Laptop of Ada")
    builders.score_all()
    return Method.objects.get()


def change(method: Method, to: str, actor: User) -> None:
    visibility.change(method=method, visibility=to, actor=actor, now=timezone.now())


def foresee(client: Client, method: Method, token: str, query: str) -> tuple[int, dict[str, Any]]:
    response = client.get(
        f"/api/v1/methods/{method.pk}/visibility{query}", headers={"Authorization": f"Bearer {token}"}
    )
    return response.status_code, response.json()


@pytest.mark.parametrize("to", ["ANONYMOUS", "PUBLIC"])
def test_program_foresees_what_everybody_then_sees(
    client: Client, method: Method, owner: User, to: str
) -> None:
    token, anybody = builders.token(owner), Client()
    before = {row["method"]: row["rank"] for row in anybody.get(BOARD).json()["entries"]}
    status, foreseen = foresee(client, method, token, f"?as={to}")
    assert (status, foreseen["visibility"]) == (200, to)
    assert Method.objects.get().visibility == Visibility.PRIVATE
    assert {row["method"]: row["rank"] for row in anybody.get(BOARD).json()["entries"]} == before

    change(method, to, owner)
    shown = {row["method"]: row for row in anybody.get(BOARD).json()["entries"]}
    (sight,) = foreseen["splits"]
    assert (sight["split"], sight["edition"], sight["n_ranked"], sight["before"]) == ("test", 1, 6, None)
    assert sight["after"] == shown[foreseen["name"]]
    moved = {row["method"]: (row["rank_before"], row["rank_after"]) for row in sight["moved"]}
    assert moved == {name: (rank, shown[name]["rank"]) for name, rank in before.items()}
    assert len(moved) == 5
    told = anybody.get(f"/api/v1/methods/{method.pk}").json()
    said = ("name", "team", "description", "paper_url", "code_url", "details")
    assert {name: foreseen[name] for name in said} == {name: told[name] for name in said}
    hidden = [secret for secret in SECRETS if secret in json.dumps(foreseen)]
    assert (hidden == []) == (to == "ANONYMOUS")


def test_revealing_an_anonymous_method_moves_nobody(client: Client, method: Method, owner: User) -> None:
    change(method, "ANONYMOUS", owner)
    (sight,) = foresee(client, method, builders.token(owner), "?as=PUBLIC")[1]["splits"]
    assert (sight["before"]["method"], sight["after"]["method"]) == (method.pseudonym, "Secret sauce")
    assert (sight["before"]["rank"], sight["after"]["rank"], sight["moved"]) == (1, 1, [])


def test_numbers_of_the_preview_have_the_editions_decimals(
    client: Client, method: Method, owner: User
) -> None:
    (sight,) = foresee(client, method, builders.token(owner), "?as=PUBLIC")[1]["splits"]
    values = [value for value in sight["after"]["scores"].values() if value is not None]
    assert len(values) == 10
    assert values == [round(value, 1) for value in values]


def test_the_preview_is_the_teams_alone(
    client: Client, method: Method, teammate: User, stranger: User, maintainer: User
) -> None:
    for user, expected in ((teammate, 200), (stranger, 404), (maintainer, 404)):
        assert foresee(client, method, builders.token(user), "?as=PUBLIC")[0] == expected
    assert client.get(f"/api/v1/methods/{method.pk}/visibility?as=PUBLIC").status_code == 401
    assert foresee(client, method, builders.token(teammate, split_name="test"), "?as=PUBLIC")[0] == 403


def test_what_a_method_cannot_become_is_not_foreseen(client: Client, method: Method, owner: User) -> None:
    token = builders.token(owner)
    for query in ("", "?as=", "?as=PRIVATE", "?as=public"):
        status, told = foresee(client, method, token, query)
        assert (status, told["code"], told["problems"][0]["where"]) == (400, "bad-visibility", "as")
    change(method, "PUBLIC", owner)
    status, told = foresee(client, method, token, "?as=ANONYMOUS")
    assert (status, told["code"]) == (422, "shown-for-good")
