"""Signing in with ORCID and GitHub: whom it lets in, whom it does not, and what goes wrong over there."""

import base64
import sys
from collections.abc import Iterator
from hashlib import sha256
from types import ModuleType
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount, SocialToken
from django.contrib.sessions.models import Session
from django.core import mail
from django.http import HttpResponse
from django.test import Client
from django.urls import include, path
from django.utils import timezone
from pytest_django import Settings

from leaderboard import urls
from leaderboard.models import User
from leaderboard.moderation import forgetting
from leaderboard.ops import environment
from leaderboard.web.account import providers
from leaderboard.web.middleware import middleware_order
from tests.leaderboard.web.account.oauth_server import CODE, HANGS, IID, TOKEN, Provider, lead_to, running
from tests.leaderboard.web.account.proving import code_in, proving
from tests.leaderboard.web.test_every_page import assert_sound

PASSWORD = "correct horse"
NEW = "new@example.org"
BY_CODE = "/accounts/reauthenticate/code/"
SEEN = [(NEW, True, True)]


@pytest.fixture(scope="module")
def server() -> Iterator[Provider]:
    with running() as provider:
        yield provider


@pytest.fixture
def provider(server: Provider, db: None, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Provider:
    """The site with both providers, and addresses that have to be proved."""
    monkeypatch.setenv("TSTTC_ORCID_CLIENT_ID", "APP-1")
    monkeypatch.setenv("TSTTC_ORCID_CLIENT_SECRET", "orcid-secret")
    monkeypatch.setenv("TSTTC_GITHUB_CLIENT_ID", "Iv1")
    monkeypatch.setenv("TSTTC_GITHUB_CLIENT_SECRET", "github-secret")
    settings.SOCIALACCOUNT_PROVIDERS = environment.providers(
        orcid=("ORCID", "TSTTC_ORCID_CLIENT_ID", "TSTTC_ORCID_CLIENT_SECRET"),
        github=("GitHub", "TSTTC_GITHUB_CLIENT_ID", "TSTTC_GITHUB_CLIENT_SECRET"),
    )
    settings.CONTENT_SECURITY_POLICY = middleware_order.content_security_policy(
        settings.SOCIALACCOUNT_PROVIDERS
    )
    proving(settings)
    addresses = ModuleType("urls_with_providers")
    addresses.urlpatterns = [*urls.urlpatterns, path("accounts/", include(providers.patterns()))]  # type: ignore[attr-defined]
    addresses.handler400, addresses.handler500 = urls.handler400, urls.handler500  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, addresses.__name__, addresses)
    settings.ROOT_URLCONF = addresses.__name__
    lead_to(monkeypatch, server)
    server.github(emails=SEEN)
    server.sent.clear()
    return server


def begin(client: Client, name: str = "github", **sends: str) -> str:
    """Press the button; returns the state with which the provider sends the browser back."""
    answer = client.post(f"/accounts/{name}/login/", {"process": "login", **sends})
    target = urlsplit(answer.headers["Location"])
    assert target.netloc == {"github": "github.com", "orcid": "orcid.org"}[name]
    return parse_qs(target.query)["state"][0]


def come_back(client: Client, name: str = "github", **asked: str) -> Any:
    return client.get(f"/accounts/{name}/login/callback/?{urlencode(asked)}")


def arrive(client: Client, name: str = "github", **sends: str) -> Any:
    """The whole way: the button, the provider, back here."""
    return come_back(client, name, code=CODE, state=begin(client, name, **sends))


def is_in(client: Client) -> bool:
    return client.get("/submissions/").status_code == 200


def connected(user: User, *, number: str = "42", verified: bool = True) -> SocialAccount:
    EmailAddress.objects.get_or_create(
        user=user, email=user.email, defaults={"verified": verified, "primary": True}
    )
    return SocialAccount.objects.create(user=user, provider="github", uid=number)


# --- nothing where nothing is set ------------------------------------------------------------------------


@pytest.mark.slow
def test_without_a_client_nothing_is_shown_or_routed(client: Client, owner: User) -> None:
    assert "GitHub" not in client.get("/accounts/login/").text
    assert client.get("/accounts/login/").headers["Content-Security-Policy"].count("https://") == 0
    client.force_login(owner)
    assert "Connected accounts" not in client.get("/accounts/email/").text
    for address in ("3rdparty/", "github/login/", "orcid/login/", "github/login/callback/", "social/signup/"):
        assert client.get(f"/accounts/{address}").status_code == 404


def test_half_a_client_is_a_fault_of_the_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "FAULTS", [])
    monkeypatch.setenv("TSTTC_ORCID_CLIENT_ID", "APP-1")
    assert environment.providers(orcid=("ORCID", "TSTTC_ORCID_CLIENT_ID", "TSTTC_ORCID_CLIENT_SECRET")) == {}
    assert environment.FAULTS == [
        "TSTTC_ORCID_CLIENT_SECRET is not set, and TSTTC_ORCID_CLIENT_ID is; expected both or none."
    ]


# --- signing up and in -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_verified_address_makes_an_account_that_signs_in_again(provider: Provider, client: Client) -> None:
    page = client.get("/accounts/login/?next=/team/")
    assert_sound(page)
    for host in ("https://orcid.org", "https://github.com"):
        assert host in page.headers["Content-Security-Policy"].partition("form-action")[2].partition(";")[0]
    assert "Sign in with ORCID" in page.text
    assert_sound(client.get("/accounts/github/login/"))
    asked = arrive(client, next="/team/")
    assert asked.headers["Location"] == "/accounts/3rdparty/signup/"
    assert provider.sent[0][1]["client_secret"] == ["github-secret"]
    form = assert_sound(client.get("/accounts/3rdparty/signup/"))
    assert form.one("input", name="email").attributes["value"] == NEW
    assert TOKEN not in str([row.get_decoded() for row in Session.objects.all()])
    made = client.post("/accounts/3rdparty/signup/", {"email": NEW, "name": "Owls"})
    assert made.headers["Location"] == "/team/"
    user = User.objects.get(email=NEW)
    assert (user.name, user.has_usable_password()) == ("Owls", False)
    assert list(EmailAddress.objects.values_list("email", "verified", "primary")) == [(NEW, True, True)]
    account = SocialAccount.objects.get()
    assert (account.uid, account.extra_data) == ("42", {"login": "owl"})
    assert not SocialToken.objects.exists()

    again = Client()
    assert arrive(again).headers["Location"] == "/submissions/"
    assert is_in(again)
    # Without a password the account cannot be cut off from its only way in; with one it can.
    refused = again.post("/accounts/3rdparty/", {"account": account.pk})
    assert "set a password first" in refused.text
    assert again.get("/accounts/password/change/").headers["Location"] == "/accounts/password/set/"
    asks = again.get("/accounts/password/set/").headers["Location"]
    assert asks.startswith(BY_CODE), "an open session alone sets no password"
    assert_sound(again.get(asks))
    again.post(BY_CODE, {"code": code_in(mail.outbox[-1]), "next": "/account/"})
    assert_sound(again.get("/accounts/password/set/"))


@pytest.mark.slow
def test_without_a_password_a_mailed_code_is_asked_for_before_providers_change(
    provider: Provider, owner: User
) -> None:
    owner.set_unusable_password()
    owner.save()
    EmailAddress.objects.create(user=owner, email=owner.email, verified=True, primary=True)
    kept = SocialAccount.objects.create(user=owner, provider="orcid", uid=IID)
    client = Client()
    client.force_login(owner)
    asks = arrive(client, process="connect")
    asks = client.get(asks.headers["Location"]) if "code" not in asks.headers["Location"] else asks
    assert asks.headers["Location"].startswith(BY_CODE)
    assert list(SocialAccount.objects.filter(user=owner)) == [kept]
    client.get(BY_CODE)
    client.post(BY_CODE, {"code": code_in(mail.outbox[-1])})
    assert SocialAccount.objects.filter(user=owner).count() == 2
    browser = Client()
    browser.force_login(owner)
    refused = browser.post("/accounts/3rdparty/", {"account": kept.pk})
    assert refused.headers["Location"].startswith(BY_CODE)
    assert SocialAccount.objects.filter(user=owner).count() == 2


@pytest.mark.slow
def test_orcid_tells_the_id_and_an_address_is_proved_by_mail(provider: Provider, client: Client) -> None:
    provider.orcid(emails=[("unproved@example.org", False, True)])
    assert arrive(client, "orcid").headers["Location"] == "/accounts/3rdparty/signup/"
    form = assert_sound(client.get("/accounts/3rdparty/signup/"))
    assert form.one("input", name="email").attributes.get("value", "") == ""
    sent = client.post("/accounts/3rdparty/signup/", {"email": "typed@example.org", "name": ""})
    assert sent.headers["Location"] == "/accounts/confirm-email/"
    assert not is_in(client)
    assert [message.to for message in mail.outbox] == [["typed@example.org"]]
    account = SocialAccount.objects.get()
    assert (account.provider, account.uid, account.extra_data) == ("orcid", IID, {})
    assert not EmailAddress.objects.get().verified


@pytest.mark.slow
def test_another_address_than_the_verified_one_is_proved_by_mail(provider: Provider, client: Client) -> None:
    arrive(client)
    client.post("/accounts/3rdparty/signup/", {"email": "typed@example.org", "name": ""})
    assert not is_in(client)
    assert list(EmailAddress.objects.values_list("email", "verified")) == [("typed@example.org", False)]


def test_a_second_factor_is_asked_for_whichever_way_one_comes(provider: Provider, owner: User) -> None:
    connected(owner)
    Authenticator.objects.create(user=owner, type="totp", data={"secret": "A" * 32})
    client = Client()
    assert arrive(client).headers["Location"] == "/accounts/2fa/authenticate/"
    assert not is_in(client)


def test_a_code_is_exchanged_with_what_this_sign_in_alone_has(provider: Provider, client: Client) -> None:
    sent = client.post("/accounts/github/login/", {"process": "login"})
    asked = parse_qs(urlsplit(sent.headers["Location"]).query)
    assert asked["code_challenge_method"] == ["S256"]
    come_back(client, code=CODE, state=asked["state"][0])
    (verifier,) = provider.sent[0][1]["code_verifier"]
    assert verifier not in sent.headers["Location"]
    digest = base64.urlsafe_b64encode(sha256(verifier.encode()).digest())
    assert asked["code_challenge"] == [digest.decode().rstrip("=")]


# --- nobody takes an account over ------------------------------------------------------------------------


@pytest.mark.parametrize("is_verified_here", [True, False])
def test_an_address_that_has_an_account_opens_nothing(
    provider: Provider, owner: User, is_verified_here: bool
) -> None:
    EmailAddress.objects.create(user=owner, email=owner.email, verified=is_verified_here, primary=True)
    # The owner has been in it.
    User.objects.filter(pk=owner.pk).update(last_login=timezone.now())
    provider.github(emails=[(owner.email.upper(), True, True)])
    client = Client()
    response = arrive(client)
    assert response.status_code == 409
    assert "This address has an account" in assert_sound(response).text
    assert not is_in(client)
    assert not SocialAccount.objects.exists()
    owner.refresh_from_db()
    assert owner.check_password(PASSWORD)


@pytest.mark.slow
def test_an_address_that_nobody_proved_here_is_its_owners(provider: Provider, client: Client) -> None:
    squatter = User.objects.create_user(NEW, PASSWORD)
    EmailAddress.objects.create(user=squatter, email=NEW, verified=False, primary=True)
    arrive(client)
    made = client.post("/accounts/3rdparty/signup/", {"email": NEW, "name": "Owls"})
    assert made.status_code == 302
    assert is_in(client)
    row = EmailAddress.objects.get(email=NEW)
    assert (row.verified, row.user.name) == (True, "Owls")
    assert SocialAccount.objects.get().user == row.user
    assert User.objects.filter(email=NEW).count() == 1


@pytest.mark.parametrize("verified", [False, "true"])
def test_an_address_that_the_provider_has_not_verified_counts_for_nothing(
    provider: Provider, owner: User, verified: Any
) -> None:
    provider.github(emails=[(owner.email, verified, True)])
    client = Client()
    assert arrive(client).headers["Location"] == "/accounts/3rdparty/signup/"
    # Who types the address learns nothing either: its owner gets a mail, as at any sign-up.
    sent = client.post("/accounts/3rdparty/signup/", {"email": owner.email, "name": ""})
    assert sent.headers["Location"] == "/accounts/confirm-email/"
    assert mail.outbox[0].subject.endswith("You already have an account")
    assert not SocialAccount.objects.exists()


@pytest.mark.slow
def test_connecting_needs_a_sign_in_and_the_password_once_more(provider: Provider, owner: User) -> None:
    provider.github(emails=[(owner.email, True, True)])
    client = Client()
    assert arrive(client, process="connect").headers["Location"] == "/accounts/3rdparty/"
    assert not SocialAccount.objects.exists()
    client.post("/accounts/login/", {"login": owner.email, "password": PASSWORD})
    EmailAddress.objects.filter(user=owner).update(verified=True)
    if not is_in(client):
        client.force_login(owner)
    assert_sound(client.get("/accounts/3rdparty/"))
    assert arrive(client, process="connect").headers["Location"] == "/accounts/reauthenticate/"
    assert not SocialAccount.objects.exists()
    client.post("/accounts/reauthenticate/", {"password": PASSWORD})
    assert SocialAccount.objects.get().user == owner
    assert "GitHub: owl" in assert_sound(client.get("/accounts/3rdparty/")).text
    exported = forgetting.export(user=owner)["connected_accounts"]
    assert [(row["provider"], row["id"], row["said"]) for row in exported] == [
        ("github", "42", {"login": "owl"})
    ]
    client.post("/accounts/3rdparty/", {"account": SocialAccount.objects.get().pk})
    assert not SocialAccount.objects.exists()


def test_a_closed_account_stays_closed_and_a_forgotten_person_is_unknown(
    provider: Provider, owner: User
) -> None:
    connected(owner)
    User.objects.filter(pk=owner.pk).update(is_active=False)
    client = Client()
    assert arrive(client).headers["Location"] == "/accounts/inactive/"
    assert not is_in(client)
    forgetting.forget(user=owner, reason="asked", actor=owner, now=timezone.now())
    assert not SocialAccount.objects.exists()


# --- what goes wrong over there --------------------------------------------------------------------------


def assert_refused(answer: HttpResponse, sentence: str) -> None:
    assert answer.status_code == 401
    assert sentence in assert_sound(answer).text
    assert not SocialAccount.objects.exists()
    assert "secret" not in answer.text


RECORD = f"/v3.0/{IID}/record"
MALFORMED: tuple[tuple[str, str, Any], ...] = (
    ("github", "/login/oauth/access_token", (200, b"{")),
    ("github", "/login/oauth/access_token", {"error": "bad_verification_code"}),
    ("github", "/login/oauth/access_token", {"access_token": "x", "expires_in": 10**30}),
    ("github", "/user", {"id": "9" * 300}),
    ("github", "/user/emails", [1]),
    ("github", "/user/emails", [{"email": 5, "primary": True, "verified": True}]),
    ("orcid", "/oauth/token", {"access_token": "x"}),
    ("orcid", RECORD, [[]]),
    ("orcid", RECORD, {"orcid-identifier": {"path": IID}, "person": {"emails": {"email": [3]}}}),
)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "path", "answer"), MALFORMED, ids=[str(n) for n in range(len(MALFORMED))])
def test_a_malformed_answer_ends_in_a_sentence(
    provider: Provider, db: None, name: str, path: str, answer: Any
) -> None:
    if name == "orcid":
        provider.orcid()
    provider.answers[path] = answer
    assert_refused(arrive(Client(), name), "was not understood")


@pytest.mark.slow
def test_a_provider_that_fails_or_hangs_ends_in_a_sentence(
    provider: Provider, db: None, settings: Settings
) -> None:
    settings.SOCIALACCOUNT_REQUESTS_TIMEOUT = 0.2
    provider.answers["/user"] = (503, b"down")
    assert_refused(arrive(Client()), "The fault is not yours")
    provider.answers["/user"] = HANGS
    assert_refused(arrive(Client()), "GitHub did not answer in time.")


@pytest.mark.slow
def test_who_says_no_or_comes_from_nowhere_gets_a_reason(
    provider: Provider, client: Client, db: None
) -> None:
    denied = come_back(client, error="access_denied", state=begin(client))
    assert denied.headers["Location"] == "/accounts/3rdparty/login/cancelled/"
    assert "You cancelled" in assert_sound(client.get(denied.headers["Location"])).text
    assert_refused(
        come_back(client, error="server_error", state=begin(client)), "GitHub refused the sign-in."
    )
    state = begin(client)
    for asked in ({}, {"code": CODE}, {"code": CODE, "state": "x" * 5000}, {"state": state, "code": "\x00"}):
        assert come_back(client, **asked).status_code in {302, 401}
    # A state is good once, in the browser that began.
    assert_refused(come_back(client, code=CODE, state=state), "Start the sign-in again.")
    assert_refused(come_back(Client(), code=CODE, state=begin(client)), "Start the sign-in again.")
    assert assert_sound(client.get("/accounts/3rdparty/signup/", follow=True))
    assert client.get("/accounts/3rdparty/login/error/").status_code == 401
