"""A window or a date that makes no sense is refused at every door, and stops nothing where it is there."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.db import IntegrityError, connection, transaction
from django.test import Client
from django.utils import timezone

from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, QuotaOverride, Split, User
from leaderboard.people import teams
from leaderboard.quotas import quotas, rules
from tests import builders, pages

pytestmark = pytest.mark.slow

NONE, DAY = timedelta(0), timedelta(days=1)
LONG = timedelta(days=99_999_999)
WINDOW = "expected whole seconds, more than 0 and at most 3,650 days."
GAP = "expected whole seconds, from 0 to 3,650 days."
BAD_SPANS = [
    ("quota_window", -DAY, f"The window is -1 day, 0:00:00; {WINDOW}"),
    ("quota_window", NONE, f"The window is 0:00:00; {WINDOW}"),
    ("quota_window", LONG, f"The window is 99999999 days, 0:00:00; {WINDOW}"),
    ("quota_min_gap", -DAY, f"The least time apart is -1 day, 0:00:00; {GAP}"),
    ("quota_min_gap", LONG, f"The least time apart is 99999999 days, 0:00:00; {GAP}"),
]
RULES: dict[str, Any] = {"limit": 50, "rejected_limit": 3}


@contextmanager
def unchecked() -> Iterator[None]:
    """SQLite as somebody has it who writes into it by hand."""
    with connection.cursor() as cursor:
        cursor.execute("PRAGMA ignore_check_constraints = ON")
        try:
            yield
        finally:
            cursor.execute("PRAGMA ignore_check_constraints = OFF")


@pytest.mark.parametrize(("field", "value", "sentence"), BAD_SPANS)
@pytest.mark.usefixtures("benchmark")
def test_model_verb_and_database_refuse_it_as_well(
    owner: User, field: str, value: timedelta, sentence: str
) -> None:
    split = Split.objects.get(pk="test")
    setattr(split, field, value)
    with pytest.raises(ValidationError) as found:
        split.full_clean()
    assert sentence in found.value.message_dict[field][0]
    with pytest.raises(IntegrityError), transaction.atomic():
        Split.objects.filter(pk="test").update(**{field: value})
    given = RULES | {field.removeprefix("quota_"): value}
    team = teams.team_of(user=owner)
    with pytest.raises(Refused) as refused:
        builders.override(team, **given)
    assert (sentence in str(refused.value), refused.value.field) == (True, field)
    assert not AuditEvent.objects.filter(verb="quota_overridden").exists()


@pytest.mark.usefixtures("benchmark")
def test_the_database_refuses_a_split_that_closes_before_it_opens() -> None:
    now = timezone.now()
    with pytest.raises(IntegrityError), transaction.atomic():
        Split.objects.filter(pk="test").update(opens_at=now, closes_at=now)
    Split.objects.filter(pk="test").update(opens_at=now, closes_at=now + DAY)


# --- one that is there all the same ------------------------------------------------------------------------


def assert_nothing_fails(client: Client, edition: Edition, *, by: User, maintainer: User) -> str:
    """Submit and ask everywhere. Returns what maintainers read of it."""
    client.force_login(by)
    for address in ("/submit/", "/api/v1/quota", "/board/test/", "/api/v1/splits"):
        assert client.get(address).status_code == 200, address
    builders.submit(by, builders.predictions(edition))
    client.force_login(maintainer)
    team = teams.team_of(user=by)
    for address in (f"/maintain/quotas/{team.pk}/", f"/maintain/quotas/{team.pk}/test/"):
        assert client.get(address).status_code == 200, address
    [ignored] = rules.ignored()
    for address in ("/maintain/", "/maintain/quotas/"):
        assert ignored in pages.page(client.get(address)).one("main").text
    return ignored


@pytest.mark.skipif(connection.vendor != "sqlite", reason="PostgreSQL's constraints cannot be bypassed")
@pytest.mark.parametrize("is_of_team", [True, False])
@pytest.mark.parametrize(("field", "value", "sentence"), BAD_SPANS)
def test_a_bad_rule_stops_nothing_and_the_one_behind_it_holds(
    edition: Edition,
    owner: User,
    maintainer: User,
    client: Client,
    field: str,
    value: timedelta,
    sentence: str,
    is_of_team: bool,
) -> None:
    team, split = teams.team_of(user=owner), Split.objects.get(pk="test")
    if is_of_team:
        builders.override(team, **RULES)
    rows = QuotaOverride.objects.all() if is_of_team else Split.objects.filter(pk="test")
    with unchecked():
        rows.update(**{field: value})
        said = assert_nothing_fails(client, edition, by=owner, maintainer=maintainer)
        held = rules.rules_of(team=team, split=Split.objects.get(pk="test"))
    whose = "Owls on test" if is_of_team else "test"
    assert said == f"The rules of {whose}: {sentence} This is ignored until you correct it."
    # Behind a team's rule stands the split's, behind that the one from the start.
    shipped = {"quota_window": 30 * DAY, "quota_min_gap": DAY}
    behind = getattr(split, field) if is_of_team else shipped[field]
    assert getattr(held, field.removeprefix("quota_")) == behind
    assert not is_of_team or (held.limit, held.rejected_limit) == (50, 3)


@pytest.mark.skipif(connection.vendor != "sqlite", reason="PostgreSQL's constraints cannot be bypassed")
def test_times_that_make_no_sense_stop_nothing_and_are_reported(
    edition: Edition, owner: User, maintainer: User, client: Client
) -> None:
    now: datetime = timezone.now()
    with unchecked():
        Split.objects.filter(pk="test").update(opens_at=now + 2 * DAY, closes_at=now + DAY)
        said = assert_nothing_fails(client, edition, by=owner, maintainer=maintainer)
    assert "expected to open before it closes. This is ignored until you correct it." in said


@pytest.mark.parametrize(
    ("span", "words"),
    [
        (-DAY, "-24 hours"),
        (NONE, "0 seconds"),
        (timedelta.min, "-999,999,999 days"),
        (timedelta(seconds=1, microseconds=1), "1 second"),
    ],
)
def test_every_span_can_be_said(span: timedelta, words: str) -> None:
    assert quotas.span(span) == words
