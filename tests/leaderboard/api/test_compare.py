"""Comparisons over the API: what is known at once, the rest a moment later."""

import pytest

from evaluator.metrics.protocol import SCORE_NAMES
from leaderboard.models import Edition, Submission, User
from tests import builders
from tests.leaderboard.api.test_submissions import client_of

pytestmark = [pytest.mark.usefixtures("open_values")]


def address(*methods: object, split: str = "test", more: str = "") -> str:
    named = "".join(f"&m={method}" for method in methods)
    return f"/api/v1/compare?split={split}{named}{more}"


@pytest.mark.slow
def test_comparison_is_a_202_until_a_worker_has_computed_it(entries: list[Submission], owner: User) -> None:
    client = client_of(owner)
    ids = [str(entry.method_id) for entry in entries[:3]]
    first = client.get(address(*ids))
    body = first.json()
    assert (first.status_code, body["is_complete"]) == (202, False)
    assert int(first.headers["Retry-After"]) >= 1
    assert [pair["differences"] for pair in body["pairs"]] == [None] * 3
    builders.infer_all()
    then = client.get(address(*ids))
    body = then.json()
    assert (then.status_code, body["is_complete"], "Retry-After" in then.headers) == (200, True, False)
    assert [entry["method_id"] for entry in body["entries"]] == ids
    assert [(pair["first"], pair["second"]) for pair in body["pairs"]] == [
        (ids[0], ids[1]),
        (ids[0], ids[2]),
        (ids[1], ids[2]),
    ]
    for pair in body["pairs"]:
        assert list(pair["differences"]) == list(SCORE_NAMES)
        mid = pair["differences"]["mid"]
        assert mid["low"] <= mid["difference"] <= mid["high"]
        assert "The MiD of" in pair["sentence"]
        is_undecided = mid["detectable_difference"] is not None
        assert is_undecided == ("with about 80% power" in pair["sentence"]) == (not mid["is_significant"])
        names = {entry["method_id"]: entry["method"] for entry in body["entries"]}
        for name, difference in pair["differences"].items():
            if difference is not None:
                assert f" of {names[pair['first']]} is " in difference["sentence"], name
                assert (" on small" in difference["sentence"]) == name.endswith("_small"), name
        assert pair["differences"]["mid"]["sentence"] == pair["sentence"]
    assert client.get(address(*ids, more="&edition=1")).json() == body


@pytest.mark.parametrize(
    ("methods", "more", "status", "code"),
    [
        ([], "", 400, "bad-comparison"),
        (["same", "same"], "", 400, "bad-comparison"),
        (["x", "y"], "", 404, "unknown-method"),
        (["first", "second"], "&edition=x", 400, "bad-edition"),
        (["first", "second"], "&edition=9", 404, "not-found"),
    ],
)
def test_what_cannot_be_compared_is_a_problem_that_says_why(
    edition: Edition, owner: User, methods: list[str], more: str, status: int, code: str
) -> None:
    response = client_of(owner).get(
        address(*(str(edition.ground_truth_id) if m == "x" else _id(m) for m in methods), more=more)
    )
    assert (response.status_code, response.json()["code"]) == (status, code)


def _id(name: str) -> str:
    return f"00000000-0000-4000-8000-{sum(name.encode()):012d}"
