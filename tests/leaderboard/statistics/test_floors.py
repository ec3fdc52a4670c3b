"""The floor of a board, what the ground truth itself scores: computed by workers, shown with the rows."""

import pytest
from django.test import Client

from evaluator import SCORE_NAMES, write_predictions
from leaderboard.models import Edition, Score, User
from leaderboard.storage import truth_values
from tests import builders, pages


def floor_of(edition: Edition) -> dict[str, float | None]:
    builders.infer_all()
    edition.refresh_from_db()
    assert edition.floor is not None
    return dict(edition.floor)


def test_the_floor_is_what_a_file_of_the_ground_truth_itself_scores(edition: Edition, owner: User) -> None:
    assert edition.floor is None
    floor = floor_of(edition)
    truth = truth_values.load(edition.ground_truth_id)
    builders.submit(owner, write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s), method="Oracle")
    builders.score_all()
    rows = Score.objects.values_list("metric", "ttc_range", "value")
    scored = {m if i == "overall" else f"{m}_{i}": value for m, i, value in rows}
    assert floor == {name: scored.get(name) for name in SCORE_NAMES}
    assert floor["mid"], "one sequence is at 25 s, where a prediction is truncated"
    assert floor["mid_small"] == 0


@pytest.mark.slow
def test_readers_see_the_floor_beside_the_rows_and_never_as_one(
    edition: Edition, owner: User, client: Client
) -> None:
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    address = "/api/v1/splits/test/board"
    assert client.get(address).json()["floor"] is None
    rows = pages.page(client.get("/board/test/")).one("table", class_="board").one("tbody").all("tr")
    floor = floor_of(edition)
    answer = client.get(address).json()
    assert answer["floor"] == floor
    assert all("ground truth" not in entry["method"] for entry in answer["entries"])
    root = pages.page(client.get("/board/test/"))
    assert len(root.one("table", class_="board").one("tbody").all("tr")) == len(rows)
    assert (
        f"Floor: the ground truth itself, submitted as predictions, scores MiD {floor['mid']:.1f}, RTE"
        in (root.one("details", class_="legend").text)
    )
