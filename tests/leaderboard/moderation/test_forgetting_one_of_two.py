"""Of two people with one of everything, one is forgotten: all of theirs goes, and nothing of the other's."""

import json
from datetime import timedelta
from typing import Any

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.core import serializers
from django.db.models import Model, Q
from django.utils import timezone

from leaderboard import audit, board_versions
from leaderboard.models import (
    AccountChange,
    ApiToken,
    AuditEvent,
    AuditText,
    Edition,
    Invitation,
    Mail,
    Membership,
    OldAddress,
    Submission,
    Team,
    User,
)
from leaderboard.moderation import forgetting
from leaderboard.people import invitations, teams
from tests import builders

NOW = timezone.now()
# Tables with rows of a person, and how a row is known to be of one.
OF_PERSON: dict[type[Model], str] = {
    ApiToken: "user",
    AccountChange: "user",
    Authenticator: "user",
    EmailAddress: "user",
    Invitation: "created_by",
    Mail: "user",
    Membership: "user",
    SocialAccount: "user",
}


def equip(user: User) -> None:
    """One row in each table that knows people, and two where there may be two."""
    name = user.name
    for kind in ("first", "second"):
        EmailAddress.objects.create(
            user=user, email=f"{name}-{kind}@example.org", verified=kind == "first", primary=kind == "first"
        )
        builders.token(user)
    AccountChange.objects.create(user=user, what="email_changed", before=[f"{name}-former@example.org"])
    OldAddress.objects.create(address=f"{name}-former@example.org", mailbox=f"{name}-former@example.org")
    Authenticator.objects.create(user=user, type=Authenticator.Type.TOTP, data={})
    SocialAccount.objects.create(user=user, provider="github", uid=name, extra_data={"login": name})
    Mail.objects.create(kind="scored", user=user, recipient=user.email, text=name)
    Mail.objects.create(kind="scored", recipient=f"{name}-former@example.org", text=name)
    user.last_login, user.muted_kinds = NOW, "scored"
    user.save()
    teams.rename(team=teams.team_of(user=user), name=f"{name} and friends", actor=user, now=NOW)
    invitations.make(team=teams.team_of(user=user), actor=user, now=NOW)


def rows_of(user: User) -> dict[str, Any]:
    """What the tables have of a person, as it is stored."""
    own = [row for model, field in OF_PERSON.items() for row in model._base_manager.filter(**{field: user})]
    sent = Submission.objects.filter(submitted_by=user)
    texts = AuditText.objects.filter(actor=user)
    former = OldAddress.objects.filter(address__startswith=user.name or "-")
    mails = Mail.objects.filter(recipient__startswith=user.name or "-")
    account = User.objects.filter(pk=user.pk)
    rows = [*own, *sent, *texts, *former, *mails, *account]
    return {f"{row._meta.label} {row.pk}": serializers.serialize("json", [row]) for row in rows}


@pytest.fixture
def two(edition: Edition, owner: User, stranger: User) -> tuple[User, User]:
    for user, factor in ((owner, 1.1), (stranger, 1.2)):
        builders.submit(
            user, builders.predictions(edition, factor=factor), method=f"Of {user.name}", note="mine"
        )
        equip(user)
    return owner, stranger


def forget(user: User) -> None:
    forgetting.forget(user=user, reason="R", actor=user, now=timezone.now())


def test_nothing_of_the_other_person_changes(two: tuple[User, User]) -> None:
    owner, stranger = two
    before = rows_of(stranger)
    assert len(before) == 18
    forget(owner)
    assert rows_of(stranger) == before


def test_no_row_is_left_of_the_forgotten_person(two: tuple[User, User]) -> None:
    owner, _ = two
    forget(owner)
    left = {
        model.__name__: model._base_manager.filter(**{name: owner}).count()
        for model, name in OF_PERSON.items()
    }
    assert left == dict.fromkeys(left, 0)
    assert not OldAddress.objects.filter(address__startswith="Owls").exists()
    assert not Mail.objects.filter(recipient__startswith="Owls").exists()
    owner.refresh_from_db()
    assert (owner.name, owner.muted_kinds, owner.last_login, owner.is_active) == ("", "", None, False)
    assert owner.email == f"{owner.pk}@forgotten.invalid"
    assert not owner.has_usable_password()
    assert list(Submission.objects.filter(submitted_by=owner).values_list("note", "filename")) == [("", "")]


def test_names_that_others_gave_the_last_members_team_are_blanked(
    two: tuple[User, User], maintainer: User
) -> None:
    owner, stranger = two
    for user in (owner, stranger):
        team = teams.team_of(user=user)
        audit.record_of(team, "renamed", actor=maintainer, names={"to": f"The company of {user.name}"})
    forget(owner)
    texts = set(AuditText.objects.filter(actor=maintainer).values_list("text", flat=True))
    assert texts == {"", "The company of Strangers"}


def test_names_of_a_team_that_goes_on_stay(team: Team, owner: User, maintainer: User) -> None:
    audit.record_of(team, "renamed", actor=maintainer, names={"to": "The company"})
    forget(owner)
    assert AuditText.objects.get(actor=maintainer).text == "The company"


def test_whoever_joined_first_inherits_of_three_members(
    team: Team, owner: User, teammate: User, stranger: User
) -> None:
    # The order of the keys is another one than that of joining.
    Membership.objects.create(team=team, user=stranger, joined_at=NOW - timedelta(days=9))
    Membership.objects.filter(user=teammate).update(joined_at=NOW - timedelta(days=2))
    forget(owner)
    assert {row.user: row.is_owner for row in team.memberships.all()} == {stranger: True, teammate: False}


def test_a_team_keeps_its_owner_when_another_member_is_forgotten(
    team: Team, owner: User, teammate: User, stranger: User
) -> None:
    Membership.objects.create(team=team, user=stranger)
    forget(teammate)
    assert {row.user: row.is_owner for row in team.memberships.all()} == {owner: True, stranger: False}
    team.refresh_from_db()
    assert team.name == "Owls"


def test_boards_with_a_method_of_the_persons_team_are_new_and_no_others(
    two: tuple[User, User], tmp_path: Any
) -> None:
    val = builders.import_truth(tmp_path, split="val")
    builders.submit(two[1], builders.predictions(val), split="val", method="Elsewhere")
    before = {name: board_versions.number_of(name) for name in ("test", "val")}
    forget(two[0])
    assert board_versions.number_of("test") > before["test"]
    assert board_versions.number_of("val") == before["val"]


def test_who_is_forgotten_twice_is_written_down_once(two: tuple[User, User]) -> None:
    for _ in range(2):
        forget(two[0])
    event = AuditEvent.objects.get(verb="forgotten")
    assert event.noun_id == str(two[0].pk)
    assert event.details["reason"] == "R"


def test_a_closed_account_can_still_be_forgotten(two: tuple[User, User]) -> None:
    User.objects.filter(pk=two[0].pk).update(is_active=False)
    forget(User.objects.get(pk=two[0].pk))
    assert User.objects.get(pk=two[0].pk).email.endswith("@forgotten.invalid")


def test_the_export_has_what_is_of_the_person_and_nothing_of_another(two: tuple[User, User]) -> None:
    owner, stranger = two
    exported = {user: json.dumps(forgetting.export(user=user)) for user in two}
    for user, other in ((owner, stranger), (stranger, owner)):
        assert user.name in exported[user]
        assert other.name not in exported[user]
    document = forgetting.export(user=owner)
    counts = {name: len(rows) for name, rows in document.items() if isinstance(rows, list)}
    n_events = AuditEvent.objects.filter(actor=owner).count()
    assert counts == {
        "submissions": 1, "tokens": 2, "second_factor": 1, "connected_accounts": 1, "invitations": 1,
        "changes_of_the_account": 1, "mails_not_wanted": 1, "audit_log": n_events,
    }  # fmt: skip
    assert {row["email"] for row in document["account"]["addresses"]} == {
        "Owls-first@example.org", "Owls-second@example.org",
    }  # fmt: skip
    assert document["team"]["name"] == "Owls and friends"
    assert [row["at"] for row in document["changes_of_the_account"]] == [
        row.at.isoformat() for row in owner.changes.all()
    ]


def test_the_export_has_the_invitation_that_the_person_accepted(
    two: tuple[User, User], maintainer: User
) -> None:
    invitation = Invitation.objects.get(created_by=two[1])
    Invitation.objects.filter(pk=invitation.pk).update(accepted_by=two[0], accepted_at=NOW)
    teams_of_invitations = {row["team"] for row in forgetting.export(user=two[0])["invitations"]}
    assert teams_of_invitations == {str(teams.team_of(user=user).pk) for user in two}
    assert forgetting.export(user=maintainer)["invitations"] == []


def test_names_that_the_person_gave_or_had_are_blanked_and_those_of_another_stay(
    two: tuple[User, User], maintainer: User
) -> None:
    owner, stranger = two
    for user in two:
        audit.record_of(user, "renamed", actor=maintainer, names={"to": f"Dr {user.name}"})
    gave, had = ({"actor": owner}, {"noun": "User", "noun_id": str(owner.pk)})
    of_stranger = Q(actor=stranger) | Q(noun="User", noun_id=str(stranger.pk))
    before = set(AuditText.objects.filter(of_stranger).values_list("pk", "text"))
    assert "" not in {text for _, text in before}
    forget(owner)
    for fields in (gave, had):
        assert set(AuditText.objects.filter(**fields).values_list("text", flat=True)) == {""}
    assert set(AuditText.objects.filter(of_stranger).values_list("pk", "text")) == before


def test_mails_of_the_person_to_an_address_that_was_never_theirs_go_and_those_of_another_stay(
    two: tuple[User, User],
) -> None:
    for user in two:
        Mail.objects.create(kind="scored", user=user, recipient="desk@example.org", text=user.name)
    forget(two[0])
    left = Mail.objects.filter(recipient="desk@example.org")
    assert [mail.user for mail in left] == [two[1]]


def test_late_rows_of_a_forgotten_account_go_and_a_closed_one_keeps_its_own(two: tuple[User, User]) -> None:
    owner, stranger = two
    User.objects.filter(pk=stranger.pk).update(is_active=False)
    before = rows_of(stranger)
    forget(owner)
    EmailAddress.objects.create(user=owner, email="late@example.org")
    Authenticator.objects.create(user=owner, type=Authenticator.Type.TOTP, data={})
    SocialAccount.objects.create(user=owner, provider="github", uid="late")
    forgetting.delete_late_rows()
    for model in (EmailAddress, Authenticator, SocialAccount):
        assert not model.objects.filter(user=owner).exists()
        assert model.objects.filter(user=stranger).exists()
    assert rows_of(stranger) == before
