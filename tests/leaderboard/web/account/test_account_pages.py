"""Sign up, sign in, reset the password."""

import re

import pytest
from allauth.account.models import EmailAddress
from django.core import mail
from django.http import HttpResponseBase
from django.test import Client
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, User
from tests import builders, pages

PASSWORD = "kestrel-altimeter-9"


def sign_up(client: Client, **fields: str) -> HttpResponseBase:
    form = {"email": "new@example.org", "password1": PASSWORD, "password2": PASSWORD, "name": "", **fields}
    return client.post("/accounts/signup/", form)


def test_sign_up_signs_in_and_goes_on_to_submitting(client: Client, edition: Edition) -> None:
    response = sign_up(client, name="  Lapwings ")
    assert response.status_code == 302
    assert response.headers["Location"] == "/submit/"
    assert User.objects.get(email="new@example.org").name == "Lapwings"
    message = pages.get(client, "/submit/").one("p", class_="message").text
    assert message.startswith("Your account is ready, and you are signed in. Next: send a prediction file")


def test_sign_up_on_the_way_to_another_page_suggests_nothing_else(client: Client, edition: Edition) -> None:
    response = sign_up(client, next="/docs/")
    assert response.headers["Location"] == "/docs/"
    message = pages.get(client, "/docs/").one("p", class_="message").text
    assert message == "Your account is ready, and you are signed in."


def test_sign_up_tells_of_all_that_is_wrong_at_once_and_of_each_rule_once(client: Client, db: None) -> None:
    form = {"email": "new@example.org", "name": "", "password1": "12345", "password2": "54321"}
    root = pages.page(client.post("/accounts/signup/", form))
    assert "too short" in root.one("div", id="id_password1_error").text
    assert root.one("div", id="id_password2_error").text == "You must type the same password each time."
    assert root.one("main").text.count("at least 8 characters") == 1
    assert root.one("input", class_="show-password").attributes["type"] == "checkbox"


@pytest.mark.slow
def test_account_begins_with_what_it_has_and_leads_to_each_part(signed_in: Client, owner: User) -> None:
    builders.token(owner)
    root = pages.get(signed_in, "/account/")
    parts = {
        row.one("th").text: (row.all("td")[0].text, link.attributes["href"])
        for row in root.one("tbody").all("tr")
        for link in row.all("a")
    }
    assert parts["Email"][0] == owner.email
    assert parts["API tokens"] == ("1 in use", "/tokens/")
    assert parts["Two-factor"][0] == "off"
    assert all(signed_in.get(address).status_code == 200 for _, address in parts.values())


def test_page_of_addresses_offers_only_what_applies(signed_in: Client, owner: User) -> None:
    def offered() -> list[str]:
        names = [
            button.attributes.get("name") for button in pages.get(signed_in, "/accounts/email/").all("button")
        ]
        return [name.removeprefix("action_") for name in names if name]

    first = EmailAddress.objects.create(user=owner, email=owner.email, verified=False, primary=True)
    assert offered() == ["send", "add"]
    EmailAddress.objects.filter(pk=first.pk).update(verified=True)
    assert offered() == ["add"]
    EmailAddress.objects.create(user=owner, email="second@example.org", verified=True)
    assert offered() == ["primary", "remove", "add"]


def test_page_of_addresses_says_what_an_unproved_one_lacks_where_it_lacks_it(
    signed_in: Client, owner: User, settings: Settings
) -> None:
    cost = "No notifications are sent to it."
    first = EmailAddress.objects.create(user=owner, email=owner.email, verified=False, primary=True)
    assert cost not in pages.get(signed_in, "/accounts/email/").text, "this site proves no addresses"
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    assert cost in pages.get(signed_in, "/accounts/email/").text
    EmailAddress.objects.filter(pk=first.pk).update(verified=True)
    assert cost not in pages.get(signed_in, "/accounts/email/").text


def test_forgotten_password_is_reset_by_a_link(client: Client, owner: User, benchmark: None) -> None:
    response = client.post("/accounts/password/reset/", {"email": owner.email}, follow=True)
    assert "Check your email" in pages.page(response).one("h1").text
    (message,) = mail.outbox
    link = re.search(r"https?://[^/]+(/accounts/password/reset/key/\S+)", str(message.body))
    assert link is not None
    form = client.get(link.group(1), follow=True)
    assert "new password" in pages.page(form).one("h1").text
    changed = client.post(
        form.redirect_chain[-1][0], {"password1": PASSWORD, "password2": PASSWORD}, follow=True
    )
    assert "changed" in pages.page(changed).one("h1").text
    assert client.login(email=owner.email, password=PASSWORD)


def test_reset_does_not_tell_which_addresses_are_known(client: Client, owner: User, benchmark: None) -> None:
    known, unknown = (
        client.post("/accounts/password/reset/", {"email": email}, follow=True)
        for email in (owner.email, "nobody@example.org")
    )
    assert pages.page(known).one("main").text == pages.page(unknown).one("main").text


def test_used_link_is_refused_in_plain_words(client: Client, benchmark: None) -> None:
    root = pages.page(client.get("/accounts/password/reset/key/1-nonsense/", follow=True))
    assert root.one("h1").text == "The link is no longer valid"


@pytest.mark.parametrize("name", ["a\u202eb", "Anonymous", "…", "x" * 81])
def test_name_that_would_deceive_is_refused_in_words(client: Client, db: None, name: str) -> None:
    response = sign_up(client, name=name)
    assert response.status_code in {200, 422}
    assert not User.objects.exists()
    text = pages.page(response).one("main").text
    assert "name" in text or "at most 80 characters" in text, text
