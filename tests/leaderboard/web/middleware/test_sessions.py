"""Sessions: the database is asked for those alone that it may have."""

import pytest
from django.conf import settings
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext

# Cookies may hold octal escapes within quotes, and PostgreSQL has no text with a NUL.
NO_KEYS = [r'"' + "a" * 31 + r'\000"', r'"\377\376abcdefgh"', "A" * 32, "a" * 5000]


@pytest.mark.parametrize("key", NO_KEYS)
@pytest.mark.parametrize("address", ["/submit/", "/api/v1/quota"])
def test_a_cookie_that_nobody_was_given_never_reaches_the_database(
    benchmark: None, client: Client, address: str, key: str
) -> None:
    with CaptureQueriesContext(connection) as asked:
        answer = client.get(address, headers={"cookie": f"{settings.SESSION_COOKIE_NAME}={key}"})
    assert answer.status_code in {200, 302, 401}
    assert not [query["sql"] for query in asked if "django_session" in query["sql"]]
