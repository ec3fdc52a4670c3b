"""`manage.py create_token`."""

from io import StringIO

import pytest
from django.core.management import CommandError, call_command
from rest_framework.test import APIClient

from leaderboard.models import AuditEvent, User


def create_token(email: str) -> tuple[str, str]:
    out, err = StringIO(), StringIO()
    call_command("create_token", email, "--name", "nightly CI", stdout=out, stderr=err)
    return out.getvalue().strip(), err.getvalue()


def test_token_stands_alone_on_standard_output_and_opens_the_api(owner: User) -> None:
    token, said = create_token("Owner@example.org")
    response = APIClient().get("/api/v1/submissions", HTTP_AUTHORIZATION=f"Bearer {token}")
    assert response.status_code == 200
    assert "only time the token is shown" in said
    assert token not in said
    assert AuditEvent.objects.get(verb="created", noun="ApiToken").details == {"name": "nightly CI"}


def test_address_without_an_account_gets_one_without_a_password(db: None) -> None:
    _, said = create_token("ci@example.org")
    assert "No account had ci@example.org; made one" in said
    assert not User.objects.get(email="ci@example.org").has_usable_password()


def test_what_is_no_address_is_refused(db: None) -> None:
    with pytest.raises(CommandError, match="'nobody' is no e-mail address"):
        create_token("nobody")
