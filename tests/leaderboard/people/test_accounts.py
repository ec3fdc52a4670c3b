"""No request writes rows of a closed or deleted account, even one that began before."""

from collections.abc import Callable

import pytest
from django.test import RequestFactory
from django.utils import timezone

from leaderboard.api import exceptions
from leaderboard.errors.refusals import Refused
from leaderboard.models import ApiToken, Edition, Membership, Submission, User
from leaderboard.people import invitations, teams, tokens
from tests import builders

VERBS: dict[str, Callable[[Edition, User, str], object]] = {
    "token": lambda edition, user, secret: tokens.create(user=user, name="CI", now=timezone.now()),
    "team": lambda edition, user, secret: teams.create(user=user, name="New", now=timezone.now()),
    "file": lambda edition, user, secret: builders.send(user, builders.predictions(edition)),
    "invitation": lambda edition, user, secret: invitations.accept(
        secret=secret, user=user, now=timezone.now()
    ),
}


@pytest.mark.parametrize("verb", VERBS)
def test_a_request_that_began_before_the_account_was_closed_writes_nothing(
    edition: Edition, owner: User, stranger: User, verb: str
) -> None:
    secret = invitations.make(team=teams.team_of(user=owner), actor=owner, now=timezone.now())[1]
    # What the request has read of its account says that it is open.
    User.objects.filter(pk=stranger.pk).update(is_active=False)
    with pytest.raises(Refused, match="This account is closed or deleted") as refused:
        VERBS[verb](edition, stranger, secret)
    answer = exceptions.exception_handler(refused.value, {"request": RequestFactory().get("/api/v1/")})
    assert answer is not None
    assert (answer.status_code, answer.data["code"]) == (401, "account-closed")
    for model in (ApiToken, Membership):
        assert not model.objects.filter(user=stranger).exists()
    assert not Submission.objects.exists()
