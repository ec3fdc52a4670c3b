"""An account that is deleted while its other requests run leaves no row, on PostgreSQL."""

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.db import connection
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from leaderboard.models import ApiToken, Edition, Invitation, Membership, Submission, User
from leaderboard.people import invitations, teams
from tests import builders
from tests.leaderboard.db.test_races import at_once
from tests.services import ON_POSTGRESQL

pytestmark = [pytest.mark.slow, *ON_POSTGRESQL]
N_ROUNDS = 12


def signed_in(user: User) -> Client:
    client = Client(raise_request_exception=False)
    client.force_login(user)
    # An open session alone deletes no account.
    client.post("/accounts/reauthenticate/", {"password": "correct horse", "next": "/account/data/"})
    return client


def requests_of(user: User, data: bytes, secret: str) -> list[tuple[Client, str, dict[str, object]]]:
    """What one person asks for at once: the deletion among two files, two tokens, a team and a link."""
    builders.token(user)
    file = {"split": "test", "note": "by ada"}
    paths: list[tuple[str, dict[str, object]]] = [
        ("/account/data/", {"email": user.email}),
        ("/tokens/", {"name": "CI", "days": "90", "scopes": ["read", "submit"], "split": ""}),
        ("/submit/", {**file, "method": "Foo", "file": SimpleUploadedFile("ada.json", data)}),
        (reverse("team"), {"name": f"Team of {user.pk}"}),
        (reverse("join_team", args=[secret]), {}),
        ("/tokens/", {"name": "CD", "days": "90", "scopes": ["read"], "split": ""}),
        ("/submit/", {**file, "method": "Bar", "file": SimpleUploadedFile("ada.json", data)}),
        (reverse("team"), {"name": f"Another team of {user.pk}"}),
        ("/tokens/", {"name": "CE", "days": "90", "scopes": ["read"], "split": ""}),
        (reverse("leave_team"), {"confirm": "on"}),
    ]
    return [(signed_in(user), path, fields) for path, fields in paths]


def test_nothing_of_a_deleted_account_is_left_whatever_it_did_meanwhile(
    edition: Edition, owner: User
) -> None:
    now, statuses, left = timezone.now(), [], []
    host = teams.team_of(user=owner)
    for number in range(N_ROUNDS):
        user = User.objects.create_user(f"{number}@example.org", "correct horse", name=f"N{number}")
        if number % 2:
            teams.team_of(user=user)
        secret = invitations.make(team=host, actor=owner, now=now)[1]
        asked = requests_of(user, builders.predictions(edition, factor=1 + number / 100), secret)
        # Each round lets another request be the first.
        asked = asked[number % len(asked) :] + asked[: number % len(asked)]

        def ask(number: int, asked: list[tuple[Client, str, dict[str, object]]] = asked) -> int:
            client, path, fields = asked[number]
            return int(client.post(path, fields).status_code)

        statuses += at_once(len(asked), ask)
        left += [
            *ApiToken.objects.filter(user=user),
            *Membership.objects.filter(user=user),
            *Invitation.objects.filter(created_by=user),
            *Submission.objects.filter(submitted_by=user).exclude(filename="", note=""),
        ]
        assert not User.objects.get(pk=user.pk).is_active
    assert connection.vendor == "postgresql"
    assert left == []
    assert [status for status in statuses if status >= 500] == []
