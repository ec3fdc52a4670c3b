"""`leaderboard.db.repeated`: the ORM's SQL, made once, gives what the ORM gives."""

import uuid
from typing import Any

import pytest
from django.db import connection
from django.db.models import QuerySet

from leaderboard.db import repeated
from leaderboard.models import Edition, Evaluation, User
from tests import builders

pytestmark = pytest.mark.django_db


def of_one(pk: uuid.UUID, *, statuses: frozenset[str]) -> QuerySet[Evaluation, tuple[Any, ...]]:
    found = Evaluation.objects.filter(pk=pk, status__in=statuses)
    return found.values_list("pk", "edition__split", "attempt", "queued_at", "lease_token")


def with_json(pk: uuid.UUID) -> QuerySet[Evaluation, tuple[Any, ...]]:
    return Evaluation.objects.filter(pk=pk).values_list("pk", "report")


def test_rows_are_those_of_the_orm_whatever_is_asked_for(edition: Edition, owner: User) -> None:
    for _ in range(2):
        builders.submit(owner, builders.predictions(edition))
    known = [pk for (pk,) in Evaluation.objects.values_list("pk")]
    for pk in [*known, uuid.uuid4()]:
        for statuses in (frozenset({"QUEUED"}), frozenset({"SCORED"}), frozenset[str]()):
            expected = list(of_one(pk, statuses=statuses))
            assert repeated.rows(of_one, of=pk, statuses=statuses) == expected


def test_only_what_differs_is_a_parameter_so_that_an_index_of_a_status_serves() -> None:
    if connection.vendor == "postgresql":
        sql, n_parameters = repeated._made(of_one, (("statuses", frozenset({"QUEUED"})),))
        assert n_parameters == sql.count("%s") == 1
        assert "IN ('QUEUED')" in sql


def test_a_column_that_needs_converting_is_refused(edition: Edition) -> None:
    if connection.vendor != "postgresql":
        assert repeated.rows(with_json, of=uuid.uuid4()) == []
        return
    with pytest.raises(TypeError, match="converting"):
        repeated.rows(with_json, of=uuid.uuid4())
