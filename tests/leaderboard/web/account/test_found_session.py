"""An open session that is found takes no account over: every door asks who acts."""

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.core import mail
from django.test import Client
from pytest_django import Settings

from leaderboard.models import ApiToken, Edition, Membership, User
from leaderboard.people import teams
from tests import builders
from tests.leaderboard.web.account.proving import code_in, confirm, proving
from tests.leaderboard.web.test_every_page import assert_sound

BY_PASSWORD, BY_CODE = "/accounts/reauthenticate/", "/accounts/reauthenticate/code/"
EMAIL = "/accounts/email/"
TOKEN: dict[str, object] = {"name": "CI", "scopes": ["read"], "split": "", "days": "365"}
# Each door, as it is posted by a session that nobody has confirmed.
DOORS: dict[str, tuple[str, dict[str, object]]] = {
    "add": (EMAIL, {"action_add": "", "email": "evil@example.org"}),
    "primary": (EMAIL, {"action_primary": "", "email": "second@example.org"}),
    "remove": (EMAIL, {"action_remove": "", "email": "second@example.org"}),
    "token": ("/tokens/", TOKEN),
    "app": ("/accounts/2fa/totp/activate/", {"code": "123456"}),
    "codes": ("/accounts/2fa/recovery-codes/generate/", {}),
    "delete": ("/account/data/", {"email": "owner@example.org"}),
}


@pytest.fixture(autouse=True)
def _proving(settings: Settings) -> None:
    proving(settings)


def account(user: User) -> Client:
    """Give the account two proved addresses and two providers; return an open session of it."""
    for email in (user.email, "second@example.org"):
        is_first = email == user.email
        EmailAddress.objects.create(user=user, email=email, verified=True, primary=is_first)
    for provider in ("github", "orcid"):
        SocialAccount.objects.create(user=user, provider=provider, uid="1")
    client = Client()
    client.force_login(user)
    return client


def state_of(user: User) -> tuple[object, ...]:
    user.refresh_from_db()
    return (
        (user.email, user.password, user.is_active),
        sorted(EmailAddress.objects.filter(user=user).values_list("email", "primary", "verified")),
        sorted(SocialAccount.objects.filter(user=user).values_list("provider", flat=True)),
        Authenticator.objects.filter(user=user).count(),
        ApiToken.objects.filter(user=user).count(),
    )


def knock(client: Client, door: str) -> str:
    """Post at this door; return where that leads."""
    path, fields = DOORS[door]
    return str(client.post(path, fields).headers.get("Location", ""))


@pytest.mark.parametrize("door", DOORS)
def test_every_door_asks_for_the_password(owner: User, benchmark: None, door: str) -> None:
    client = account(owner)
    before = state_of(owner)
    assert knock(client, door).startswith(BY_PASSWORD)
    assert state_of(owner) == before
    assert not mail.outbox


@pytest.mark.slow
@pytest.mark.parametrize("door", [*DOORS, "password"])
def test_every_door_asks_an_account_without_a_password_for_a_mailed_code(
    owner: User, benchmark: None, door: str
) -> None:
    owner.set_unusable_password()
    owner.save()
    client = account(owner)
    before = state_of(owner)
    if door == "password":
        word = "kestrel-altimeter-9"
        led = client.post("/accounts/password/set/", {"password1": word, "password2": word})
        assert led.headers["Location"].startswith(BY_CODE)
    else:
        assert knock(client, door).startswith(BY_CODE)
    assert state_of(owner) == before
    page = assert_sound(client.get(BY_CODE)).one("main").text
    assert owner.email in page
    [message] = mail.outbox
    assert message.to == [owner.email]
    code = code_in(message)
    assert "The code is wrong" in client.post(BY_CODE, {"code": "BBBB-BBBB"}).text
    assert state_of(owner) == before
    other = Client()
    other.force_login(owner)
    other.get(BY_CODE)
    assert "The code is wrong" in other.post(BY_CODE, {"code": code}).text, "a code is of one session"
    assert client.post(BY_CODE, {"code": code, "next": "/account/"}).status_code == 302
    assert not knock(client, "token").startswith(BY_CODE)


def test_the_interrupted_change_is_made_once_the_code_is_right(owner: User, benchmark: None) -> None:
    owner.set_unusable_password()
    owner.save()
    client = account(owner)
    led = client.post("/tokens/", TOKEN).headers["Location"]
    client.get(led)
    done = client.post(led, {"code": code_in(mail.outbox[-1]), "next": "/tokens/"})
    assert done.headers["Location"] == "/tokens/"
    assert ApiToken.objects.get(user=owner).name == "CI"
    assert client.post("/tokens/", TOKEN).headers["Location"] == "/tokens/"
    assert ApiToken.objects.filter(user=owner).count() == 2


@pytest.mark.slow
def test_a_code_is_good_for_three_tries(owner: User) -> None:
    owner.set_unusable_password()
    owner.save()
    client = account(owner)
    client.get(BY_CODE)
    code = code_in(mail.outbox[-1])
    for _ in range(3):
        page = client.post(BY_CODE, {"code": "BBBB-BBBB"})
    assert "no longer valid" in page.text
    assert "The code is wrong" in client.post(BY_CODE, {"code": code}).text
    client.post(BY_CODE, {"action": "resend"})
    again = code_in(mail.outbox[-1])
    assert client.post(BY_CODE, {"code": again, "next": "/account/"}).status_code == 302


@pytest.mark.slow
def test_the_password_opens_the_doors_for_some_minutes(owner: User, benchmark: None) -> None:
    client = account(owner)
    confirm(client)
    assert knock(client, "primary") == EMAIL
    assert knock(client, "token") == "/tokens/"
    session = client.session
    session["account_authentication_methods"] = [
        {**record, "at": record["at"] - 400} for record in session["account_authentication_methods"]
    ]
    session.save()
    assert knock(client, "remove").startswith(BY_PASSWORD)
    # Revoking a token takes nothing over.
    token = ApiToken.objects.get(user=owner)
    assert client.post("/tokens/revoke/", {"token": token.digest}).headers["Location"] == "/tokens/"


# --- the team, which no undo link gives back ----------------------------------------------------------------


def test_a_found_session_hands_no_team_over(owner: User, teammate: User, benchmark: None) -> None:
    path = f"/team/members/{teammate.membership.handle}/hand-over/"
    client = account(owner)
    assert client.post(path, {"confirm": "on"}).headers["Location"].startswith(BY_PASSWORD)
    assert Membership.objects.get(is_owner=True).user == owner
    confirm(client)
    assert client.post(path, {"confirm": "on"}).headers["Location"] == "/team/"
    assert Membership.objects.get(is_owner=True).user == teammate
    # Who may not anyway is told so, without a question.
    assert client.post(path, {"confirm": "on"}).status_code == 422


@pytest.mark.slow
def test_a_found_session_leaves_no_methods_to_nobody(owner: User, edition: Edition) -> None:
    builders.submit(owner, builders.predictions(edition))
    client = account(owner)
    assert client.post("/team/leave/", {"confirm": "on"}).headers["Location"].startswith(BY_PASSWORD)
    assert teams.current_team_of(user=owner) is not None
    confirm(client)
    assert client.post("/team/leave/", {"confirm": "on"}).headers["Location"] == "/team/"
    assert teams.current_team_of(user=owner) is None
