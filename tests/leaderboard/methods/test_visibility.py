"""Who sees a method: private, anonymous, public, and the way from one to the next."""

import json
import random
import re
from datetime import timedelta
from typing import Any

import pytest
from django.contrib.auth.models import AnonymousUser
from django.test import Client
from django.utils import timezone

from leaderboard.boards import listing
from leaderboard.boards.rows import Entry
from leaderboard.errors.refusals import Refused
from leaderboard.methods import visibility
from leaderboard.methods.details import stated
from leaderboard.models import (
    AuditEvent,
    BoardVersion,
    Method,
    Split,
    Submission,
    User,
    Visibility,
)
from leaderboard.people import teams
from leaderboard.submissions import intake
from leaderboard.upkeep import pollers
from tests import builders, pages

ANYBODY = AnonymousUser()
SECRETS = (
    *("Owls", "owner@example.org", "Secret sauce", "Words of its own"),
    *("secret-paper", "secret-code", "Laptop of Ada", "WebText of Ada"),
)


def split() -> Split:
    return Split.objects.select_related("current_edition__ground_truth").get(pk="test")


def rows(viewer: Any = ANYBODY) -> dict[str, Entry]:
    return {entry.method: entry for entry in listing.board(split=split(), viewer=viewer).entries}


def change(method: Method, to: str, actor: User, **options: Any) -> Method:
    return visibility.change(method=method, visibility=to, actor=actor, now=timezone.now(), **options)


# --- private -----------------------------------------------------------------------------------------------
# That no address shows what is hidden is proved in tests/security/test_non_interference.py.


@pytest.mark.slow
def test_a_new_method_is_private_and_seen_by_its_team_alone(
    client: Client, method: Method, owner: User, teammate: User, stranger: User
) -> None:
    assert (method.visibility, method.shown_at) == (Visibility.PRIVATE, None)
    for reader in (ANYBODY, stranger):
        assert "Secret sauce" not in rows(reader)
    for member in (owner, teammate):
        entry = rows(member)["Secret sauce"]
        assert (entry.rank, entry.is_mine, entry.is_visible_to_all) == (1, True, False)
        client.force_login(member)
        assert "only your team" in pages.page(client.get(f"/methods/{method.pk}/")).one("main").text


def test_a_private_method_moves_no_number_that_counts_changes(sent: Submission) -> None:
    number = BoardVersion.objects.filter(split="test").values_list("number", flat=True).first()
    builders.submit(sent.submitted_by, b"{}", method="Another", visibility="PRIVATE")
    builders.score_all()
    intake.withdraw(submission=sent, actor=sent.submitted_by, now=timezone.now())
    assert BoardVersion.objects.filter(split="test").values_list("number", flat=True).first() == number


# --- anonymous ---------------------------------------------------------------------------------------------


def test_an_anonymous_method_shows_numbers_and_nothing_of_whose_it_is(
    client: Client, method: Method, owner: User, teammate: User, stranger: User
) -> None:
    change(method, "ANONYMOUS", owner)
    assert re.fullmatch(r"Anonymous [0-9a-f]{6}", method.pseudonym)
    for reader in (ANYBODY, stranger):
        entry = rows(reader)[method.pseudonym]
        assert (entry.rank, entry.team, entry.n_attempts) == (1, "Anonymous", 1)
        assert (entry.description, entry.paper_url, entry.code_url) == ("", "", "")
        assert entry.details == stated(n_frames=6, latency_ms=12.5, cameras="ONE")
    assert pages.page(client.get(f"/methods/{method.pk}/")).one("h1").text == method.pseudonym
    document = client.get(f"/api/v1/methods/{method.pk}").json()
    assert (document["name"], document["team"], document["shown_at"]) == (method.pseudonym, "Anonymous", None)
    for member in (owner, teammate):
        entry = rows(member)["Secret sauce"]
        assert (entry.pseudonym, entry.team, entry.is_visible_to_all) == (method.pseudonym, "Owls", True)
        assert len(rows(member)) == len(rows())


# --- a board as of a time ----------------------------------------------------------------------------------


def test_a_board_as_of_a_time_shows_what_was_shown_then(method: Method, owner: User, stranger: User) -> None:
    before = timezone.now()
    change(method, "PUBLIC", owner)
    after = timezone.now()

    def names(viewer: Any, at: Any) -> list[str]:
        return [entry.method for entry in listing.board(split=split(), viewer=viewer, at=at).entries]

    for reader in (ANYBODY, stranger):
        assert "Secret sauce" not in names(reader, before)
        assert "Secret sauce" in names(reader, after)
    own = listing.board(split=split(), viewer=owner, at=before).entries
    assert [entry.visibility for entry in own if entry.method == "Secret sauce"] == [Visibility.PRIVATE]


# --- leaving private ---------------------------------------------------------------------------------------


def test_only_the_team_shows_a_method_and_the_trail_records_it(
    method: Method, owner: User, teammate: User, stranger: User, maintainer: User
) -> None:
    for other in (stranger, maintainer):
        with pytest.raises(Refused, match="Only the team"):
            change(method, "PUBLIC", other)
    number = BoardVersion.objects.get(split="test").number
    change(method, "ANONYMOUS", teammate)
    change(method, "ANONYMOUS", teammate)
    change(method, "PUBLIC", owner)
    assert BoardVersion.objects.get(split="test").number == number + 2
    events = AuditEvent.objects.filter(verb="shown").order_by("pk")
    changes = [(e.actor, e.details["from"], e.details["to"]) for e in events]
    assert changes == [(teammate, "PRIVATE", "ANONYMOUS"), (owner, "ANONYMOUS", "PUBLIC")]


@pytest.mark.parametrize(
    ("now_is", "to", "code"),
    [
        ("PUBLIC", "PRIVATE", "bad-value"),
        ("PUBLIC", "ANONYMOUS", "shown-for-good"),
        ("ANONYMOUS", "SECRET", "bad-value"),
    ],
)
def test_there_is_no_way_back(method: Method, owner: User, now_is: str, to: str, code: str) -> None:
    if now_is != "PRIVATE":
        change(method, now_is, owner)
    with pytest.raises(Refused) as refusal:
        change(method, to, owner)
    assert refusal.value.code == code
    assert Method.objects.get().visibility == now_is


@pytest.mark.parametrize("days", [-1, 0, 731])
def test_a_date_of_reveal_is_to_come_and_not_too_far(method: Method, owner: User, days: int) -> None:
    with pytest.raises(Refused, match="at most 730 days from now"):
        change(method, "ANONYMOUS", owner, reveal_at=timezone.now() + timedelta(days=days))
    with pytest.raises(Refused, match="becomes public at once; expected no date"):
        change(method, "PUBLIC", owner, reveal_at=timezone.now() + timedelta(days=1))


def test_the_sweep_reveals_what_is_due_once_and_nothing_else(method: Method, owner: User) -> None:
    now = timezone.now()
    change(method, "ANONYMOUS", owner, reveal_at=now + timedelta(days=3))
    assert visibility.reveal_due(now=now + timedelta(days=2)) == 0
    Method.objects.update(reveal_at=now - timedelta(seconds=1))
    pollers.sweep(rng=random.Random(0))
    pollers.sweep(rng=random.Random(0))
    method.refresh_from_db()
    assert (method.visibility, method.reveal_at) == (Visibility.PUBLIC, None)
    (event,) = AuditEvent.objects.filter(verb="revealed")
    assert (event.noun_id, event.actor) == (str(method.pk), None)
    assert "Secret sauce" in rows()


def test_a_withdrawn_entry_of_a_shown_method_leaves_a_stone(
    sent: Submission, method: Method, owner: User
) -> None:
    change(method, "PUBLIC", owner)
    intake.withdraw(submission=sent, actor=owner, now=timezone.now())
    entry = rows()["Secret sauce"]
    assert (entry.rank, entry.scores["mid"], entry.n_attempts) == (None, None, 1)
    assert entry.withdrawn_at


@pytest.mark.slow
def test_an_anonymous_method_offers_to_be_made_public(
    client: Client, sent: Submission, method: Method, owner: User
) -> None:
    change(method, "ANONYMOUS", owner)
    client.force_login(owner)
    for address in (f"/methods/{method.pk}/", f"/submissions/{sent.pk}/"):
        words = [a.text for a in pages.get(client, address).one("main").all("a")]
        assert "Make public…" in words
        assert "Publish…" not in words
    page = pages.get(client, f"/methods/{method.pk}/visibility/")
    assert page.one("main").one("h1").text == "Make “Secret sauce” public"
    radios = page.all("input", type="radio")
    assert not [radio for radio in radios if "checked" in radio.attributes], "it has no way back"
    response = client.get(f"/methods/{method.pk}/visibility/", {"visibility": "ANONYMOUS"})
    assert (response.status_code, "reveal_on" in response.context["form"].errors) == (422, True)
    later = f"{timezone.now() + timedelta(days=9):%Y-%m-%d}"
    asked = {"visibility": "ANONYMOUS", "reveal_on": later}
    assert client.get(f"/methods/{method.pk}/visibility/", asked).status_code == 200
    change(method, "ANONYMOUS", owner, reveal_at=timezone.now() + timedelta(days=9))
    page = pages.get(client, f"/methods/{method.pk}/visibility/")
    (marked,) = [radio for radio in page.all("input", type="radio") if "checked" in radio.attributes]
    assert marked.attributes["value"] == "ANONYMOUS"


# --- the page ----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_page_shows_what_others_will_see_asks_and_shows_it(
    client: Client, sent: Submission, method: Method, owner: User
) -> None:
    client.force_login(owner)
    outcome = pages.page(client.get(f"/submissions/{sent.pk}/")).one("div", id="outcome")
    (link,) = [a for a in outcome.all("a") if a.text == "Publish…"]
    address = link.attributes["href"]
    assert "I understand that this cannot be undone" not in pages.page(client.get(address)).one("main").text
    main = pages.page(client.get(address, {"visibility": "PUBLIC"})).one("main").text
    for words in (
        "Secret sauce",
        "Owls",
        "rank 1 of 6",
        "Attempts shown: 1 (",
        "This cannot be undone:",
        "12.5",
    ):
        assert words in main
    masked = pages.page(client.get(address, {"visibility": "ANONYMOUS"})).one("section").text
    assert method.pseudonym in masked
    assert not [secret for secret in SECRETS if secret in masked]
    response = client.post(address, {"visibility": "PUBLIC"})
    assert response.status_code == 422
    assert "Confirm that this cannot be undone" in pages.page(response).one("main").text
    assert Method.objects.get().visibility == Visibility.PRIVATE
    response = client.post(address, {"visibility": "PUBLIC", "confirm": "on"}, follow=True)
    assert "Secret sauce is now public." in pages.page(response).one("main").text
    assert Method.objects.get().visibility == Visibility.PUBLIC
    left = pages.page(client.get(address)).one("main")
    assert "Everyone sees the method. It cannot become anonymous or private again." in left.text
    assert left.all("form") == []


@pytest.mark.slow
def test_preview_of_a_method_that_has_become_anonymous_meanwhile_is_confirmed_again(
    client: Client, sent: Submission, method: Method, owner: User
) -> None:
    client.force_login(owner)
    address = f"/methods/{method.pk}/visibility/"
    early = confirmed(pages.page(client.get(address, {"visibility": "PUBLIC"})))
    change(method, "ANONYMOUS", owner)
    response = client.post(address, early)
    assert response.status_code == 422
    words = pages.page(response).one("div", id="id_confirm_error").text
    assert words == "The method has become anonymous meanwhile: read this page again."
    assert Method.objects.get().visibility == Visibility.ANONYMOUS
    assert client.post(address, confirmed(pages.page(response))).status_code == 302
    assert Method.objects.get().visibility == Visibility.PUBLIC


def confirmed(page: pages.Element) -> dict[str, str]:
    """The fields of the preview's form with its box ticked."""
    hidden = [each.attributes for each in page.all("form")[-1].all("input", type="hidden")]
    return {each["name"]: each["value"] for each in hidden} | {"confirm": "on"}


# --- the API -----------------------------------------------------------------------------------------------


def ask(client: Client, method: Method, token: str, body: Any) -> tuple[int, dict[str, Any]]:
    data = body if isinstance(body, str) else json.dumps(body)
    response = client.post(
        f"/api/v1/methods/{method.pk}/visibility",
        data,
        content_type="application/json",
        headers={"Authorization": f"Bearer {token}"},
    )
    return response.status_code, response.json()


def test_program_shows_a_method_when_it_says_that_it_means_it(
    client: Client, method: Method, owner: User, stranger: User
) -> None:
    token = builders.token(owner)
    status, answer = ask(client, method, token, {"visibility": "PUBLIC"})
    assert (status, answer["code"], answer["problems"][0]["where"]) == (422, "not-confirmed", "confirm")
    assert ask(client, method, builders.token(stranger), {"visibility": "PUBLIC", "confirm": True})[0] == 404
    submitting = builders.token(owner, scopes=["read", "submit"])
    status, answer = ask(client, method, submitting, {"visibility": "PUBLIC", "confirm": True})
    assert (status, answer["code"]) == (403, "token-scope")
    of_one_split = builders.token(owner, split_name="test")
    assert ask(client, method, of_one_split, {"visibility": "PUBLIC", "confirm": True})[0] == 403
    later = (timezone.now() + timedelta(days=9)).isoformat()
    status, answer = ask(
        client, method, token, {"visibility": "ANONYMOUS", "reveal_at": later, "confirm": True}
    )
    assert (status, answer["visibility"], answer["name"]) == (200, "ANONYMOUS", "Secret sauce")
    assert answer["reveal_at"][:10] == later[:10]
    status, answer = ask(client, method, token, {"visibility": "PUBLIC", "confirm": True})
    assert (status, answer["visibility"], answer["reveal_at"]) == (200, "PUBLIC", None)
    status, answer = ask(client, method, token, {"visibility": "PRIVATE", "confirm": True})
    assert (status, answer["code"]) == (422, "bad-value")


@pytest.mark.parametrize(
    "body",
    [
        *("null", "{", '{"visibility": 5, "confirm": true}', "[" * 2000, '{"confirm": "yes"}'),
        '{"visibility": "ANONYMOUS", "reveal_at": "soon", "confirm": true}',
        '{"visibility": "ANONYMOUS", "reveal_at": 1e999, "confirm": true}',
        '{"visibility": "ANONYMOUS", "reveal_at": "0001-01-01T00:00:00+14:00", "confirm": true}',
    ],
)
def test_nonsense_is_refused_and_changes_nothing(
    client: Client, method: Method, owner: User, body: str
) -> None:
    status, answer = ask(client, method, builders.token(owner), body)
    assert status in {400, 422}, answer
    assert Method.objects.get().visibility == Visibility.PRIVATE


# --- names of others ---------------------------------------------------------------------------------------


def test_method_cannot_be_published_under_the_name_of_a_quoted_row(
    client: Client, method: Method, owner: User
) -> None:
    Method.objects.filter(pk=method.pk).update(name="Deep Scаle")
    method.refresh_from_db()
    client.force_login(owner)
    with pytest.raises(Refused) as refused:
        change(method, Visibility.PUBLIC, owner)
    assert (refused.value.code, refused.value.field) == ("name-taken", "visibility")
    assert "The boards already have a method 'Deep Scale'" in str(refused.value)
    page = client.get(f"/methods/{method.pk}/visibility/?visibility=PUBLIC")
    assert page.status_code == 422
    assert b"The boards already have a method" in page.content
    method.refresh_from_db()
    assert method.visibility == Visibility.PRIVATE


def test_method_cannot_be_published_under_the_name_of_another_public_method(
    method: Method, owner: User, stranger: User
) -> None:
    change(method, Visibility.PUBLIC, owner)
    other = Method.objects.create(team=teams.team_of(user=stranger), name="Secret Sauce")
    with pytest.raises(Refused, match="'Secret sauce', and 'Secret Sauce' looks like it"):
        change(other, Visibility.PUBLIC, stranger)
    # Under a pseudonym it takes nobody's name.
    assert change(other, Visibility.ANONYMOUS, stranger).visibility == Visibility.ANONYMOUS


def test_taken_name_gets_a_number_where_a_method_becomes_public_by_itself(
    method: Method, owner: User
) -> None:
    now = timezone.now()
    change(method, Visibility.ANONYMOUS, owner, reveal_at=now + timedelta(days=1))
    Method.objects.filter(pk=method.pk).update(name="Deep Scale")
    # The team has the next name itself: a second one would stop every later sweep.
    Method.objects.create(team=method.team, name="Deep Scale 2")
    assert visibility.reveal_due(now=now + timedelta(days=2)) == 1
    method.refresh_from_db()
    assert (method.name, method.visibility) == ("Deep Scale 3", Visibility.PUBLIC)
    renamed = AuditEvent.objects.get(verb="renamed", noun_id=str(method.pk))
    assert renamed.details["reason"] == "another method used this name on the boards first"
