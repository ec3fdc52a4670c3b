"""A new password ends no token by itself: the form says so, and offers it."""

import pytest
from django.core import mail
from django.test import Client

from leaderboard.models import ApiToken, User
from tests import builders, pages
from tests.leaderboard.web.account.test_accounts import link_in
from tests.leaderboard.web.test_every_page import assert_sound

WORD = "kestrel-altimeter-9"
FIELDS = {"oldpassword": "correct horse", "password1": WORD, "password2": WORD}
CHANGE = "/accounts/password/change/"


@pytest.fixture
def two_tokens(owner: User) -> None:
    builders.token(owner)
    builders.token(owner)


def n_working() -> int:
    return ApiToken.objects.filter(revoked_at=None).count()


def test_a_changed_password_revokes_tokens_only_if_one_asks(signed_in: Client, two_tokens: None) -> None:
    box = pages.get(signed_in, CHANGE).one("input", name="revoke_tokens")
    assert "checked" not in box.attributes
    assert "Revoke 2 API tokens" in signed_in.get(CHANGE).text
    signed_in.post(CHANGE, FIELDS)
    assert n_working() == 2
    again = {**FIELDS, "oldpassword": WORD, "revoke_tokens": "on"}
    signed_in.post(CHANGE, again)
    assert n_working() == 0
    assert "revoke_tokens" not in signed_in.get(CHANGE).text, "there is none left"


def test_a_wrong_old_password_revokes_nothing(signed_in: Client, two_tokens: None) -> None:
    signed_in.post(CHANGE, {**FIELDS, "oldpassword": "wrong", "revoke_tokens": "on"})
    assert n_working() == 2


@pytest.mark.slow
def test_after_a_reset_the_box_is_ticked(client: Client, owner: User, two_tokens: None) -> None:
    client.post("/accounts/password/reset/", {"email": owner.email})
    form = client.get(link_in(mail.outbox[-1], "/accounts/password/reset/key/"), follow=True)
    box = assert_sound(form).one("input", name="revoke_tokens")
    assert "checked" in box.attributes
    path = form.redirect_chain[-1][0]
    client.post(path, {"password1": WORD, "password2": WORD, "revoke_tokens": "on"})
    assert n_working() == 0


@pytest.mark.parametrize("address", ["/accounts/signup/", CHANGE])
def test_a_form_for_a_new_password_says_once_what_it_must_be(signed_in: Client, address: str) -> None:
    asker = Client() if address == "/accounts/signup/" else signed_in
    form = pages.get(asker, address).one("main").one("form")
    (advice,) = form.all("div", id="id_password1_helptext")
    assert advice.text.startswith("At least 8 characters. Not a common password")
    assert form.one("input", name="password1").attributes["aria-describedby"] == "id_password1_helptext"


def test_who_has_no_tokens_is_not_asked(signed_in: Client) -> None:
    assert "revoke_tokens" not in signed_in.get(CHANGE).text
