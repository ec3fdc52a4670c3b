"""Moderation and forgetting: a name is gone wherever it stood, and nothing that is left names the person."""

import json
from uuid import UUID

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.core import serializers
from django.db.models import CharField, TextField
from django.test import Client
from django.utils import timezone

from leaderboard import audit
from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.methods import editing
from leaderboard.models import (
    AuditEvent,
    AuditText,
    Edition,
    Mail,
    Membership,
    Method,
    Submission,
    Team,
    User,
)
from leaderboard.moderation import forgetting, hiding
from leaderboard.people import teams
from leaderboard.upkeep import pollers
from leaderboard.web.maintain.moderation_views import ACTIONS
from tests import builders
from tests.leaderboard.web.maintain.desk import get
from tests.leaderboard.web.test_every_page import assert_sound

PUBLIC = (
    *("/", "/board/test/", "/board/test.csv", "/board/test.tex", "/board/test.bib", "/board/test/feed.atom"),
    *("/feed.atom", "/api/v1/splits/test/board", "/board/test/?q=rude", "/board/test/charts/", "/compare/"),
    *("/board/test/editions/1/", "/board/test/editions/1.csv", "/board/test.json"),
)


def published(edition: Edition, owner: User, *, method: str = "Rude Name") -> Submission:
    made = builders.submit(owner, builders.predictions(edition), method=method)
    builders.score_all()
    return made


def addresses_with(client: Client, name: str, *more: str) -> list[str]:
    """The addresses at which visitors read this text."""
    return [
        address for address in (*PUBLIC, *more) if name in client.get(address).text.replace("?q=rude", "")
    ]


def do(keeper: Client, action: str, subject: object, **fields: str) -> None:
    address = f"/maintain/actions/{action}/{subject}/"
    assert_sound(keeper.get(address))
    refused = keeper.post(address, {"confirm": "on", **fields, "reason": ""})
    assert refused.status_code == 422
    assert "No reason was given" in assert_sound(refused).one("div", class_="wrong").text
    answer = keeper.post(address, {"reason": "A complaint.", "confirm": "on", **fields})
    assert answer.status_code == 302, assert_sound(answer).one("main").text
    assert ACTIONS[action].done in assert_sound(keeper.get(answer.headers["Location"])).text


def test_each_action_says_in_its_own_words_that_it_is_done() -> None:
    sentences = {name: action.done for name, action in ACTIONS.items()}
    assert len(set(sentences.values())) == len(ACTIONS)
    assert sentences["rename-method"] == "The method is renamed."
    assert sentences["close-account"] == "The account is closed."


@pytest.mark.slow
def test_renamed_and_masked_names_are_gone_from_board_exports_feed_search_and_the_past(
    keeper: Client, edition: Edition, owner: User, teammate: User
) -> None:
    sent = published(edition, owner)
    visitor, at = Client(), f"{timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"
    past = (f"/board/test/?at={at}", f"/board/test.csv?at={at}", f"/methods/{sent.method_id}/")
    assert len(addresses_with(visitor, "Rude Name", *past)) >= 10
    assert len(addresses_with(visitor, "Owls", *past)) >= 8
    do(keeper, "rename-method", sent.method_id, how="mask")
    do(keeper, "rename-team", sent.method.team_id, how="rename", name="Polite Owls 2")
    assert addresses_with(visitor, "Rude Name", *past) == []
    assert addresses_with(visitor, f"Method {sent.method_id.hex[:6]}", *past) != []
    assert "Polite Owls 2" in visitor.get("/board/test/").text
    # The audit log has the names beside it, for maintainers.
    page = get(keeper, f"/maintain/audit/?noun_id={sent.method_id}").one("main").text
    assert "Rude Name" in page
    assert "Rude" not in json.dumps(list(AuditEvent.objects.values_list("details", flat=True)))
    assert "A complaint." in page
    team = get(keeper, f"/maintain/teams/{sent.method.team_id}/").one("main").text
    assert "teammate@example.org" in team


def test_to_mask_a_name_is_a_choice_and_not_an_empty_field(
    keeper: Client, edition: Edition, owner: User
) -> None:
    sent = published(edition, owner)
    answer = keeper.post(
        f"/maintain/actions/rename-method/{sent.method_id}/", {"reason": "A complaint.", "how": "rename"}
    )
    wrong = assert_sound(answer).one("div", id="id_name_error").text
    assert wrong == "No new name was given; expected one, or to mask the present one."


def test_what_cannot_be_undone_asks_maintainers_for_the_tick(
    keeper: Client, edition: Edition, owner: User
) -> None:
    sent = published(edition, owner)
    answer = keeper.post(f"/maintain/actions/hide/{sent.pk}/", {"reason": "A complaint."})
    wrong = assert_sound(answer).one("div", id="id_confirm_error").text
    assert wrong == "Confirm that this cannot be undone: tick the box."
    sent.refresh_from_db()
    assert sent.hidden_at is None


def test_what_a_maintainer_deletes_is_red_where_it_is_offered_and_asked(
    keeper: Client, edition: Edition, owner: User
) -> None:
    sent = published(edition, owner)
    team = get(keeper, f"/maintain/teams/{sent.method.team_id}/")
    for action, subject in (("clear-texts", sent.method_id), ("hide", sent.pk), ("withdraw", sent.pk)):
        address = f"/maintain/actions/{action}/{subject}/"
        assert team.one("a", href=address).attributes["class"] == "as-link danger"
        assert get(keeper, address).one("main").one("button").attributes["class"] == "danger"
    rename = f"/maintain/actions/rename-method/{sent.method_id}/"
    assert "class" not in team.one("a", href=rename).attributes
    assert "class" not in get(keeper, rename).one("main").one("button").attributes


@pytest.mark.slow
def test_a_hidden_entry_leaves_boards_of_all_times_and_a_withdrawn_one_its_values(
    keeper: Client, edition: Edition, owner: User
) -> None:
    sent = published(edition, owner, method="Kept")
    at = f"{timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"
    do(keeper, "withdraw", sent.pk)
    assert "Kept" in Client().get("/board/test.json").text or "Kept" in Client().get("/board/test/").text
    do(keeper, "hide", sent.pk)
    assert "Kept" not in Client().get("/board/test/").text
    assert "Kept" not in Client().get(f"/board/test.csv?at={at}").text
    with pytest.raises(Refused, match="withdrawn already"):
        hiding.withdraw_entry(submission=sent, reason="R", actor=None, now=timezone.now(), is_hidden=True)
    assert set(
        AuditEvent.objects.filter(noun="Submission", noun_id=sent.pk).values_list("verb", flat=True)
    ) >= {
        "withdrawn",
        "hidden",
    }


def test_a_withdrawal_is_offered_where_there_are_scores_to_remove(
    keeper: Client, edition: Edition, owner: User
) -> None:
    scored = builders.submit(owner, builders.predictions(edition), method="Kept")
    rejected = builders.submit(owner, b"{}", method="Broken")
    builders.score_all()
    links = [a.attributes["href"] for a in get(keeper, f"/maintain/teams/{scored.method.team_id}/").all("a")]
    assert f"/maintain/actions/withdraw/{scored.pk}/" in links
    assert f"/maintain/actions/withdraw/{rejected.pk}/" not in links
    assert f"/maintain/actions/hide/{rejected.pk}/" in links


@pytest.mark.slow
def test_a_method_moves_to_another_team_with_its_submissions(
    keeper: Client, edition: Edition, owner: User, stranger: User
) -> None:
    sent = published(edition, owner, method="Moves")
    other = teams.team_of(user=stranger)
    refused = keeper.post(
        f"/maintain/actions/move-method/{sent.method_id}/", {"name": "Nobody", "reason": "They asked."}
    )
    assert "No team is called 'Nobody'" in assert_sound(refused).one("div", class_="wrong").text
    do(keeper, "move-method", sent.method_id, name=other.name)
    assert Method.objects.get(pk=sent.method_id).team == other
    row = next(
        e for e in Client().get("/api/v1/splits/test/board").json()["entries"] if e["method"] == "Moves"
    )
    assert row["team"] == other.name
    do(keeper, "clear-texts", sent.method_id)


def test_a_closed_account_signs_in_nowhere_until_it_is_opened(
    keeper: Client, client: Client, team: Team, teammate: User, maintainer: User
) -> None:
    do(keeper, "close-account", teammate.pk)
    assert not Client().login(email=teammate.email, password="correct horse")
    do(keeper, "open-account", teammate.pk)
    assert Client().login(email=teammate.email, password="correct horse")
    with pytest.raises(Refused, match="your own account"):
        hiding.set_active(user=maintainer, is_active=False, reason="R", actor=maintainer)


def test_only_maintainers_moderate(owner: User, stranger: User, team: Team) -> None:
    with pytest.raises(NotMaintainer):
        hiding.rename_team(team=team, name="X", reason="R", actor=stranger, now=timezone.now())
    with pytest.raises(NotMaintainer):
        forgetting.forget(user=owner, reason="R", actor=stranger, now=timezone.now())


def test_a_maintainer_makes_a_member_the_owner(
    keeper: Client, team: Team, owner: User, teammate: User, stranger: User, maintainer: User
) -> None:
    User.objects.filter(pk=owner.pk).update(is_active=False)
    do(keeper, "appoint-owner", teammate.pk)
    assert Membership.objects.get(team=team, is_owner=True).user == teammate
    event = AuditEvent.objects.get(verb="appointed_owner")
    assert (event.actor, event.details["from"]) == (maintainer, [owner.pk])
    answer = keeper.post(f"/maintain/actions/appoint-owner/{stranger.pk}/", {"reason": "R"})
    assert "The person is in no team" in assert_sound(answer).one("div", class_="form-errors").text


def test_a_maintainer_revokes_all_tokens_of_a_person(keeper: Client, owner: User, maintainer: User) -> None:
    headers = {"Authorization": f"Bearer {builders.token(owner)}"}
    assert Client().get("/api/v1/quota", headers=headers).status_code == 200
    do(keeper, "revoke-tokens", owner.pk)
    assert Client().get("/api/v1/quota", headers=headers).status_code == 401
    event = AuditEvent.objects.get(verb="revoked")
    assert (event.actor, event.details["how"]) == (maintainer, "by a maintainer: A complaint.")


# --- forgetting ------------------------------------------------------------------------------------------


def everything() -> str:
    """All rows of all tables that could name a person."""
    tables = [User, Team, Mail, Submission, AuditEvent, AuditText, EmailAddress, Method]
    return "".join(serializers.serialize("json", model._base_manager.all()) for model in tables)


@pytest.mark.slow
def test_a_forgotten_person_is_named_nowhere_and_their_scores_stay(
    edition: Edition, owner: User, keeper: Client
) -> None:
    sent = published(edition, owner, method="Stays")
    Submission.objects.filter(pk=sent.pk).update(note="by ada", filename="ada.json")
    EmailAddress.objects.create(user=owner, email="second@example.org")
    team = teams.team_of(user=owner)
    teams.rename(team=team, name="Ada Lovelace", actor=owner, now=timezone.now())
    builders.token(owner)
    Mail.objects.create(kind="scored", recipient="second@example.org", subject="Ada Lovelace", text="T")
    audit.seal()
    client = Client()
    client.force_login(owner)
    do(keeper, "forget-person", owner.pk)
    left = everything()
    assert [
        text for text in ("owner@", "second@", "Lovelace", "Owls", "ada.json", "by ada") if text in left
    ] == []
    assert audit.verify().breaks == ()
    audit.seal()
    assert audit.verify().breaks == ()
    board = Client().get("/board/test/").text
    assert "Stays" in board
    assert "Lovelace" not in board
    assert client.get("/submissions/").status_code == 302  # the session has ended
    assert not Membership.objects.filter(user=owner).exists()


def test_every_text_of_a_submission_is_exported_and_forgotten(edition: Edition, owner: User) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    fields = [field for field in Submission._meta.get_fields() if isinstance(field, CharField | TextField)]
    texts = dict.fromkeys((field.name for field in fields if field.blank), "by ada")
    Submission.objects.filter(pk=submission.pk).update(**texts)
    [row] = forgetting.export(user=owner)["submissions"]
    message = "name it in leaderboard/moderation/forgetting.py"
    assert {name: row.get(name) for name in texts} == texts, message
    forgetting.forget(user=owner, reason="R", actor=owner, now=timezone.now())
    assert Submission.objects.filter(**dict.fromkeys(texts, "")).exists(), message


def test_a_team_goes_on_without_its_owner(team: Team, owner: User, teammate: User) -> None:
    forgetting.forget(user=owner, reason="R", actor=owner, now=timezone.now())
    team.refresh_from_db()
    assert team.name == "Owls"
    assert Membership.objects.get(team=team, is_owner=True).user == teammate


@pytest.mark.slow
def test_the_account_page_exports_and_deletes(signed_in: Client, edition: Edition, owner: User) -> None:
    published(edition, owner)
    answer = signed_in.get("/account/data.json")
    document = answer.json()
    assert document["account"]["email"] == "owner@example.org"
    assert [row["method"] for row in document["submissions"]] == ["Rude Name"]
    assert "attachment" in answer.headers["Content-Disposition"]
    assert_sound(signed_in.get("/account/data/"))
    wrong = signed_in.post("/account/data/", {"email": "other@example.org"})
    assert "another address" in assert_sound(wrong).one("div", class_="wrong").text
    # Whoever finds an open session reads the address on the page, but does not know the password.
    asked = signed_in.post("/account/data/", {"email": "Owner@example.org"})
    assert asked.headers["Location"] == "/accounts/reauthenticate/?next=%2Faccount%2Fdata%2F"
    assert "deleting your account" in assert_sound(signed_in.get(asked.headers["Location"])).text
    signed_in.post("/accounts/reauthenticate/", {"password": "wrong", "next": "/account/data/"})
    assert User.objects.filter(email="owner@example.org").exists()
    # The password sends the form that was filled in.
    form = {"password": "correct horse", "next": "/account/data/"}
    assert signed_in.post("/accounts/reauthenticate/", form).headers["Location"] == "/"
    assert not User.objects.filter(email="owner@example.org").exists()
    assert "Your account is deleted." in signed_in.get("/").text
    assert signed_in.get("/account/data.json").status_code == 302


def test_a_maintainer_is_not_forgotten_by_accident(maintainer: User) -> None:
    with pytest.raises(Refused, match="another maintainer ends the role first"):
        forgetting.forget(user=maintainer, reason="R", actor=maintainer, now=timezone.now())


def test_what_is_written_into_a_blank_account_is_deleted_with_the_next_cleaning(
    edition: Edition, owner: User, stranger: User
) -> None:
    EmailAddress.objects.create(user=stranger, email="stays@example.org")
    forgetting.forget(user=owner, reason="R", actor=owner, now=timezone.now())
    EmailAddress.objects.create(user=owner, email="late@example.org")
    Authenticator.objects.create(user=owner, type=Authenticator.Type.TOTP, data={})
    SocialAccount.objects.create(user=owner, provider="github", uid="42")
    pollers.clean(now=timezone.now())
    assert list(EmailAddress.objects.values_list("email", flat=True)) == ["stays@example.org"]
    assert not Authenticator.objects.exists()
    assert not SocialAccount.objects.exists()


def test_the_export_names_no_method_of_a_team_that_the_person_has_left(
    edition: Edition, owner: User, teammate: User
) -> None:
    for name, visibility in (("Hers", "PRIVATE"), ("Masked", "ANONYMOUS"), ("Shown", "PUBLIC")):
        builders.submit(
            teammate,
            builders.predictions(edition, factor=1 + len(name) / 10),
            method=name,
            visibility=visibility,
            note="my note",
        )

    def exported_names() -> dict[str, object]:
        rows = forgetting.export(user=teammate)["submissions"]
        assert {(row["note"], row["filename"]) for row in rows} == {("my note", "predictions.json")}
        return {row["method_id"]: row["method"] for row in rows}

    ids = {method.name: str(method.pk) for method in Method.objects.all()}
    assert exported_names() == {pk: name for name, pk in ids.items()}
    teams.leave(user=teammate)
    editing.edit(method=Method.objects.get(name="Hers"), changes={"name": "NextGenSecret"}, actor=owner)
    assert exported_names() == {ids["Hers"]: None, ids["Masked"]: None, ids["Shown"]: "Shown"}


def test_a_neutral_name_has_the_noun_and_the_begin_of_the_key() -> None:
    assert hiding.masked("Team", UUID(int=0x3F9C2A << 104)) == "Team 3f9c2a"
