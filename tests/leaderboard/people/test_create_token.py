"""`manage.py create_token`."""

from datetime import timedelta
from io import StringIO

import pytest
from django.core.management import CommandError, call_command
from rest_framework.test import APIClient

from leaderboard import audit
from leaderboard.models import ApiToken, AuditEvent, User


def create_token(email: str, *options: str) -> tuple[str, str]:
    out, err = StringIO(), StringIO()
    call_command("create_token", email, "--name", "nightly CI", *options, stdout=out, stderr=err)
    return out.getvalue().strip(), err.getvalue()


def test_token_stands_alone_on_standard_output_and_opens_the_api(owner: User) -> None:
    token, output = create_token("Owner@example.org")
    response = APIClient().get("/api/v1/submissions", HTTP_AUTHORIZATION=f"Bearer {token}")
    assert response.status_code == 200
    assert "token is shown only once" in output
    assert token not in output
    event = AuditEvent.objects.get(verb="created", noun="ApiToken")
    assert audit.names_in([event])[event.details["name"]] == "nightly CI"


def test_a_token_can_be_limited(owner: User, benchmark: None) -> None:
    _, output = create_token("owner@example.org", "--scope", "read", "--split", "val", "--days", "7")
    row = ApiToken.objects.get()
    assert (row.scopes, row.split_id) == (("read",), "val")
    assert row.expiry - row.created < timedelta(days=7, minutes=1)
    assert "It expires after 7 days." in output


@pytest.mark.parametrize(
    ("options", "message"),
    [(("--days", "366"), "expected 1 to 365"), (("--split", "nowhere"), "There is no split")],
)
def test_a_token_that_makes_no_sense_is_refused_and_makes_no_account(
    benchmark: None, options: tuple[str, str], message: str
) -> None:
    with pytest.raises(CommandError, match=message):
        create_token("new@example.org", *options)
    assert not User.objects.exists()


def test_address_without_an_account_gets_one_without_a_password(db: None) -> None:
    _, output = create_token("ci@example.org")
    assert "No account had ci@example.org; made one" in output
    assert not User.objects.get(email="ci@example.org").has_usable_password()
