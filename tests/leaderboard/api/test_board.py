"""The API's splits, boards and manifests: for everybody."""

import pytest
from django.test import Client

from leaderboard.models import Edition, User
from tests import builders


@pytest.mark.slow
def test_board_has_its_shape(edition: Edition, owner: User, client: Client) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.0000001))
    builders.score_all()
    body = client.get("/api/v1/splits/test/board").json()
    assert (body["split"], body["edition"], body["protocol"]) == ("test", 1, "tsttc-1")
    assert body["updated_at"]
    mine, published = body["entries"][:2]
    assert (mine["rank"], mine["method"], mine["team"], mine["kind"]) == (1, "Foo", "Owls", "submission")
    assert (published["rank"], published["method"], published["kind"]) == (2, "Deep Scale", "published")
    assert published["scores"] == {
        "mid": 14.8,
        "mid_crucial": 27.6,
        "mid_small": 15.6,
        "mid_large": 11.5,
        "mid_negative": 13.7,
        "rte": 12.3,
        "rte_crucial": 6.5,
        "rte_small": 8.8,
        "rte_large": 13.1,
        "rte_negative": 15.0,
    }
    assert set(mine) == set(published)


def test_board_of_a_closed_split_has_its_published_rows(benchmark: None, client: Client) -> None:
    body = client.get("/api/v1/splits/val/board").json()
    assert (body["edition"], body["is_open"], len(body["entries"])) == (None, False, 5)


@pytest.mark.parametrize(
    ("address", "status", "code"),
    [
        ("/api/v1/splits/test/board?sort=colour", 400, "unknown-column"),
        ("/api/v1/splits/nope/board", 404, "not-found"),
        ("/api/v1/splits/nope/manifest", 404, "not-found"),
        ("/api/v1/splits/val/manifest", 404, "no-ground-truth"),
        ("/api/v1/splits/val/manifest?edition=1", 404, "not-found"),
        ("/api/v1/splits/val/croissant", 404, "no-ground-truth"),
        ("/api/v1/splits/test%00/board", 404, None),
    ],
)
def test_bad_address_is_a_problem(
    benchmark: None, client: Client, address: str, status: int, code: str
) -> None:
    response = client.get(address)
    assert response.status_code == status
    if code:
        assert response.headers["Content-Type"] == "application/problem+json"
        assert response.json()["code"] == code


def test_manifest_is_public_and_has_no_time_to_contact(edition: Edition, client: Client) -> None:
    response = client.get("/api/v1/splits/test/manifest")
    text = response.getvalue().decode()
    assert response.headers["Content-Type"] == "text/csv"
    assert 'filename="tsttc-test-manifest.csv"' in response.headers["Content-Disposition"]
    assert text.splitlines()[0] == "anno_id,bag_stamp,cam_id,ts,track_id"


def test_splits_say_what_is_open(edition: Edition, client: Client) -> None:
    rows = {row["split"]: row for row in client.get("/api/v1/splits").json()}
    assert (rows["test"]["is_open"], rows["test"]["edition"], rows["test"]["n_sequences"]) == (True, 1, 120)
    assert (rows["val"]["is_open"], rows["val"]["edition"], rows["val"]["n_sequences"]) == (False, None, None)
