"""Sessions: the database is asked for those alone that it may have."""

from datetime import timedelta

import pytest
from django.conf import settings
from django.contrib.sessions.models import Session
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from leaderboard.models import User
from leaderboard.upkeep import pollers

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


def test_the_cleaner_deletes_expired_sessions_alone(client: Client, owner: User) -> None:
    client.force_login(owner)
    gone = Client()
    gone.force_login(owner)
    key = gone.session.session_key
    Session.objects.filter(pk=key).update(expire_date=timezone.now() - timedelta(seconds=1))
    pollers.clean(now=timezone.now())
    assert not Session.objects.filter(pk=key).exists()
    assert client.get("/submissions/").status_code == 200
