"""The second factor: who has one needs it, who must have one is led to it, who lost it gets help."""

import re
from io import StringIO
from types import SimpleNamespace

import pytest
from allauth.mfa.models import Authenticator
from allauth.mfa.totp.internal import auth
from django.core import mail
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils import timezone
from pytest_django import DjangoCaptureOnCommitCallbacks, Settings

from leaderboard.models import AuditEvent, Edition, Mail, User
from leaderboard.moderation import forgetting
from tests import builders
from tests.leaderboard.web.test_every_page import assert_sound

PASSWORD = "correct horse"
SET_UP = "/accounts/2fa/totp/activate/"


class Phone:
    """An app that makes codes, and a clock that it and the site share: no code is asked for twice."""

    def __init__(self) -> None:
        self.now_s = 1_800_000_000.0
        self.key = ""

    def code(self) -> str:
        """The code of the next half minute."""
        self.now_s += 30
        [counter] = auth.yield_hotp_counters_from_time()
        return auth.format_hotp_value(auth.hotp_value(self.key, counter))


@pytest.fixture
def phone(monkeypatch: pytest.MonkeyPatch) -> Phone:
    made = Phone()
    monkeypatch.setattr(auth, "time", SimpleNamespace(time=lambda: made.now_s))
    return made


@pytest.fixture
def keeper(db: None) -> User:
    return User.objects.create_superuser("keeper@example.org", PASSWORD)


def sign_in(client: Client, user: User) -> str:
    """Send the password; returns where that leads."""
    answer = client.post("/accounts/login/", {"login": user.email, "password": PASSWORD})
    assert answer.status_code == 302
    return answer.headers["Location"]


def signed_in(user: User) -> Client:
    client = Client()
    sign_in(client, user)
    return client


def set_up(client: Client, phone: Phone) -> list[str]:
    """Confirm the password, read the key, send a code; returns the recovery codes."""
    path = SET_UP
    asked = client.get(path)
    assert asked.headers["Location"] == f"/accounts/reauthenticate/?next={path.replace('/', '%2F')}"
    assert_sound(client.get(asked.headers["Location"]))
    confirmed = client.post("/accounts/reauthenticate/", {"password": PASSWORD, "next": path})
    assert confirmed.headers["Location"] == path
    page = client.get(path)
    phone.key = assert_sound(page).one("code", id="key").text
    assert "data:image/svg+xml;base64," in page.text
    wrong = client.post(path, {"code": "000000" if phone.code() != "000000" else "000001"})
    assert "The code is wrong, expired or already used" in wrong.text
    assert f'id="key">{phone.key}<' in wrong.text
    done = client.post(path, {"code": phone.code()})
    assert done.headers["Location"] == "/accounts/2fa/recovery-codes/"
    codes = client.get("/accounts/2fa/recovery-codes/")
    assert_sound(codes)
    return re.findall(r"<li><code>(\d{8})</code></li>", codes.text)


@pytest.mark.slow
def test_who_has_an_app_needs_its_code_and_a_recovery_code_works_once(owner: User, phone: Phone) -> None:
    client = signed_in(owner)
    assert "Set up an authenticator app" in assert_sound(client.get("/accounts/2fa/")).text
    codes = set_up(client, phone)
    assert len(codes) == 10
    assert client.get("/accounts/2fa/recovery-codes/download/").text.split() == codes
    assert "10 of 10 codes are left" in assert_sound(client.get("/accounts/2fa/")).text

    other = Client()
    assert sign_in(other, owner) == "/accounts/2fa/authenticate/"
    assert other.get("/submissions/").status_code == 302, "the password alone opens nothing"
    assert_sound(other.get("/accounts/2fa/authenticate/"))
    assert "The code is wrong" in other.post("/accounts/2fa/authenticate/", {"code": "12345"}).text
    code = phone.code()
    assert other.post("/accounts/2fa/authenticate/", {"code": code}).status_code == 302
    assert other.get("/submissions/").status_code == 200

    replayed = Client()
    sign_in(replayed, owner)
    assert replayed.post("/accounts/2fa/authenticate/", {"code": code}).status_code == 200
    for sent, expected in ((codes[0], 302), (codes[0], 200)):
        lost = Client()
        sign_in(lost, owner)
        assert lost.post("/accounts/2fa/authenticate/", {"code": sent}).status_code == expected


@pytest.mark.slow
def test_the_code_that_set_up_the_app_signs_nobody_in(owner: User, phone: Phone) -> None:
    client = signed_in(owner)
    set_up(client, phone)
    phone.now_s -= 30
    used = phone.code()
    replayed = Client()
    sign_in(replayed, owner)
    assert "already used" in replayed.post("/accounts/2fa/authenticate/", {"code": used}).text
    assert replayed.get("/submissions/").status_code == 302


# --- who guesses codes -----------------------------------------------------------------------------------

HOME, ATTACKER = "198.51.100.7", "203.0.113.9"


def tries(user: User, code: str, *, address: str) -> bool:
    """Whether this code, sent from this address by a person who knows the password, opens the account."""
    client = Client(REMOTE_ADDR=address)
    sign_in(client, user)
    return client.post("/accounts/2fa/authenticate/", {"code": code}).status_code == 302


@pytest.mark.slow
def test_wrong_codes_from_one_address_lock_out_that_address_and_not_the_owner(
    owner: User, phone: Phone
) -> None:
    set_up(signed_in(owner), phone)
    assert not any(tries(owner, "1", address=ATTACKER) for _ in range(12))
    assert not tries(owner, phone.code(), address=ATTACKER)
    assert tries(owner, phone.code(), address=HOME)


@pytest.mark.slow
def test_guesses_of_codes_from_many_addresses_meet_the_limit_of_the_account(
    owner: User, phone: Phone
) -> None:
    set_up(signed_in(owner), phone)
    assert tries(owner, phone.code(), address=HOME)
    assert not any(tries(owner, "1", address=f"203.0.113.{n % 10}") for n in range(50))
    # Also the right code, from an address where nobody has ever given one: that the attacker knows the
    # password, and so signs in as far as this, makes no address known.
    assert not tries(owner, phone.code(), address="192.0.2.3")
    assert not tries(owner, phone.code(), address="203.0.113.10")
    assert tries(owner, phone.code(), address=HOME)


@pytest.mark.slow
def test_codes_can_be_renewed_and_the_app_removed_after_the_password(
    owner: User, phone: Phone, django_capture_on_commit_callbacks: DjangoCaptureOnCommitCallbacks
) -> None:
    client = signed_in(owner)
    with django_capture_on_commit_callbacks(execute=True):
        codes = set_up(client, phone)
        assert_sound(client.get("/accounts/2fa/recovery-codes/generate/"))
        client.post("/accounts/2fa/recovery-codes/generate/")
    renewed = re.findall(r"<code>(\d{8})</code>", client.get("/accounts/2fa/recovery-codes/").text)
    assert len(renewed) == 10
    assert not set(renewed) & set(codes)
    # In another session the password is not enough: with a second factor, a code confirms.
    other = Client()
    sign_in(other, owner)
    other.post("/accounts/2fa/authenticate/", {"code": phone.code()})
    asked = other.get("/accounts/2fa/totp/deactivate/")
    assert asked.headers["Location"].startswith("/accounts/2fa/reauthenticate/?next=")
    assert "password" not in assert_sound(other.get("/accounts/2fa/reauthenticate/")).one("main").text
    by_password = other.post("/accounts/reauthenticate/", {"password": PASSWORD})
    assert by_password.headers["Location"].startswith("/accounts/2fa/reauthenticate/")
    assert other.get("/accounts/2fa/recovery-codes/").status_code == 302
    assert_sound(client.get("/accounts/2fa/totp/deactivate/"))
    client.post("/accounts/2fa/totp/deactivate/")
    subjects = [message.subject.partition("] ")[2] for message in mail.outbox]
    assert subjects == [
        *(
            "Two-factor authentication is on",
            "You have new recovery codes",
            "Two-factor authentication is off",
        )
    ]
    assert not Authenticator.objects.exists()
    assert sign_in(Client(), owner) == "/submissions/"


# --- maintainers -----------------------------------------------------------------------------------------


TO_SIGN_IN = "/accounts/login/?next=%2Faccounts%2F2fa%2Ftotp%2Factivate%2F"


def mailed_code() -> str:
    """The code of the last mail."""
    [code] = re.findall(r"^[A-Z]{4}-[A-Z]{4}$", str(mail.outbox[-1].body), re.MULTILINE)
    return str(code)


@pytest.mark.slow
def test_maintainers_who_must_have_one_are_led_to_it_and_see_nothing_more_before(
    keeper: User, owner: User, edition: Edition, phone: Phone, settings: Settings
) -> None:
    early, later = signed_in(keeper), signed_in(keeper)
    assert early.get("/maintain/").status_code == 200
    sent = builders.send(owner, builders.predictions(edition)).submission  # private
    of_another = (
        f"/submissions/{sent.pk}/",
        f"/api/v1/submissions/{sent.pk}",
        f"/methods/{sent.method_id}/",
        f"/api/v1/methods/{sent.method_id}",
    )
    of_maintainers = [f"/api/v1/splits/test/editions/1/{name}" for name in ("preview", "progress")]
    assert {early.get(path).status_code for path in (*of_another, *of_maintainers)} == {200}
    settings.REQUIRE_SECOND_FACTOR = True
    assert {early.get(path).status_code for path in of_another} == {404}
    assert {early.get(path).status_code for path in of_maintainers} == {403}
    assert early.get("/submissions/").status_code == 200

    client = Client()
    assert sign_in(client, keeper) == "/accounts/login/code/confirm/"
    client.post("/accounts/login/code/confirm/", {"code": mailed_code()})
    assert client.get("/maintain/").headers["Location"] == SET_UP
    assert "need two-factor authentication" in client.get("/accounts/reauthenticate/").text
    set_up(client, phone)
    # Sessions from before are no better for it: neither shows its pages without a code.
    for session in (later, client):
        asked = session.get("/maintain/?x=1").headers["Location"]
        assert asked == "/accounts/2fa/reauthenticate/?next=%2Fmaintain%2F%3Fx%3D1"
        page = assert_sound(session.get(asked))
        assert page.one("input", name="next").attributes["value"] == "/maintain/?x=1"
        code = {"code": phone.code(), "next": "/maintain/?x=1"}
        assert session.post("/accounts/2fa/reauthenticate/", code).headers["Location"] == "/maintain/?x=1"
        assert session.get("/maintain/").status_code == session.get("/admin/").status_code == 200
        assert {session.get(path).status_code for path in (*of_another, *of_maintainers)} == {200}

    refused = client.post("/accounts/2fa/totp/deactivate/")
    assert "Maintainers of this site need two-factor authentication." in refused.text
    assert Authenticator.objects.filter(user=keeper, type="totp").exists()


@pytest.mark.slow
def test_the_password_of_a_maintainer_alone_sets_up_no_app(keeper: User, settings: Settings) -> None:
    settings.REQUIRE_SECOND_FACTOR = True
    client = Client()
    assert sign_in(client, keeper) == "/accounts/login/code/confirm/"
    assert [message.to for message in mail.outbox] == [[keeper.email]]
    assert mail.outbox[0].subject.endswith("Your code to sign in")
    assert_sound(client.get("/accounts/login/code/confirm/"))
    for path in ("/submissions/", "/maintain/", SET_UP):
        assert client.get(path).headers["Location"].startswith(("/accounts/login/", "/accounts/reauth")), path
    for _ in range(2):
        wrong = client.post("/accounts/login/code/confirm/", {"code": "BBBB-BBBB"})
        assert "The code is wrong" in assert_sound(wrong).text
    client.post("/accounts/login/code/confirm/", {"code": "BBBB-BBBB"})
    client.post("/accounts/login/code/confirm/", {"code": mailed_code()})
    assert client.get("/submissions/").status_code == 302, "three wrong codes end it"


@pytest.mark.parametrize("path", ["/maintain/", "/admin/leaderboard/user/", SET_UP])
def test_a_session_that_the_password_alone_opened_before_signs_in_again(
    keeper: User, settings: Settings, path: str
) -> None:
    client = signed_in(keeper)
    client.post("/accounts/reauthenticate/", {"password": PASSWORD})
    settings.REQUIRE_SECOND_FACTOR = True
    answer = client.get(path)
    assert answer.headers["Location"] == TO_SIGN_IN
    assert "a code that we mail to you" in assert_sound(client.get(TO_SIGN_IN)).text
    form = {"login": keeper.email, "password": PASSWORD, "next": SET_UP}
    assert client.post("/accounts/login/", form).headers["Location"] == "/accounts/login/code/confirm/"
    answer = client.post("/accounts/login/code/confirm/", {"code": mailed_code()})
    assert answer.headers["Location"] == SET_UP


def test_forms_of_maintainers_and_of_the_set_up_do_nothing_in_such_a_session(
    keeper: User, settings: Settings
) -> None:
    settings.REQUIRE_SECOND_FACTOR = True
    for path in ("/maintain/queue/retry/", SET_UP):
        client = Client()
        client.force_login(keeper)
        assert client.post(path, {"code": "123456"}).headers["Location"] == TO_SIGN_IN
    assert not Authenticator.objects.exists()


@pytest.mark.slow
def test_a_token_has_no_more_rights_than_a_session_without_a_code(
    keeper: User, owner: User, edition: Edition, settings: Settings
) -> None:
    sent = builders.send(owner, builders.predictions(edition)).submission  # private
    client = Client(headers={"Authorization": f"Bearer {builders.token(keeper)}"})
    of_another = [f"/api/v1/submissions/{sent.pk}", f"/api/v1/methods/{sent.method_id}"]
    of_maintainers = [f"/api/v1/splits/test/editions/1/{name}" for name in ("preview", "progress")]
    assert {client.get(path).status_code for path in (*of_another, *of_maintainers)} == {200}
    settings.REQUIRE_SECOND_FACTOR = True
    assert {client.get(path).status_code for path in of_another} == {404}
    assert {client.get(path).status_code for path in of_maintainers} == {403}
    assert client.get("/api/v1/submissions").json() == []
    assert client.post(f"/api/v1/submissions/{sent.pk}/withdraw").status_code == 404


@pytest.mark.slow
def test_other_people_need_no_code(owner: User, phone: Phone, settings: Settings) -> None:
    settings.REQUIRE_SECOND_FACTOR = True
    assert signed_in(owner).get("/maintain/").status_code == 404
    set_up(signed_in(owner), phone)
    token = {"Authorization": f"Bearer {builders.token(owner)}"}
    assert Client(headers=token).get("/api/v1/submissions").status_code == 200
    assert Client().get("/maintain/").headers["Location"].startswith("/accounts/login/")


def test_nobody_reads_or_writes_second_factors_in_the_administration(keeper: User) -> None:
    client = signed_in(keeper)
    for model in ("mfa/authenticator", "socialaccount/socialapp", "socialaccount/socialaccount"):
        assert client.get(f"/admin/{model}/").status_code == 404


@pytest.mark.slow
def test_a_maintainer_who_signs_in_comes_to_what_waits_and_others_to_their_submissions(
    keeper: User, owner: User, phone: Phone
) -> None:
    assert (sign_in(Client(), keeper), sign_in(Client(), owner)) == ("/maintain/", "/submissions/")
    form = {"login": keeper.email, "password": PASSWORD, "next": "/board/test/"}
    assert Client().post("/accounts/login/", form).headers["Location"] == "/board/test/"
    set_up(signed_in(keeper), phone)
    client = Client()
    sign_in(client, keeper)
    asked = client.post("/accounts/2fa/authenticate/", {"code": phone.code()})
    assert asked.headers["Location"] == "/maintain/"


# --- help, and a person's data ---------------------------------------------------------------------------


@pytest.mark.slow
def test_a_maintainer_resets_the_second_factor_of_another_with_a_reason(owner: User, phone: Phone) -> None:
    set_up(signed_in(owner), phone)
    call_command("reset_second_factor", owner.email, "--reason", "lost the phone", stdout=StringIO())
    assert not Authenticator.objects.filter(user=owner).exists()
    event = AuditEvent.objects.get(verb="second factor reset")
    assert (event.noun, event.noun_id, event.details) == ("User", str(owner.pk), {"reason": "lost the phone"})
    assert Mail.objects.get(user=owner).subject == "[TSTTC leaderboard] Two-factor authentication is off"
    assert sign_in(Client(), owner) == "/submissions/"


@pytest.mark.parametrize(
    ("email", "reason", "message"),
    [
        ("nobody@example.org", "lost", "no account with that address"),
        ("owner@example.org", " ", "'reason' is empty"),
        ("owner@example.org", "lost", "has no two-factor authentication"),
    ],
)
def test_what_cannot_be_reset_has_a_message(owner: User, email: str, reason: str, message: str) -> None:
    with pytest.raises(CommandError, match=message):
        call_command("reset_second_factor", email.replace("owner@example.org", owner.email), reason=reason)
    assert not AuditEvent.objects.filter(verb="second factor reset").exists()


@pytest.mark.slow
def test_the_export_names_the_second_factor_without_its_key_and_forgetting_deletes_it(
    owner: User, phone: Phone
) -> None:
    codes = set_up(signed_in(owner), phone)
    exported = forgetting.export(user=owner)["second_factor"]
    assert [row["type"] for row in exported] == ["recovery_codes", "totp"]
    assert not [secret for secret in (phone.key, *codes) if secret in str(exported)]
    assert not [message for message in mail.outbox if phone.key in message.body]
    forgetting.forget(user=owner, reason="asked", actor=owner, now=timezone.now())
    assert not Authenticator.objects.exists()
