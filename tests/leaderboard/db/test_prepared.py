"""`leaderboard.db.prepared`: PostgreSQL keeps the statements of every submission, and no others."""

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from leaderboard.db import prepared
from leaderboard.models import Split

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("benchmark")]

NAMES = "SELECT name FROM leaderboard_split WHERE name = %s"
KEPT = "SELECT count(*) FROM pg_prepared_statements WHERE statement LIKE %s"


def asked(name: str) -> list[tuple[str]]:
    with prepared.cursor() as cursor:
        cursor.execute(NAMES, [name])
        return list(cursor.fetchall())


def test_a_statement_is_kept_once_and_answers_each_parameter() -> None:
    assert [asked(name) for name in ("test", "no such", "val")] == [[("test",)], [], [("val",)]]
    if connection.vendor != "postgresql":
        return
    Split.objects.filter(name="test").count()
    with connection.cursor() as cursor:
        cursor.execute(KEPT, ["SELECT name FROM leaderboard_split%"])
        assert cursor.fetchone() == (1,)
        cursor.execute(KEPT, ["SELECT COUNT(*)%"])
        assert cursor.fetchone() == (0,), "the ORM's own statements have their values in them"


def test_whoever_counts_statements_counts_these() -> None:
    with CaptureQueriesContext(connection) as captured:
        asked("test")
    assert len(captured) == 1
