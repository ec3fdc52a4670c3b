"""A window or a date that makes no sense is refused by the model, the verb and the database."""

from datetime import timedelta
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.utils import timezone

from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Split, User
from leaderboard.people import teams
from tests import builders

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


@pytest.mark.parametrize(("field", "value", "sentence"), BAD_SPANS)
@pytest.mark.usefixtures("benchmark")
def test_model_verb_and_database_refuse_it_as_well(
    owner: User, field: str, value: timedelta, sentence: str
) -> None:
    split = Split.objects.get(pk="test")
    setattr(split, field, value)
    with pytest.raises(ValidationError) as invalid:
        split.full_clean()
    assert sentence in invalid.value.message_dict[field][0]
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
