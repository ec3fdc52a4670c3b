"""What is no token never reaches the database, at any address of the API, whatever it looks like."""

import pytest
from django.test import Client
from pytest_django import DjangoAssertNumQueries

from tests.security.matrix import LINES
from tests.security.people import ABSENT
from tests.security.routes import routes

MALFORMED = (
    "Bearer",
    "Bearer ",
    "Bearer x",
    "Bearer a b",
    "Bearer ' OR 1=1 --",
    "Bearer tsttc_",
    "Bearer tsttc_" + "0" * 63,
    "Bearer tsttc_" + "0" * 65,
    "Bearer tsttc_" + "A" * 64,
    "Bearer tsttc_" + "g" * 64,
    "Bearer TSTTC_" + "0" * 64,
    "Bearer tsttc_" + "0" * 64 + "\x00",
    "Bearer tsttc_" + "0" * 100_000,
    "Bearer " + "é" * 70,
    "Bearer \xff\xfe",
    "bearer tsttc_" + "٣" * 64,
)
VALUES = {"split": "test", "number": 1, "submission_id": ABSENT, "method_id": ABSENT, "team_id": ABSENT}
# They look at no token: a report of a leaked one, and a redirection.
BLIND = {"api-revoke-token", "api-docs", "api-root", "^api(/|$)"}


@pytest.mark.slow
@pytest.mark.parametrize("header", MALFORMED)
def test_no_address_asks_the_database_for_what_is_no_token(
    db: None, django_assert_num_queries: DjangoAssertNumQueries, header: str
) -> None:
    header = header.encode("utf-8", "surrogatepass").decode("latin-1")
    n_asked = 0
    for route in routes():
        if not route.is_api or route.name in BLIND or route.name not in LINES:
            continue
        values = VALUES | dict.fromkeys(route.parameters - set(VALUES), ABSENT)
        for method in LINES[route.name].answers:
            with django_assert_num_queries(0):
                client = Client(raise_request_exception=False)
                response = client.generic(method, route.filled(values), headers={"Authorization": header})
            assert response.status_code == 401, (route.name, method)
            assert response.headers["WWW-Authenticate"] == "Bearer"
            assert response.headers["Content-Type"] == "application/problem+json"
            assert response.json()["detail"]
            n_asked += 1
    assert n_asked > 10
