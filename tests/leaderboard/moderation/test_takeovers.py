"""An account that was taken over comes back to its owner, by a mailed link or by a maintainer."""

import re
from datetime import timedelta

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.contrib.sessions.models import Session
from django.core import mail
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.models import AccountChange, ApiToken, AuditEvent, Edition, Mail, SpentMailbox, User
from leaderboard.moderation import forgetting, takeovers
from leaderboard.people import addresses, teams
from tests import builders
from tests.leaderboard.web.account.proving import CONFIRM, code_in, confirm, proving, sign_up
from tests.leaderboard.web.test_every_page import assert_sound

EMAIL = "/accounts/email/"
EVIL = "evil@example.org"
DAY, HOUR = timedelta(days=1), timedelta(hours=1)


@pytest.fixture(autouse=True)
def _proving(settings: Settings, benchmark: None) -> None:
    proving(settings)


@pytest.fixture
def victim(owner: User) -> User:
    for email in (owner.email, "second@example.org"):
        EmailAddress.objects.create(user=owner, email=email, verified=True, primary=email == owner.email)
    return owner


def thief(user: User) -> Client:
    """A browser of a person who knows the password."""
    client = Client()
    client.force_login(user)
    confirm(client)
    return client


def add(client: Client, email: str = EVIL) -> None:
    client.post(EMAIL, {"action_add": "", "email": email})
    code = next(code_in(each) for each in reversed(mail.outbox) if each.to == [email])
    client.post(CONFIRM, {"code": code})
    assert EmailAddress.objects.get(email=email).verified


def make_primary(client: Client, email: str = EVIL) -> None:
    client.post(EMAIL, {"action_primary": "", "email": email})
    assert EmailAddress.objects.get(email=email).primary


def remove(client: Client, email: str) -> None:
    client.post(EMAIL, {"action_remove": "", "email": email})
    assert not EmailAddress.objects.filter(email=email).exists()


def links_to(email: str) -> list[str]:
    """The links that were mailed to an address, the oldest first."""
    bodies = [str(message.body) for message in mail.outbox if message.to == [email]]
    return [
        match for body in bodies for match in re.findall(r"http://127.0.0.1:8000(/accounts/undo/\S+)", body)
    ]


def follow(link: str, **fields: object) -> int:
    return Client().post(link, fields).status_code


def addresses_of(user: User) -> list[str]:
    """The proved addresses, the primary one first; the account's own is the same."""
    user.refresh_from_db()
    emails = takeovers.proved(user)
    assert emails[0] == user.email
    return emails


def age(by: timedelta) -> None:
    """Let time pass, for everything that was changed so far."""
    for row in AccountChange.objects.all():
        AccountChange.objects.filter(pk=row.pk).update(at=row.at - by)


def take_over(client: Client, user: User) -> None:
    """Every step by which an account changes hands."""
    old = user.email
    add(client)
    make_primary(client)
    remove(client, old)
    remove(client, "second@example.org")
    word = "evil-password-77"
    client.post(
        "/accounts/password/change/",
        {"oldpassword": "correct horse", "password1": word, "password2": word},
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("former", ["owner@example.org", "second@example.org"])
def test_every_former_address_can_take_the_account_back_by_each_of_its_mails(
    victim: User, former: str, number: int
) -> None:
    client = thief(victim)
    take_over(client, victim)
    builders.token(victim)
    Authenticator.objects.create(user=victim, type="totp", data={"secret": "A" * 32})
    SocialAccount.objects.create(user=victim, provider="github", uid="666")
    assert len(links_to(former)) == 5
    assert client.get("/submissions/").status_code == 200
    page = assert_sound(Client().get(links_to(former)[number])).one("main").text
    assert former in page
    assert addresses_of(victim) == [EVIL], "looking changes nothing"
    mail.outbox.clear()
    done = Client().post(links_to_first(victim, former, number))
    assert done.headers["Location"] == "/accounts/password/reset/done/"
    assert addresses_of(victim) == ["owner@example.org", "second@example.org"]
    assert not victim.has_usable_password()
    assert client.get("/submissions/").status_code == 302
    assert not ApiToken.objects.filter(user=victim, revoked_at=None).exists()
    assert not Authenticator.objects.filter(user=victim).exists()
    assert not SocialAccount.objects.filter(user=victim).exists()
    [reset] = [each for each in mail.outbox if "/accounts/password/reset/key/" in str(each.body)]
    assert reset.to == [former]
    recipients = set(Mail.objects.filter(ended_at=None).values_list("recipient", flat=True))
    assert recipients == {"owner@example.org", "second@example.org", EVIL}
    assert AuditEvent.objects.filter(verb="recovered", noun_id=str(victim.pk)).count() == 1


def links_to_first(user: User, former: str, number: int) -> str:
    """The link of the mail with this number, made again: mails were cleared."""
    change = AccountChange.objects.filter(user=user).order_by("pk")[number]
    return takeovers._link(change, former).removeprefix("http://127.0.0.1:8000")


@pytest.mark.slow
def test_a_link_works_once_and_none_of_the_thief_works_after_it(victim: User) -> None:
    client = thief(victim)
    take_over(client, victim)
    own, other, evil = links_to("owner@example.org"), links_to("second@example.org"), links_to(EVIL)
    assert evil, "the account had this address, too"
    assert follow(own[-1]) == 302
    assert [follow(link) for link in [*own, *other, *evil]] == [410] * len([*own, *other, *evil])
    assert addresses_of(victim) == ["owner@example.org", "second@example.org"]


@pytest.mark.slow
def test_the_thief_cannot_be_first_with_a_link_of_their_own(victim: User) -> None:
    client = thief(victim)
    add(client)
    make_primary(client)
    # The owner's addresses are still there: there is nothing for the thief to bring back.
    assert [follow(link) for link in links_to(EVIL)] == [410] * len(links_to(EVIL))
    remove(client, "owner@example.org")
    remove(client, "second@example.org")
    for link in links_to(EVIL):
        follow(link)
    assert follow(links_to("owner@example.org")[0]) == 302
    assert addresses_of(victim) == ["owner@example.org", "second@example.org"]
    assert [follow(link) for link in links_to(EVIL)] == [410] * len(links_to(EVIL))


def test_the_owner_who_throws_the_thief_out_is_not_thrown_out_by_a_link(victim: User) -> None:
    client = thief(victim)
    add(client)
    remove(client, EVIL)
    assert links_to(EVIL)
    assert [follow(link) for link in links_to(EVIL)] == [410] * len(links_to(EVIL))
    assert addresses_of(victim) == ["owner@example.org", "second@example.org"]


@pytest.mark.slow
def test_what_was_given_up_more_than_a_week_ago_comes_back_to_nobody(victim: User) -> None:
    client = thief(victim)
    add(client, "new@example.org")
    make_primary(client, "new@example.org")
    remove(client, "owner@example.org")
    given_up = links_to("owner@example.org")
    age(6 * DAY)
    remove(client, "second@example.org")
    later = links_to("owner@example.org")
    assert len(later) == len(given_up) + 1, "within the week, it is told"
    age(2 * DAY)
    add(client)
    make_primary(client)
    assert links_to("owner@example.org") == later
    assert [follow(link) for link in later] == [410] * len(later)
    # Nor does another address bring it back.
    assert follow(links_to("second@example.org")[-1]) == 302
    assert "owner@example.org" not in addresses_of(victim)
    assert EVIL not in addresses_of(victim)


def test_steps_days_apart_are_undone_together(victim: User) -> None:
    client = thief(victim)
    add(client)
    for step in ("primary", "owner@example.org", "second@example.org"):
        age(6 * DAY)
        make_primary(client) if step == "primary" else remove(client, step)
    assert follow(links_to("second@example.org")[-1]) == 302
    assert EVIL not in addresses_of(victim)


@pytest.mark.slow
def test_one_may_choose_from_which_change_on(victim: User) -> None:
    client = thief(victim)
    add(client, "new@example.org")
    own_change = AccountChange.objects.get()
    add(client)
    remove(client, "new@example.org")
    link = links_to("owner@example.org")[-1]
    assert own_change.pk != AccountChange.objects.order_by("pk")[1].pk
    assert follow(link, since=AccountChange.objects.order_by("pk")[1].pk) == 302
    assert addresses_of(victim) == ["owner@example.org", "second@example.org", "new@example.org"]


@pytest.mark.slow
def test_an_owner_who_has_another_account_by_now_reads_so(victim: User) -> None:
    client = thief(victim)
    take_over(client, victim)
    other = User.objects.create_user("owner@example.org", "x")
    EmailAddress.objects.create(user=other, email=other.email, verified=True, primary=True)
    refused = Client().post(links_to("owner@example.org")[-1])
    assert refused.status_code == 422
    assert "Another account has this address now" in refused.text
    assert addresses_of(victim) == [EVIL]
    # The other address takes it back, without the one that has gone.
    assert follow(links_to("second@example.org")[-1]) == 302
    assert addresses_of(victim) == ["second@example.org"]
    assert addresses_of(other) == ["owner@example.org"]


def test_an_app_that_was_there_before_stays(victim: User) -> None:
    Authenticator.objects.create(user=victim, type="totp", data={"secret": "A" * 32})
    Authenticator.objects.update(created_at=timezone.now() - DAY)
    before = [victim.email, "second@example.org"]
    links = takeovers.note(user=victim, what="password_changed", before=before, now=timezone.now())
    assert follow(links[victim.email].removeprefix("http://127.0.0.1:8000")) == 302
    assert Authenticator.objects.filter(user=victim).count() == 1


def test_a_sign_in_that_has_begun_ends_as_well(victim: User, settings: Settings) -> None:
    Authenticator.objects.create(user=victim, type="totp", data={"secret": "A" * 32})
    waiting = Client()
    led = waiting.post("/accounts/login/", {"login": victim.email, "password": "correct horse"})
    assert led.headers["Location"] == "/accounts/2fa/authenticate/"
    links = takeovers.note(user=victim, what="x", before=[victim.email], now=timezone.now())
    assert follow(links[victim.email].removeprefix("http://127.0.0.1:8000")) == 302
    assert waiting.get("/accounts/2fa/authenticate/").status_code == 302


@pytest.mark.parametrize("secret", ["x", "x:y:z", "W10:1abc:xyz", "%00", "ä"])
def test_links_that_are_none_say_so(secret: str) -> None:
    answer = Client().get(f"/accounts/undo/{secret}/")
    assert answer.status_code == 410
    assert_sound(answer)


# --- what a maintainer does ------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_maintainer_gives_an_account_back_and_confirms_who_they_are(victim: User, maintainer: User) -> None:
    client = thief(victim)
    take_over(client, victim)
    builders.token(victim)
    Authenticator.objects.create(user=victim, type="totp", data={"secret": "A" * 32})
    SocialAccount.objects.create(user=victim, provider="github", uid="666")
    path = f"/maintain/actions/give-back-account/{victim.pk}/"
    fields = {"address": "Owner@Example.org", "reason": "Showed that the repository of the method is theirs."}
    keeper = Client()
    keeper.force_login(maintainer)
    assert_sound(keeper.get(path))
    asked = keeper.post(path, fields)
    assert asked.headers["Location"].startswith("/accounts/reauthenticate/")
    assert addresses_of(victim) == [EVIL]
    confirm(keeper)
    assert keeper.post(path, fields).headers["Location"].startswith("/maintain/teams/")
    assert addresses_of(victim) == ["owner@example.org"]
    assert not victim.has_usable_password()
    assert client.get("/submissions/").status_code == 302
    assert not ApiToken.objects.filter(user=victim, revoked_at=None).exists()
    assert not Authenticator.objects.filter(user=victim).exists()
    assert not SocialAccount.objects.filter(user=victim).exists()
    event = AuditEvent.objects.get(verb="given back")
    assert event.actor == maintainer
    assert "example.org" not in str(event.details)
    recipients = set(Mail.objects.filter(ended_at=None).values_list("recipient", flat=True))
    assert recipients == {"owner@example.org", EVIL}
    every_link = [*links_to("owner@example.org"), *links_to("second@example.org"), *links_to(EVIL)]
    assert [follow(link) for link in every_link] == [410] * len(every_link)


@pytest.mark.parametrize("has_team", [True, False])
def test_a_maintainer_finds_the_account_by_the_address_that_it_had(
    victim: User, maintainer: User, has_team: bool
) -> None:
    if has_team:
        teams.create(user=victim, name="Owls", now=timezone.now())
    client = thief(victim)
    add(client)
    make_primary(client)
    remove(client, "owner@example.org")
    keeper = Client()
    keeper.force_login(maintainer)
    assert EVIL in keeper.get("/maintain/teams/?team=Owner@example.org").text
    assert EVIL not in keeper.get("/maintain/teams/?team=nobody@example.org").text


def test_only_maintainers_give_accounts_back_and_not_those_of_maintainers(
    victim: User, maintainer: User, stranger: User
) -> None:
    given = {"address": "x@example.org", "reason": "r", "now": timezone.now()}
    for actor in (stranger, victim):
        with pytest.raises(NotMaintainer):
            takeovers.give_back(user=victim, actor=actor, **given)
    with pytest.raises(Refused, match="maintainer's account"):
        takeovers.give_back(user=maintainer, actor=maintainer, **given)
    with pytest.raises(Refused, match="Another account"):
        takeovers.give_back(user=victim, actor=maintainer, **{**given, "address": stranger.email})
    client = Client()
    client.force_login(stranger)
    assert client.post(f"/maintain/actions/give-back-account/{victim.pk}/", given).status_code == 404


def test_a_changed_hand_gives_no_new_quota(victim: User, edition: Edition, maintainer: User) -> None:
    builders.submit(victim, builders.predictions(edition))
    now = timezone.now()
    takeovers.give_back(user=victim, address="new@example.org", reason="r", actor=maintainer, now=now)
    digests = set(SpentMailbox.objects.filter(account=victim).values_list("digest", flat=True))
    assert len(digests) == 3, "of both former mailboxes and of the new one"
    forgetting.forget(user=User.objects.get(pk=victim.pk), reason="r", actor=maintainer, now=now)
    assert SpentMailbox.objects.filter(account=victim).count() == 3


# --- what is left ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_nothing_holds_the_addresses_of_a_deleted_person(victim: User, stranger: User) -> None:
    client = thief(victim)
    add(client, "new@example.org")
    Client().post("/accounts/login/", {"login": victim.email, "password": "correct horse"})
    typing = Client()
    sign_up(typing, victim.email)
    own = Client()
    own.force_login(stranger)
    confirm(own)
    own.post(EMAIL, {"action_add": "", "email": victim.email})
    other = Client()
    other.force_login(victim)
    other.post("/account/data/", {"email": victim.email})  # waits for the password, with what was typed
    known = {victim.email, "second@example.org", "new@example.org"}
    assert any(email in str(row.get_decoded()) for row in Session.objects.all() for email in known)
    forgetting.forget(user=victim, reason="r", actor=victim, now=timezone.now())
    left = [str(row.get_decoded()) for row in Session.objects.all()]
    assert not [text for text in left if any(email in text for email in known)]
    assert not AccountChange.objects.exists()
    assert own.get("/submissions/").status_code == 200, "whoever typed it stays signed in"


def test_changes_are_kept_for_thirty_days(victim: User) -> None:
    now = timezone.now()
    takeovers.note(user=victim, what="x", before=[victim.email], now=now)
    takeovers.delete_old(now=now + 29 * DAY)
    assert AccountChange.objects.exists()
    takeovers.delete_old(now=now + 31 * DAY)
    assert not AccountChange.objects.exists()


def test_an_unproved_address_undoes_nothing(owner: User) -> None:
    EmailAddress.objects.create(user=owner, email=owner.email, verified=False, primary=True)
    assert takeovers.proved(owner) == []
    assert addresses.are_proved()


def test_a_link_that_was_used_or_whose_change_is_gone_says_so_and_does_nothing(victim: User) -> None:
    now = timezone.now()
    links = takeovers.note(
        user=victim, what="email_changed", before=[victim.email, "old@example.org"], now=now
    )
    assert links.keys() == {victim.email, "old@example.org"}
    secret = links["old@example.org"].rstrip("/").rpartition("/")[2]
    takeovers.undo(secret=secret, since=None, now=now)
    assert addresses_of(victim)[0] == "owner@example.org"
    for _ in range(2):
        with pytest.raises(takeovers.UnusableLink, match="was used already"):
            takeovers.find(secret=secret, now=now)
        AccountChange.objects.all().delete()


def test_a_change_of_another_person_is_kept_and_undone_by_their_own_link_alone(
    victim: User, stranger: User
) -> None:
    now = timezone.now()
    secrets = {}
    for user in (victim, stranger):
        former = f"former-{user.name}@example.org"
        links = takeovers.note(user=user, what="email_changed", before=[former], now=now)
        assert links.keys() == {former}
        secrets[user] = links[former].rstrip("/").rpartition("/")[2]
    assert takeovers.undo(secret=secrets[victim], since=None, now=now) == victim
    assert addresses_of(victim) == ["former-Owls@example.org"]
    assert AccountChange.objects.get(user=stranger).undone_at is None
    assert takeovers.find(secret=secrets[stranger], now=now).user == stranger


@pytest.mark.parametrize(("age", "works"), [(7 * DAY - timedelta(seconds=1), True), (7 * DAY, False)])
def test_a_change_can_be_undone_for_less_than_a_week(victim: User, age: timedelta, works: bool) -> None:
    now = timezone.now()
    links = takeovers.note(user=victim, what="email_changed", before=["old@example.org"], now=now)
    secret = links["old@example.org"].rstrip("/").rpartition("/")[2]
    if works:
        assert takeovers.find(secret=secret, now=now + age).address == "old@example.org"
    else:
        with pytest.raises(takeovers.UnusableLink, match="older than a week"):
            takeovers.find(secret=secret, now=now + age)


def test_a_former_address_finds_the_accounts_that_had_it(victim: User, stranger: User) -> None:
    for user, before in ((victim, ["a@old.example", "b@old.example"]), (stranger, ["c@other.example"])):
        takeovers.note(user=user, what="email_changed", before=before, now=timezone.now())
    assert takeovers.with_former_address(" B@OLD ") == {victim.pk}
    assert takeovers.with_former_address("other.example") == {stranger.pk}
    assert takeovers.with_former_address("example") == {victim.pk, stranger.pk}
    assert takeovers.with_former_address(" ") == set()


def test_a_former_address_is_told_of_changes_for_less_than_a_week(victim: User) -> None:
    now = timezone.now()

    def told(days: float) -> set[str]:
        links = takeovers.note(
            user=victim,
            what="email_changed",
            before=[f"day-{days}@example.org"],
            now=now + timedelta(days=days),
        )
        return set(links)

    assert told(0) == {"day-0@example.org"}
    assert told(3) == {"day-0@example.org", "day-3@example.org"}
    # Each change is within a week of the one before.
    assert told(7) == {"day-3@example.org", "day-7@example.org"}


@pytest.mark.parametrize("how", ["by a link", "by a maintainer"])
def test_ways_into_the_accounts_of_others_stay_when_one_is_given_back(
    victim: User, stranger: User, maintainer: User, how: str
) -> None:
    now = timezone.now()
    EmailAddress.objects.create(user=stranger, email="mine@example.org", verified=True, primary=True)
    links = takeovers.note(user=victim, what="email_changed", before=["old@example.org"], now=now)
    for user in (victim, stranger):
        builders.token(user)
        Authenticator.objects.create(user=user, type=Authenticator.Type.TOTP, data={})
        SocialAccount.objects.create(user=user, provider="github", uid=user.name)
        AccountChange.objects.create(user=user, what="email_changed", before=[])
    if how == "by a link":
        secret = links["old@example.org"].rstrip("/").rpartition("/")[2]
        takeovers.undo(secret=secret, since=None, now=timezone.now())
    else:
        takeovers.give_back(
            user=victim, address="old@example.org", reason="R", actor=maintainer, now=timezone.now()
        )
    for user, n_left in ((victim, 0), (stranger, 1)):
        left = [
            ApiToken.objects.filter(user=user, revoked_at=None).count(),
            Authenticator.objects.filter(user=user).count(),
            SocialAccount.objects.filter(user=user).count(),
            AccountChange.objects.filter(user=user, undone_at=None).count(),
            int(User.objects.get(pk=user.pk).has_usable_password()),
        ]
        assert left == [n_left] * 5
    assert list(EmailAddress.objects.filter(user=stranger).values_list("email", "primary")) == [
        ("mine@example.org", True)
    ]


def test_sessions_of_an_account_that_a_maintainer_gives_back_end_and_those_of_others_stay(
    victim: User, stranger: User, maintainer: User
) -> None:
    def enter(user: User) -> Client:
        client = Client()
        client.force_login(user)
        return client

    own = enter(stranger)
    for _ in range(2):
        enter(victim)
    Authenticator.objects.create(user=victim, type=Authenticator.Type.TOTP, data={"secret": "A" * 32})
    waiting = Client()
    waiting.post("/accounts/login/", {"login": victim.email, "password": "correct horse"})
    # Whoever typed an address of the account holds it in a session of their own.
    confirm(own)
    own.post(EMAIL, {"action_add": "", "email": victim.email})
    assert Session.objects.count() == 4
    assert victim.email in str(Session.objects.get(pk=own.session.session_key).get_decoded())
    takeovers.give_back(
        user=victim, address="new@example.org", reason="R", actor=maintainer, now=timezone.now()
    )
    left = Session.objects.get()
    assert left.session_key == own.session.session_key
    assert "owner@example.org" not in str(left.get_decoded())


def test_apps_and_connected_accounts_from_before_a_change_stay_and_later_ones_end(victim: User) -> None:
    now = timezone.now()
    kinds = (Authenticator.Type.TOTP, Authenticator.Type.RECOVERY_CODES)
    for kind, uid, at in zip(kinds, ("before", "after"), (now - DAY, now), strict=True):
        app = Authenticator.objects.create(user=victim, type=kind, data={})
        Authenticator.objects.filter(pk=app.pk).update(created_at=at)
        connected = SocialAccount.objects.create(user=victim, provider="github", uid=uid)
        SocialAccount.objects.filter(pk=connected.pk).update(date_joined=at)
    links = takeovers.note(user=victim, what="x", before=[victim.email], now=now)
    takeovers.undo(secret=secret_in(links[victim.email]), since=None, now=now)
    assert [app.type for app in Authenticator.objects.filter(user=victim)] == [kinds[0]]
    assert [row.uid for row in SocialAccount.objects.filter(user=victim)] == ["before"]


def secret_in(link: str) -> str:
    return link.rstrip("/").rpartition("/")[2]


@pytest.fixture
def half_undone(victim: User) -> tuple[AccountChange, AccountChange]:
    """Two changes an hour apart, of which the later one was undone after another hour."""
    now = timezone.now()
    former = "former@example.org"
    takeovers.note(user=victim, what="x", before=[former], now=now - 3 * HOUR)
    links = takeovers.note(user=victim, what="x", before=[former, "between@example.org"], now=now - 2 * HOUR)
    first, second = AccountChange.objects.order_by("at")
    takeovers.undo(secret=secret_in(links[former]), since=second.pk, now=now - HOUR)
    first.refresh_from_db()
    second.refresh_from_db()
    assert (first.undone_at, second.undone_at) == (None, now - HOUR)
    return first, second


def test_addresses_before_an_undone_change_are_told_of_no_later_one(
    victim: User, half_undone: tuple[AccountChange, AccountChange]
) -> None:
    links = takeovers.note(user=victim, what="x", before=["last@example.org"], now=timezone.now())
    assert set(links) == {"former@example.org", "last@example.org"}


@pytest.mark.parametrize("how", ["by a link", "by a maintainer"])
def test_an_undone_change_keeps_its_time_when_the_account_is_given_back_later(
    victim: User, maintainer: User, half_undone: tuple[AccountChange, AccountChange], how: str
) -> None:
    first, second = half_undone
    now, address = timezone.now(), "former@example.org"
    if how == "by a link":
        secret = secret_in(takeovers._link(first, address))
        takeovers.undo(secret=secret, since=None, now=now)
    else:
        takeovers.give_back(user=victim, address=address, reason="R", actor=maintainer, now=now)
    times = dict(AccountChange.objects.filter(user=victim).values_list("pk", "undone_at"))
    assert times == {first.pk: now, second.pk: second.undone_at}
