"""The API's submissions: the fields that CI jobs rely on."""

import json
from datetime import timedelta
from pathlib import Path

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone
from rest_framework.test import APIClient

from evaluator.metrics.protocol import SCORE_NAMES
from evaluator.problems import pointer
from leaderboard.models import Edition, Method, Split, Submission, User
from tests import builders


def client_of(user: User | None = None) -> APIClient:
    """A client with a fresh token of that person, or with none."""
    client = APIClient()
    if user is not None:
        client.credentials(HTTP_AUTHORIZATION=f"Bearer {builders.token(user)}")
    return client


def post(client: APIClient, data: bytes, **fields: str):
    form = {"split": "test", "method": "Foo", **fields, "file": SimpleUploadedFile("p.json", data)}
    return client.post("/api/v1/submissions", form, format="multipart")


def test_submit_is_answered_201_with_id_state_and_address(edition: Edition, owner: User) -> None:
    response = post(client_of(owner), builders.predictions(edition), commit="abc123")
    body = response.json()
    assert response.status_code == 201
    assert body["state"] == "QUEUED"
    assert (body["split"], body["method"], body["team"]) == ("test", "Foo", "Owls")
    assert body["commit"] == "abc123"
    assert body["scores"] is None
    assert body["queue"]["ahead"] == 0
    assert response.headers["Location"].endswith(f"/api/v1/submissions/{body['id']}")
    assert body["url"].endswith(f"/submissions/{body['id']}/")
    assert Submission.objects.get(pk=body["id"]).via == "API"


@pytest.mark.slow
def test_scored_submission_has_the_ten_scores_and_counts(edition: Edition, owner: User) -> None:
    client = client_of(owner)
    submitted = post(client, builders.predictions(edition)).json()
    builders.score_all()
    body = client.get(f"/api/v1/submissions/{submitted['id']}").json()
    assert body["state"] == "SCORED"
    assert list(body["scores"]) == list(SCORE_NAMES)
    assert body["counts"]["overall"] == builders.N_SEQUENCES
    assert body["problems"] == []
    assert body["queue"] is None


def test_rejected_submission_lists_problems_with_code_message_and_where(
    edition: Edition, owner: User
) -> None:
    client = client_of(owner)
    good = json.loads(builders.predictions(edition))
    key = next(iter(good))
    submitted = post(client, json.dumps({**good, key: "x"}).encode()).json()
    builders.score_all()
    body = client.get(f"/api/v1/submissions/{submitted['id']}").json()
    assert body["state"] == "REJECTED"
    assert body["scores"] is None
    [problem] = body["problems"]
    assert set(problem) == {"code", "message", "where"}
    assert (problem["code"], problem["where"]) == ("not-a-number", pointer(key))


@pytest.mark.slow
def test_list_has_the_teams_submissions_newest_first(edition: Edition, owner: User, teammate: User) -> None:
    ids = [post(client_of(owner), builders.predictions(edition, factor=f)).json()["id"] for f in (1.1, 1.2)]
    listed = client_of(teammate).get("/api/v1/submissions").json()
    assert [row["id"] for row in listed] == ids[::-1]


@pytest.mark.parametrize(
    ("fields", "status", "code", "where"),
    [
        ({"split": "te\x00st"}, 422, "unknown-split", "split"),
        ({"split": "val"}, 409, "split-not-open", "split"),
        ({"paper_url": "javascript:alert(1)"}, 422, "bad-address", "paper_url"),
    ],
)
def test_refusal_is_a_problem_that_names_its_field(
    edition: Edition, owner: User, fields: dict[str, str], status: int, code: str, where: str
) -> None:
    response = post(client_of(owner), builders.predictions(edition), **fields)
    body = response.json()
    assert response.status_code == status
    assert response.headers["Content-Type"] == "application/problem+json"
    assert (body["code"], body["problems"][0]["where"], body["status"]) == (code, where, status)
    assert body["detail"] == body["problems"][0]["message"]


@pytest.mark.slow
def test_method_is_named_by_name_or_by_id(edition: Edition, owner: User, stranger: User) -> None:
    client = client_of(owner)
    first = post(client, builders.predictions(edition)).json()
    again = post(client, builders.predictions(edition, factor=1.2), method=first["method_id"])
    assert (again.status_code, again.json()["method"]) == (201, "Foo")
    others = post(client_of(stranger), builders.predictions(edition), method=first["method_id"])
    assert (others.status_code, others.json()["code"]) == (422, "unknown-method")
    assert Method.objects.count() == 1


def test_the_same_bytes_are_one_submission_and_cost_nothing_again(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="test").update(quota_limit=1)
    client, data = client_of(owner), builders.predictions(edition)
    first, again = post(client, data), post(client, data, note="sent again")
    assert (first.status_code, again.status_code) == (201, 200)
    assert (first.json()["id"], first.headers["Location"]) == (again.json()["id"], again.headers["Location"])
    assert again.json()["quota"]


@pytest.mark.slow
@pytest.mark.parametrize("change", ["deadline", "archived", "admission", "quota"])
def test_the_same_bytes_are_answered_with_the_first_submission_when_nothing_more_is_taken(
    signed_in: Client, edition: Edition, owner: User, teammate: User, change: str
) -> None:
    data = builders.predictions(edition)
    clients = [client_of(owner), client_of(teammate)]
    first = post(clients[0], data).json()
    past = timezone.now() - timedelta(seconds=1)
    changes = {
        "deadline": {"closes_at": past},
        "archived": {"listing": "ARCHIVED"},
        "admission": {"needs_admission": True},
        "quota": {"quota_limit": 1},
    }
    Split.objects.filter(pk="test").update(**changes[change])
    for client in clients:
        again = post(client, data)
        assert (again.status_code, again.json()["id"]) == (200, first["id"])
        for other in ({"data": builders.predictions(edition, factor=1.2)}, {"data": data, "method": "Bar"}):
            assert post(client, **other).status_code in {403, 409, 429}
    page = signed_in.post(
        "/submit/", {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data)}
    )
    assert (page.status_code, page.headers["Location"]) == (302, f"/submissions/{first['id']}/")
    assert Submission.objects.count() == 1


@pytest.mark.slow
def test_a_closed_split_answers_only_the_team_and_method_that_sent_the_file_there(
    edition: Edition, owner: User, stranger: User, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val")
    data, clients = builders.predictions(edition), [client_of(owner), client_of(stranger)]
    first = post(clients[0], data).json()
    on_val = post(clients[1], data, split="val").json()
    Split.objects.update(closes_at=timezone.now() - timedelta(seconds=1))
    again = [[post(client, data, split=split) for split in ("test", "val")] for client in clients]
    assert [[answer.status_code for answer in row] for row in again] == [[200, 409], [409, 200]]
    assert (again[0][0].json()["id"], again[1][1].json()["id"]) == (first["id"], on_val["id"])
    assert Submission.objects.count() == 2


@pytest.mark.parametrize("name", ["file", "split", "method", "note", "commit", "paper_url", "unknown"])
@pytest.mark.parametrize("kind", ["texts", "files", "both"])
def test_a_field_that_comes_twice_is_refused_by_name(
    edition: Edition, owner: User, name: str, kind: str
) -> None:
    data = builders.predictions(edition)
    twice = {
        "texts": ["a", "b"],
        "files": [SimpleUploadedFile("a", data), SimpleUploadedFile("b", data)],
        "both": ["a", SimpleUploadedFile("b", data)],
    }
    form = {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data), name: twice[kind]}
    response = client_of(owner).post("/api/v1/submissions", form, format="multipart")
    [problem] = response.json()["problems"]
    assert (response.status_code, problem["code"], problem["where"]) == (422, "doubled-field", name)
    assert f"has the field '{name}' 2 times; expected it once" in problem["message"]
    assert not Submission.objects.exists()


@pytest.mark.parametrize("body", ['{"name": "A", "name": "B"}', '{"note": {"a": 1, "a": 1}, "name": "B"}'])
def test_a_json_body_that_names_a_field_twice_changes_nothing(
    edition: Edition, owner: User, body: str
) -> None:
    client = client_of(owner)
    method = post(client, builders.predictions(edition)).json()["method_id"]
    response = client.patch(f"/api/v1/methods/{method}", body, content_type="application/json")
    assert (response.status_code, response.json()["code"]) == (422, "doubled-field")
    assert Method.objects.get().name == "Foo"
