"""Invitations: one link lets one person in, once, for a while."""

import hashlib
import logging
from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.models import AuditEvent, Edition, Invitation, Membership, Method, Team, User
from leaderboard.people import invitations, teams
from tests import builders, pages
from tests.leaderboard.people.test_teams import refused

WEEK = timedelta(days=7)


def invite(team: Team, actor: User) -> str:
    return invitations.make(team=team, actor=actor, now=timezone.now())[1]


def accept(secret: str, user: User, *, after: timedelta = timedelta(0)) -> Team:
    return invitations.accept(secret=secret, user=user, now=timezone.now() + after)


# --- its life ----------------------------------------------------------------------------------------------


def test_one_link_lets_one_person_in_once(owner: User, stranger: User, maintainer: User, team: Team) -> None:
    secret = invite(team, owner)
    assert Invitation.objects.get().secret_hash == hashlib.sha256(secret.encode()).hexdigest()
    assert accept(secret, stranger) == team
    membership = Membership.objects.get(user=stranger)
    assert (membership.team, membership.is_owner) == (team, False)
    with refused("invitation-used"):
        accept(secret, maintainer)
    (event,) = AuditEvent.objects.filter(verb="joined")
    assert event.actor == stranger


def test_it_ends_after_a_week_or_when_it_is_revoked(
    owner: User, teammate: User, stranger: User, team: Team
) -> None:
    secret = invite(team, owner)
    with refused("invitation-expired"):
        accept(secret, stranger, after=WEEK)
    row = Invitation.objects.get()
    now = timezone.now()
    with refused("not-the-owner"):
        invitations.revoke(invitation=row, actor=teammate, now=now)
    assert invitations.revoke(invitation=row, actor=owner, now=now)
    assert not invitations.revoke(invitation=row, actor=owner, now=now)
    with refused("invitation-revoked"):
        accept(secret, stranger)
    assert not Membership.objects.filter(user=stranger).exists()


def test_links_of_who_is_not_in_the_team_any_more_open_nothing(
    edition: Edition, owner: User, teammate: User, stranger: User, team: Team
) -> None:
    first, second = invite(team, owner), invite(team, owner)
    teams.hand_over(team=team, to=teammate, actor=owner)
    third = invite(team, teammate)
    teams.remove(team=team, member=owner, actor=teammate)
    for secret in (first, second):
        with refused("invitation-revoked"):
            accept(secret, owner)
    # The last one out leaves private methods that nobody is to see again.
    builders.submit(teammate, builders.predictions(edition), visibility="PRIVATE")
    teams.leave(user=teammate)
    with refused("invitation-revoked"):
        accept(third, stranger)
    assert not Membership.objects.filter(team=team).exists()


def test_owner_alone_invites_and_not_without_end(
    owner: User, teammate: User, stranger: User, team: Team
) -> None:
    for other in (teammate, stranger):
        with refused("not-the-owner"):
            invite(team, other)
    for _ in range(invitations.MAX_OPEN):
        invite(team, owner)
    with refused("too-many-invitations"):
        invite(team, owner)


@pytest.mark.parametrize("secret", ["é" * 43, "A" * 43, "A" * 42 + "\x00"])
def test_what_is_no_secret_is_nothing(db: None, stranger: User, client: Client, secret: str) -> None:
    assert invitations.find(secret=secret, now=timezone.now()) is None
    with refused("no-invitation"):
        accept(secret, stranger)
    client.force_login(stranger)
    assert client.get(f"/team/join/{secret}/").status_code == 404


# --- what becomes of the team that one was in ---------------------------------------------------------------


def test_a_team_of_one_comes_along_with_its_methods(
    edition: Edition, owner: User, stranger: User, team: Team
) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.2), method="Foo")
    sent = builders.submit(stranger, builders.predictions(edition), method="fοo", visibility="ANONYMOUS")
    hidden = builders.submit(
        stranger, builders.predictions(edition, factor=1.3), method="Bar", visibility="PRIVATE"
    )
    former = sent.method.team
    secret = invite(team, owner)
    invitation = invitations.find(secret=secret, now=timezone.now())
    meaning = invitations.meaning(invitation=invitation, user=stranger)
    assert (meaning.left, meaning.n_methods, meaning.n_private, meaning.comes_along) == (former, 2, 1, True)
    assert meaning.renamed == (("fοo", "fοo 2"),)
    accept(secret, stranger)
    names = sorted(Method.objects.filter(team=team).values_list("name", flat=True))
    assert names == ["Bar", "Foo", "fοo 2"]
    assert not Team.objects.filter(pk=former.pk).exists()
    hidden.method.refresh_from_db()
    assert hidden.method.visibility == "PRIVATE"
    (event,) = AuditEvent.objects.filter(verb="joined")
    assert event.details["brought"] == sorted(
        str(m.pk) for m in Method.objects.filter(name__in=["Bar", "fοo 2"])
    )


def test_who_is_not_alone_leaves_what_was_sent_behind(
    edition: Edition, owner: User, teammate: User, stranger: User, team: Team
) -> None:
    sent = builders.submit(teammate, builders.predictions(edition))
    secret = invite(teams.team_of(user=stranger), stranger)
    accept(secret, teammate)
    sent.method.refresh_from_db()
    assert sent.method.team == team
    assert list(team.members.all()) == [owner]


def test_owner_of_a_team_with_others_and_a_member_already_cannot_join(
    owner: User, teammate: User, stranger: User, team: Team
) -> None:
    other = invite(teams.team_of(user=stranger), stranger)
    with refused("cannot-join"):
        accept(other, owner)
    own = invite(team, owner)
    with refused("cannot-join"):
        accept(own, teammate)
    assert Invitation.objects.filter(accepted_at=None).count() == 2


# --- the page ----------------------------------------------------------------------------------------------


def test_page_makes_a_link_shows_it_once_and_lets_a_user_in(
    client: Client, owner: User, stranger: User, team: Team, caplog: pytest.LogCaptureFixture
) -> None:
    client.force_login(owner)
    made = pages.page(client.post("/team/invite/", follow=True))
    link = made.one("code", id="link").text
    address = link[link.index("/team/join/") :]
    secret = address.split("/")[3]
    assert secret not in client.get("/team/").content.decode()
    assert "open" in pages.page(client.get("/team/")).one("main").text

    client.logout()
    invited = pages.page(client.get(address)).one("main")
    assert invited.one("h1").text == "Owls invites you"
    assert [a.attributes["href"] for a in invited.all("a")] == [
        f"/accounts/{way}/?next={address}" for way in ("signup", "login")
    ]
    assert client.post(address).headers["Location"] == f"/accounts/login/?next={address}"
    client.force_login(stranger)
    teams.team_of(user=stranger)
    with caplog.at_level(logging.INFO):
        response = client.get(address)
    assert secret not in caplog.text
    assert "no-store" in response["Cache-Control"]
    main = pages.page(response).one("main")
    assert "Join Owls" in main.one("h1").text
    assert "The team Strangers is deleted; you cannot undo this." in main.text
    assert not Membership.objects.filter(user=stranger, team=team).exists()
    followed = client.post(address, follow=True)
    assert "You are now in the team Owls." in pages.page(followed).one("main").text
    assert client.get(address).status_code == 410
    client.force_login(owner)
    assert "used by stranger@example.org" in pages.page(client.get("/team/")).one("main").text
