"""Teams: founding, renaming, handing over, removing, leaving; and the page for it."""

from datetime import datetime, timedelta

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard import audit
from leaderboard.errors.refusals import Refused
from leaderboard.methods import editing, visibility
from leaderboard.models import AuditEvent, BoardVersion, Edition, Membership, Method, Team, User
from leaderboard.people import invitations, teams
from tests import builders, pages
from tests.leaderboard.web.account.proving import confirm


def owners(team: Team) -> list[User]:
    return [member.user for member in Membership.objects.filter(team=team, is_owner=True)]


def refused(code: str) -> "pytest.RaisesExc[Refused]":
    return pytest.raises(Refused, check=lambda refusal: refusal.code == code)


# --- the verbs ---------------------------------------------------------------------------------------------


def test_a_user_founds_one_team_and_owns_it(owner: User) -> None:
    made = teams.create(user=owner, name=" Night  Owls ", now=timezone.now())
    assert (made.name, owners(made)) == ("Night Owls", [owner])
    with refused("in-a-team"):
        teams.create(user=owner, name="More owls", now=timezone.now())
    assert Team.objects.count() == 1


def shown(team: Team) -> Method:
    """A public method of the team, shown as its owner does."""
    method = Method.objects.create(team=team, name=f"Net of {team.name}")
    visibility.change(method=method, visibility="PUBLIC", actor=owners(team)[0], now=timezone.now())
    return method


def test_a_name_that_looks_like_that_of_a_team_on_the_boards_is_refused(
    owner: User, stranger: User, team: Team
) -> None:
    shown(team)
    with refused("name-taken"):
        teams.create(user=stranger, name="ОWLS", now=timezone.now())
    other = teams.team_of(user=stranger)
    with refused("name-taken"):
        teams.rename(team=other, name="0wls", actor=stranger, now=timezone.now())
    assert Team.objects.get(pk=other.pk).name == "Strangers"
    assert teams.rename(team=team, name="OWLS", actor=owner, now=timezone.now()).name == "OWLS"


def test_nobody_learns_from_a_name_that_a_team_is_there_which_shows_nothing(
    owner: User, stranger: User, teammate: User, team: Team
) -> None:
    Method.objects.create(team=team, name="Secret")
    veiled = Method.objects.create(team=team, name="Veiled")
    visibility.change(method=veiled, visibility="ANONYMOUS", actor=owner, now=timezone.now())
    client = Client()
    client.force_login(stranger)
    # Founding, renaming and signing up under that name do what they do under any other.
    assert client.post("/team/", {"name": "Owls"}).status_code == 302
    own = teams.team_of(user=stranger)
    assert own.name == "Owls"
    assert client.post("/team/", {"name": "Barn owls"}).status_code == 302
    newcomer = User.objects.create_user("newcomer@example.org", "correct horse", name="Owls")
    assert teams.team_of(user=newcomer).name == "Owls"


def test_of_two_teams_of_one_name_the_first_to_be_shown_has_it(
    owner: User, stranger: User, team: Team
) -> None:
    other = teams.create(user=stranger, name="0WLS", now=timezone.now())
    waiting = Method.objects.create(team=other, name="Waiting")
    shown(team)
    client = Client()
    client.force_login(stranger)
    answer = client.post(
        f"/api/v1/methods/{waiting.pk}/visibility",
        {"visibility": "PUBLIC", "confirm": True},
        content_type="application/json",
    )
    assert (answer.status_code, answer.json()["code"]) == (422, "name-taken")
    assert "rename your team before you publish" in answer.json()["detail"]
    teams.rename(team=other, name="Lapwings", actor=stranger, now=timezone.now())
    visibility.change(method=waiting, visibility="PUBLIC", actor=stranger, now=timezone.now())


def test_a_reveal_on_a_date_numbers_a_name_that_was_shown_meanwhile(
    owner: User, stranger: User, team: Team
) -> None:
    now = timezone.now()
    other = teams.create(user=stranger, name="0WLS", now=now)
    veiled = Method.objects.create(team=other, name="Veiled")
    at = now + timedelta(days=1)
    visibility.change(method=veiled, visibility="ANONYMOUS", actor=stranger, now=now, reveal_at=at)
    shown(team)
    assert visibility.reveal_due(now=at) == 1
    other.refresh_from_db()
    assert (other.name, other.is_shown) == ("0WLS 2", True)
    assert AuditEvent.objects.filter(verb="renamed", noun_id=other.pk).exists()


def test_methods_that_come_along_show_the_name_of_the_team_that_they_come_to(
    owner: User, stranger: User, maintainer: User, team: Team
) -> None:
    others = teams.create(user=stranger, name="0WLS", now=timezone.now())
    shown(team)
    loner = teams.team_of(user=maintainer)
    method = shown(loner)
    _, secret = invitations.make(team=others, actor=stranger, now=timezone.now())
    with refused("name-taken"):
        invitations.accept(secret=secret, user=maintainer, now=timezone.now())
    method.refresh_from_db()
    assert method.team == loner


def test_a_team_and_a_method_are_renamed_once_a_day(owner: User, team: Team) -> None:
    now = timezone.now()
    method = Method.objects.create(team=team, name="Net")

    def rename(name: str, *, at: datetime) -> None:
        teams.rename(team=team, name=name, actor=owner, now=at)

    def rename_method(name: str, *, at: datetime) -> None:
        editing.edit(method=method, changes={"name": name}, actor=owner, now=at)

    for do in (rename, rename_method):
        do("Barn Owls", at=now)
        with refused("renamed-lately"):
            do("Eagle Owls", at=now + timedelta(hours=23))
        do("Eagle Owls", at=now + timedelta(hours=24))
    # What else is said of a method can be changed as often as one likes.
    editing.edit(method=method, changes={"description": "Better."}, actor=owner)


def test_renaming_changes_every_board_and_the_trail_records_it(
    edition: Edition, owner: User, teammate: User, team: Team
) -> None:
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    number = BoardVersion.objects.get(split="test").number
    with refused("not-the-owner"):
        teams.rename(team=team, name="Mates", actor=teammate, now=timezone.now())
    teams.rename(team=team, name="Barn Owls", actor=owner, now=timezone.now())
    teams.rename(team=team, name="Barn Owls", actor=owner, now=timezone.now())
    assert BoardVersion.objects.get(split="test").number == number + 1
    (event,) = AuditEvent.objects.filter(verb="renamed")
    assert event.actor == owner
    assert set(audit.names_in([event]).values()) == {"Owls", "Barn Owls"}


def test_owner_hands_over_before_leaving(owner: User, teammate: User, stranger: User, team: Team) -> None:
    with refused("hand-over-first"):
        teams.leave(user=owner)
    with refused("not-a-member"):
        teams.hand_over(team=team, to=stranger, actor=owner)
    with refused("not-the-owner"):
        teams.hand_over(team=team, to=teammate, actor=teammate)
    with refused("not-yourself"):
        teams.hand_over(team=team, to=owner, actor=owner)
    teams.hand_over(team=team, to=teammate, actor=owner)
    assert owners(team) == [teammate]
    teams.leave(user=owner)
    assert teams.current_team_of(user=owner) is None
    with refused("in-no-team"):
        teams.leave(user=owner)
    assert [e.verb for e in AuditEvent.objects.filter(noun="Team").order_by("pk")] == [
        "created",
        "handed_over",
        "left",
    ]


def test_owner_removes_others_and_never_themselves(
    owner: User, teammate: User, stranger: User, team: Team
) -> None:
    for actor, member, code in (
        (teammate, owner, "not-the-owner"),
        (stranger, owner, "not-the-owner"),
        (owner, owner, "not-yourself"),
        (owner, stranger, "not-a-member"),
    ):
        with refused(code):
            teams.remove(team=team, member=member, actor=actor)
    teams.remove(team=team, member=teammate, actor=owner)
    assert list(team.members.all()) == [owner]


def test_a_team_without_people_and_methods_is_forgotten_and_one_with_methods_stays(
    edition: Edition, owner: User, stranger: User, maintainer: User
) -> None:
    teams.team_of(user=owner)
    teams.leave(user=owner)
    assert not Team.objects.exists()
    builders.submit(stranger, builders.predictions(edition))
    teams.leave(user=stranger)
    assert [method.team.name for method in Method.objects.all()] == ["Strangers"]
    kept = teams.team_of(user=maintainer)
    builders.override(kept, limit=0, reason="a sanction is not shaken off by leaving")
    teams.leave(user=maintainer)
    assert Team.objects.filter(pk=kept.pk).exists()


# --- the page ----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_page_founds_renames_hands_over_removes_and_leaves(
    client: Client, owner: User, teammate: User, stranger: User, team: Team
) -> None:
    client.force_login(stranger)
    assert "No team yet" in pages.page(client.get("/team/")).one("main").text
    shown(team)
    response = client.post("/team/", {"name": "owls"})
    assert response.status_code == 422
    assert "looks like" in pages.page(response).one("main").text
    assert client.post("/team/", {"name": "Ravens"}).status_code == 302
    assert "You are the only member." in pages.page(client.get("/team/")).one("main").text

    client.force_login(teammate)
    main = pages.page(client.get("/team/")).one("main")
    assert "owner@example.org" in main.text
    assert [button.text for button in main.all("button")] == ["Leave Owls"]
    assert client.post(f"/team/members/{owner.membership.handle}/remove/").status_code == 422

    client.force_login(owner)
    assert client.post("/team/leave/").status_code == 422
    assert client.post("/team/", {"name": "Barn Owls"}).status_code == 302
    assert client.post(f"/team/members/{stranger.membership.handle}/remove/").status_code == 404
    confirm(client)
    assert client.post(f"/team/members/{teammate.membership.handle}/hand-over/").status_code == 302
    assert owners(team) == [teammate]
    assert client.post("/team/leave/").status_code == 302
    assert "No team yet" in pages.page(client.get("/team/")).one("main").text
    assert client.post("/team/leave/").status_code == 404


def test_who_would_leave_methods_to_nobody_says_that_they_know(
    client: Client, edition: Edition, owner: User
) -> None:
    builders.submit(owner, builders.predictions(edition))
    client.force_login(owner)
    response = client.post("/team/leave/")
    assert response.status_code == 422
    assert "the private methods become inaccessible" in pages.page(response).one("main").text
    confirm(client)
    assert client.post("/team/leave/", {"confirm": "on"}).status_code == 302
    assert teams.current_team_of(user=owner) is None


# --- the administration ------------------------------------------------------------------------------------


def test_administration_shows_no_secret_of_an_invitation_or_an_account_and_deletes_nobody(
    keeper: Client, edition: Edition, owner: User, stranger: User, team: Team
) -> None:
    builders.submit(owner, builders.predictions(edition), visibility="PRIVATE")
    invitation, secret = invitations.make(team=team, actor=owner, now=timezone.now())
    shown = keeper.get(f"/admin/leaderboard/invitation/{invitation.pk}/change/").content.decode()
    assert "_save" not in shown
    assert secret not in shown
    assert invitation.secret_hash not in shown
    shown = keeper.get(f"/admin/leaderboard/user/{owner.pk}/change/").content.decode()
    assert owner.email in shown
    assert owner.password not in shown
    assert keeper.post(f"/admin/leaderboard/user/{stranger.pk}/delete/", {"post": "yes"}).status_code == 403


def test_a_team_that_was_deleted_meanwhile_is_a_refusal(owner: User) -> None:
    team = teams.team_of(user=owner)
    Team.objects.filter(pk=team.pk).delete()
    with pytest.raises(Refused, match="was just deleted") as refusal:
        teams.rename(team=team, name="Later", actor=owner, now=timezone.now())
    assert refusal.value.code == "changed-meanwhile"
