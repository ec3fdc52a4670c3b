"""Requests that are built wrongly: what came, and what was expected."""

import pytest
from django.test import Client
from rest_framework.test import APIClient

from leaderboard.models import Edition, Submission, User
from tests import builders
from tests.leaderboard.api.test_problems import checked
from tests.leaderboard.api.test_submissions import client_of, post

SUBMISSIONS = "/api/v1/submissions"
HEADER = "expected the header 'Authorization: Bearer tsttc_…'."
FORM = "multipart/form-data; boundary=xyz"
FILE = 'name="file"; filename="p.json"'


def form(data: bytes, *, file: str = FILE) -> bytes:
    head = "".join(
        f'--xyz\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{value}\r\n'
        for name, value in (("split", "test"), ("method", "Foo"))
    )
    return (
        f"{head}--xyz\r\nContent-Disposition: form-data; {file}\r\n\r\n".encode() + data + b"\r\n--xyz--\r\n"
    )


@pytest.mark.parametrize(
    ("headers", "words"),
    [
        ({}, "The request has no token"),
        ({"HTTP_AUTHORIZATION": "Token {}"}, "begins with Token"),
        ({"HTTP_AUTHORIZATION": "token {}"}, "begins with token"),
        ({"HTTP_AUTHORIZATION": "{}"}, "does not begin with Bearer"),
        ({"HTTP_AUTHORIZATION": "Basic dXNlcjp0b2tlbg=="}, "begins with Basic"),
        ({"HTTP_AUTHORIZATION": "Bearer"}, "No token comes after Bearer"),
        ({"HTTP_AUTHORIZATION": "Bearer  "}, "No token comes after Bearer"),
        ({"HTTP_AUTHORIZATION": "Bearer {} {}"}, "The token contains spaces"),
        ({"HTTP_AUTHORIZATION": "Bearer: {}"}, "does not begin with Bearer"),
        ({"HTTP_X_API_KEY": "{}"}, "came in the header X-API-Key"),
        ({"HTTP_PRIVATE_TOKEN": "{}"}, "came in the header Private-Token"),
    ],
)
@pytest.mark.parametrize("path", ["/api/v1/account", SUBMISSIONS])
def test_a_token_in_another_form_is_answered_with_the_header_that_is_expected(
    owner: User, headers: dict[str, str], words: str, path: str
) -> None:
    secret = builders.token(owner)
    given = {name: value.replace("{}", secret) for name, value in headers.items()}
    detail = checked(APIClient().get(path, **given), 401, _code(given))["detail"]
    assert words in detail
    assert detail.endswith(HEADER)
    assert secret not in detail
    assert secret[6:20] not in detail


def _code(headers: dict[str, str]) -> str:
    is_bearer = headers.get("HTTP_AUTHORIZATION", "").lower().split()[:1] == ["bearer"]
    return "authentication-failed" if is_bearer else "not-authenticated"


def test_a_token_in_the_address_is_not_repeated(owner: User) -> None:
    secret = builders.token(owner)
    detail = checked(APIClient().get(f"/api/v1/account?token={secret}"), 401, "not-authenticated")["detail"]
    assert detail.startswith("The token came in the address")
    assert secret not in detail


@pytest.mark.parametrize("kind", ["application/json", "text/plain", "application/x-www-form-urlencoded"])
def test_another_kind_of_body_is_answered_with_the_kind_that_is_expected(owner: User, kind: str) -> None:
    response = client_of(owner).generic("POST", SUBMISSIONS, b"{}", content_type=kind)
    detail = checked(response, 415, "unsupported-media-type")["detail"]
    assert f"The body is {kind}; expected multipart/form-data." in detail
    assert "-F file=@FILE" in detail


def test_a_form_without_a_boundary_is_named(owner: User) -> None:
    response = client_of(owner).generic("POST", SUBMISSIONS, form(b"{}"), content_type="multipart/form-data")
    detail = checked(response, 400, "parse-error")["detail"]
    assert "no usable boundary; expected boundary=" in detail


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8, 0.99])
def test_a_form_that_is_cut_off_is_refused_as_such(edition: Edition, owner: User, share: float) -> None:
    whole = form(builders.predictions(edition))
    body = whole[: int(len(whole) * share)]
    response = client_of(owner).generic("POST", SUBMISSIONS, body, content_type=FORM)
    detail = checked(response, 400, "parse-error")["detail"]
    assert detail.startswith("The body ends before the last boundary of its form; expected ")
    assert not Submission.objects.exists()


@pytest.mark.parametrize("end", [b"", b"\r\n", b"epilogue"])
def test_a_whole_form_is_taken_whatever_comes_behind_it(edition: Edition, owner: User, end: bytes) -> None:
    body = form(builders.predictions(edition)).rstrip() + end
    response = client_of(owner).generic("POST", SUBMISSIONS, body, content_type=FORM)
    assert response.status_code == 201, response.content


def test_a_file_that_comes_as_a_text_is_named(edition: Edition, owner: User) -> None:
    body = form(builders.predictions(edition), file='name="file"')
    response = client_of(owner).generic("POST", SUBMISSIONS, body, content_type=FORM)
    detail = checked(response, 422, "no-file")["detail"]
    assert "is a text; expected a file" in detail
    assert "-F file=@FILE" in detail


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("/api/v1/submissions/", "/api/v1/submissions"),
        ("/api/v1/splits/test/board/", "/api/v1/splits/test/board"),
        ("/api/v1/splits//test/board", "/api/v1/splits/test/board"),
        ("/api/v1//submissions", "/api/v1/submissions"),
        ("/api/submissions", "/api/v1/submissions"),
        ("/api/v2/splits/test/board", "/api/v1/splits/test/board"),
    ],
)
@pytest.mark.parametrize("method", ["get", "post"])
def test_an_address_that_is_almost_one_names_it(db: None, path: str, meant: str, method: str) -> None:
    detail = checked(getattr(Client(), method)(path), 404, "not-found")["detail"]
    assert detail.endswith(f"; expected {meant}.")


def test_an_unknown_address_is_not_guessed(db: None) -> None:
    for path in ("/api/v1/nothing/", "/api/nothing", "/api/"):
        assert checked(Client().get(path), 404, "not-found")["detail"] == (
            "There is nothing at this address that you may see."
        )


def test_a_wrong_method_is_answered_with_those_that_are_possible(edition: Edition, owner: User) -> None:
    detail = checked(client_of(owner).put(SUBMISSIONS), 405, "method-not-allowed")["detail"]
    assert detail == "PUT is not possible at this address; expected GET or POST."
    detail = checked(client_of(owner).delete("/api/v1/splits"), 405, "method-not-allowed")["detail"]
    assert detail == "DELETE is not possible at this address; expected GET."


@pytest.mark.parametrize("accept", ["application/xml", "text/csv"])
def test_an_accept_header_that_cannot_be_met_is_repeated(edition: Edition, owner: User, accept: str) -> None:
    response = client_of(owner).get("/api/v1/splits", HTTP_ACCEPT=accept)
    detail = checked(response, 406, "not-acceptable")["detail"]
    assert f"The header Accept is '{accept}', but this address answers with application/json" in detail


@pytest.mark.parametrize("body", [b"{", b"name=Foo", b""])
def test_a_body_that_is_no_json_is_named(edition: Edition, owner: User, body: bytes) -> None:
    client = client_of(owner)
    method = post(client, builders.predictions(edition)).json()["method_id"]
    response = client.generic("PATCH", f"/api/v1/methods/{method}", body, content_type="application/json")
    if body:
        detail = checked(response, 400, "parse-error")["detail"]
        assert detail.startswith("The body cannot be read: ")
        assert detail.endswith("; expected JSON text.")
    else:
        assert response.status_code < 500
