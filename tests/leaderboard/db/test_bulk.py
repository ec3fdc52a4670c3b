"""`bulk`: many rows at once are stored as the ORM stores one."""

import uuid

import pytest
from django.db import DataError, IntegrityError, connection, transaction
from django.utils import timezone
from pytest_django import DjangoAssertNumQueries

from leaderboard.db import bulk
from leaderboard.models import Edition, Evaluation, Method, Score, Status, Submission, Team, User
from tests.leaderboard.web.maintain import queue_rows


@pytest.fixture
def submissions(edition: Edition, owner: User) -> list[Submission]:
    """Three submissions of whose evaluations nothing is known yet."""
    made = [queue_rows.queued(edition, owner).submission for _ in range(3)]
    Evaluation.objects.all().delete()
    return made


def test_inserted_rows_are_what_the_orm_would_have_made(
    edition: Edition, submissions: list[Submission]
) -> None:
    at = timezone.now()
    rows = [(submission.pk, edition.pk, at) for submission in submissions]
    bulk.insert(Evaluation, ["submission", "edition", "queued_at"], rows)
    found = list(Evaluation.objects.select_related("submission"))
    assert {evaluation.submission for evaluation in found} == set(submissions)
    assert len({evaluation.pk for evaluation in found}) == 3
    for evaluation in found:
        plain = Evaluation(submission=evaluation.submission, edition=edition)
        assert evaluation.queued_at == at
        assert (evaluation.status, evaluation.priority) == (plain.status, plain.priority)
        assert (evaluation.problems, evaluation.last_error, evaluation.lease_token) == ([], "", None)


def test_conflicting_rows_are_left_out_only_when_asked(
    edition: Edition, submissions: list[Submission]
) -> None:
    rows = [(submission.pk, edition.pk) for submission in submissions]
    bulk.insert(Evaluation, ["submission", "edition"], rows[:1])
    first = Evaluation.objects.get()
    with pytest.raises(IntegrityError), transaction.atomic():
        bulk.insert(Evaluation, ["submission", "edition"], rows)
    bulk.insert(Evaluation, ["submission", "edition"], rows, ignore_conflicts=True)
    assert Evaluation.objects.count() == 3
    assert Evaluation.objects.get(submission=submissions[0]) == first


def test_updated_rows_hold_numbers_texts_and_json_to_the_bit(
    edition: Edition, submissions: list[Submission]
) -> None:
    bulk.insert(Evaluation, ["submission", "edition"], [(s.pk, edition.pk) for s in submissions])
    first, second, untouched = Evaluation.objects.order_by("pk")
    report = {"counts": {"overall": 3}, "words": 'a "quoted", {braced} \\ and ünïcode, %s'}
    problems = [{"code": "nan", "message": "It's NaN.", "where": ""}]
    bulk.update(
        Evaluation,
        ["report", "problems", "n_problems", "last_error"],
        [(report, [], 0, "", first.pk), (None, problems, 7, "it's, {odd}", second.pk)],
    )
    first.refresh_from_db()
    second.refresh_from_db()
    untouched.refresh_from_db()
    assert (first.report, first.problems, first.n_problems) == (report, [], 0)
    assert (second.report, second.problems, second.n_problems) == (None, problems, 7)
    assert second.last_error == "it's, {odd}"
    assert (untouched.report, untouched.n_problems) == (None, 0)


def test_every_float_is_kept_exactly(edition: Edition, submissions: list[Submission]) -> None:
    bulk.insert(Evaluation, ["submission", "edition"], [(submissions[0].pk, edition.pk)])
    evaluation = Evaluation.objects.get()
    values = [0.0, 0.1 + 0.2, 14.296, 5e-324, 123456.789012345678]
    bulk.insert(
        Score,
        ["evaluation", "metric", "interval", "value"],
        [(evaluation.pk, "mid", str(number), value) for number, value in enumerate(values)],
    )
    assert list(Score.objects.order_by("interval").values_list("value", flat=True)) == values
    assert set(Score.objects.values_list("low", flat=True)) == {None}


def test_constraints_of_the_database_hold_for_many_rows_as_for_one(
    edition: Edition, submissions: list[Submission]
) -> None:
    bulk.insert(Evaluation, ["submission", "edition"], [(submissions[0].pk, edition.pk)])
    evaluation = Evaluation.objects.get()
    columns = ["evaluation", "metric", "interval", "value"]
    with pytest.raises(IntegrityError), transaction.atomic():
        bulk.insert(Score, columns, [(evaluation.pk, "mid", "overall", -1.0)])
    with pytest.raises(IntegrityError), transaction.atomic():
        bulk.insert(
            Evaluation, ["submission", "edition", "status"], [(submissions[1].pk, edition.pk, Status.RUNNING)]
        )
    if connection.vendor == "postgresql":
        with pytest.raises(DataError), transaction.atomic():
            bulk.insert(
                Score, columns, [(evaluation.pk, "longer than thirty-two characters", "overall", 1.0)]
            )


def test_no_rows_are_no_statement(
    edition: Edition, django_assert_num_queries: DjangoAssertNumQueries
) -> None:
    with django_assert_num_queries(0):
        bulk.insert(Method, ["team", "name"], [])
        bulk.update(Team, ["name"], [])


def test_a_key_that_no_row_has_changes_nothing(edition: Edition, owner: User) -> None:
    before = list(Team.objects.values_list("pk", "name"))
    bulk.update(Team, ["name"], [("Nobody", uuid.uuid4())])
    assert list(Team.objects.values_list("pk", "name")) == before
