"""Sessions: the database is asked for those alone that it may have."""

import pytest
from django.conf import settings
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext

from leaderboard.models import User

# Cookies may hold octal escapes within quotes, and PostgreSQL has no text with a NUL.
NO_KEYS = [
    r'"abcdefgh\000"',
    r'"' + "a" * 31 + r'\000"',
    r'"\377\376abcdefgh"',
    "A" * 32,
    "a" * 33,
    "a" * 5000,
]


@pytest.mark.parametrize("key", NO_KEYS)
@pytest.mark.parametrize("address", ["/docs/", "/submit/", "/api/v1/quota", "/accounts/login/", "/admin/"])
def test_a_cookie_that_nobody_was_given_never_reaches_the_database(
    benchmark: None, client: Client, address: str, key: str
) -> None:
    with CaptureQueriesContext(connection) as asked:
        answer = client.get(address, headers={"cookie": f"{settings.SESSION_COOKIE_NAME}={key}"})
    assert answer.status_code in {200, 302, 401}
    assert not [query["sql"] for query in asked if "django_session" in query["sql"]]


def test_a_session_goes_on_as_long_as_it_is(client: Client, owner: User) -> None:
    client.force_login(owner)
    assert client.get("/team/").status_code == 200
    assert len(client.cookies[settings.SESSION_COOKIE_NAME].value) == 32
    client.session.flush()
    assert client.get("/team/").status_code == 302
