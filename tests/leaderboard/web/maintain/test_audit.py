"""The audit log as maintainers look through it and take it along."""

import ast
import json
import re
from dataclasses import replace
from datetime import UTC, timedelta
from io import StringIO
from pathlib import Path

import pytest
from django.core.management import CommandError, call_command
from django.http import HttpResponseBase, StreamingHttpResponse
from django.test import Client

import leaderboard
from leaderboard import audit
from leaderboard.editions import policy
from leaderboard.models import (
    AuditEvent,
    Edition,
    GroundTruth,
    Method,
    Publication,
    Split,
    Status,
    Submission,
    Team,
    User,
)
from leaderboard.people import teams
from leaderboard.web.maintain import audit_tables
from tests import builders, pages
from tests.leaderboard.web.test_every_page import assert_sound

PAGE, JSON = "/maintain/audit/", "/maintain/audit/events.json"


@pytest.fixture
def trail(owner: User, stranger: User) -> None:
    audit.record(verb="opened", noun="Door", noun_id="a-1", actor=owner, details={"reason": "air"})
    audit.record(verb="closed", noun="Door", noun_id="a-1", actor=stranger)
    audit.record(verb="opened", noun="Window", noun_id="b-2")
    audit.seal()


def rows(response: HttpResponseBase) -> list[list[str]]:
    root = assert_sound(response)
    return [[cell.text for cell in row.all("td")] for row in root.one("tbody").all("tr")]


def text_of(response: HttpResponseBase) -> str:
    assert isinstance(response, StreamingHttpResponse)
    assert response.status_code == 200
    return response.getvalue().decode()


def test_the_newest_event_comes_first(keeper: Client, trail: None) -> None:
    shown = rows(keeper.get(PAGE))
    assert [row[2:5] for row in shown] == [
        ["system", "opened", "Window b-2"],
        ["stranger@example.org", "closed", "Door a-1"],
        ["owner@example.org", "opened", "Door a-1 reason: air"],
    ]


@pytest.mark.parametrize(
    ("query", "n"),
    [
        ("actor=owner", 1),
        ("noun_id=b", 1),
        ("verb=opened&noun=Door", 1),
        ("since=2000-01-01&until=9999-12-31", 3),
        ("until=2000-01-01", 0),
    ],
)
def test_events_are_filtered_on_the_page_and_in_the_export(
    keeper: Client, trail: None, query: str, n: int
) -> None:
    page = keeper.get(f"{PAGE}?{query}")
    assert len(rows(page)) == n if n else "No results." in pages.page(page).one("main").text
    assert len(json.loads(text_of(keeper.get(f"{JSON}?{query}")))) == n


def test_days_are_of_utc_and_include_their_ends(keeper: Client, trail: None) -> None:
    days = sorted(at.astimezone(UTC).date() for at in AuditEvent.objects.values_list("at", flat=True))
    assert len(rows(keeper.get(f"{PAGE}?since={days[0]}&until={days[-1]}"))) == 3
    yesterday = days[0] - timedelta(days=1)
    assert "No results." in pages.page(keeper.get(f"{PAGE}?until={yesterday}")).one("main").text


@pytest.mark.parametrize("query", ["until=2026-02-30", "verb=nowhere", "actor=%00"])
@pytest.mark.parametrize("address", [PAGE, JSON])
def test_a_question_that_makes_no_sense_is_a_clear_page(
    keeper: Client, trail: None, address: str, query: str
) -> None:
    response = keeper.get(f"{address}?{query}")
    assert response.status_code == 400
    assert "See the field marked above" in assert_sound(response).one("main").text


def test_an_event_that_is_not_sealed_yet_says_so(keeper: Client, trail: None) -> None:
    audit.record(verb="closed", noun="Window", noun_id="b-2")
    assert [row[5] == "not sealed yet" for row in rows(keeper.get(PAGE))] == [True, False, False, False]
    assert json.loads(text_of(keeper.get(JSON)))[0]["hash"] is None


def test_the_export_holds_every_column_and_the_chain(keeper: Client, trail: None) -> None:
    [newest, *_] = json.loads(text_of(keeper.get(JSON)))
    event = AuditEvent.objects.first()
    assert event is not None
    assert newest == {
        "id": event.pk,
        "at": event.at.isoformat(),
        "actor": None,
        "verb": "opened",
        "noun": "Window",
        "noun_id": "b-2",
        "details": {},
        "names": {},
        "previous_hash": event.previous_hash,
        "hash": event.hash,
    }


def test_the_page_has_the_beginning_of_a_digest_and_the_export_has_all_of_it(
    keeper: Client, owner: User
) -> None:
    digest = f"sha256:{'0123456789abcdef' * 4}"
    audit.record(verb="v", noun="n", noun_id="1", actor=owner, details={"digest": digest, "attempt": 1})
    [[*_, details, _]] = rows(keeper.get(PAGE))
    assert details == "n 1 digest: sha256:01234567…"
    assert digest in text_of(keeper.get(JSON))


@pytest.mark.slow
def test_events_have_names_and_links_and_the_words_of_people(
    keeper: Client, edition: Edition, owner: User, maintainer: User
) -> None:
    method = builders.submit(owner, builders.predictions(edition), method="Owl net").method
    policy.change(
        split_name="test",
        policy=replace(policy.policy_of(Split.objects.get(pk="test")), needs_admission=True),
        actor=maintainer,
    )
    audit.record(verb="imported", noun="PublishedResult", noun_id="https://p", details={"added": ["r"] * 300})
    page = keeper.get(PAGE)
    by_verb = {row[3]: row for row in rows(page)}
    assert by_verb["visibility changed"][4] == "Method Owl net, Owls private → public"
    assert by_verb["changed"][4] == "Split Test needs admission: no → yes"
    [imported] = [row for row in rows(page) if row[4].startswith("Published result")]
    assert imported[4].endswith("added: r, r, r, r, r and 295 more")
    links = [a.attributes["href"] for a in pages.page(page).one("tbody").all("a")]
    assert {f"/methods/{method.pk}/", "/maintain/splits/test/", f"/maintain/teams/{method.team_id}/"} <= {
        *links
    }


@pytest.mark.slow
def test_an_evaluation_names_its_edition_and_why_its_file_was_rejected(
    keeper: Client, edition: Edition, owner: User
) -> None:
    for method, data in (("Owl net", builders.predictions(edition)), ("Broken", b"{}")):
        builders.submit(owner, data, method=method)
    builders.score_all()
    sent = {
        row.method.name: f"Owls, submitted {row.submitted_at:%Y-%m-%d %H:%M} UTC"
        for row in Submission.objects.all()
    }
    broken, owl = sorted(row[4] for row in rows(keeper.get(PAGE)) if row[3] in {"scored", "rejected"})
    assert owl == f"Evaluation Owl net on Test, edition 1, {sent['Owl net']}"
    assert broken.startswith(f"Evaluation Broken on Test, edition 1, {sent['Broken']} reason: ")


def test_a_change_is_shown_from_what_to_what_and_fields_have_the_labels_of_the_form(
    keeper: Client, owner: User
) -> None:
    audit.record(
        verb="shown", noun="n", noun_id="1", actor=owner, details={"from": "PRIVATE", "to": "PUBLIC"}
    )
    audit.record(
        verb="edited", noun="n", noun_id="1", actor=owner, details={"fields": ["n_frames", "paper_url"]}
    )
    assert [row[4] for row in rows(keeper.get(PAGE))] == [
        "n 1 fields: frames used, paper link",
        "n 1 private → public",
    ]


def test_an_override_has_the_labels_of_its_form_and_its_reason_comes_last(
    keeper: Client, edition: Edition, owner: User, maintainer: User
) -> None:
    team = teams.team_of(user=owner)
    builders.override(team, limit=40, window=timedelta(days=2), reason="A deadline.", actor=maintainer)
    [words] = [row[4] for row in rows(keeper.get(PAGE)) if row[3] == "quota overridden"]
    details = words.removeprefix(f"Team {team.name} ")
    assert sorted(details.split("; ")[:-1]) == [
        "split: Test",
        "submissions per team: 40",
        "time between submissions: none",
        "time window: 2 days",
    ]
    assert details.endswith("; reason: A deadline.")


def test_equal_names_have_the_names_of_their_teams(
    keeper: Client, edition: Edition, owner: User, stranger: User
) -> None:
    for user in (owner, stranger):
        builders.submit(user, builders.predictions(edition), method="Net", visibility="PRIVATE")
    sent = [row[4] for row in rows(keeper.get(PAGE)) if row[3] == "submitted"]
    assert [text.split(", ")[1] for text in sent] == ["Strangers", "Owls"]


def test_an_announcement_is_named_once_and_times_are_readable(keeper: Client, maintainer: User) -> None:
    audit.record(
        verb="announced",
        noun="SiteAnnouncement",
        noun_id="site",
        actor=maintainer,
        details={"text": "MAINTENANCE", "ends_at": "2026-12-02T00:00:00+00:00"},
    )
    [row] = rows(keeper.get(PAGE))
    assert row[4] == "Announcement of the site text: MAINTENANCE; ends at: 2026-12-02 00:00 UTC"


def test_actions_of_people_are_shown_and_exported_without_those_of_machines(
    keeper: Client, trail: None
) -> None:
    for query in ("people=only", "people=only&verb="):
        assert [row[2] for row in rows(keeper.get(f"{PAGE}?{query}"))] == [
            "stranger@example.org",
            "owner@example.org",
        ]
    assert len(json.loads(text_of(keeper.get(f"{JSON}?people=only")))) == 2
    [link] = [a for a in pages.get(keeper, f"{PAGE}?people=only").all("a") if a.text == "JSON"]
    assert len(json.loads(text_of(keeper.get(link.attributes["href"])))) == 2


@pytest.mark.parametrize("address", [PAGE, "/maintain/teams/", "/maintain/queue/"])
def test_a_page_names_the_filters_that_it_does_not_have(keeper: Client, trail: None, address: str) -> None:
    answer = assert_sound(keeper.get(f"{address}?q=owls&page=1&<b>=2"))
    assert "Not applied: “q”, “<b>”. This page has no such filter." in answer.one("main").text
    assert "Not applied" not in assert_sound(keeper.get(f"{address}?page=1")).one("main").text


def test_the_page_of_a_team_has_its_name_alone_as_title(keeper: Client, owner: User) -> None:
    team = teams.team_of(user=owner)
    title = pages.get(keeper, f"/maintain/teams/{team.pk}/").one("title").text
    assert title.startswith("Owls: team")


# --- the role of a maintainer ----------------------------------------------------------------------------


def test_who_becomes_a_maintainer_and_who_no_longer_is_one_is_audited(owner: User) -> None:
    call_command("set_maintainer", "Owner@example.org", reason="She helps out.", stdout=StringIO())
    assert User.objects.get(pk=owner.pk).is_maintainer
    call_command("set_maintainer", owner.email, reason="She left.", end=True, stdout=StringIO())
    assert not User.objects.get(pk=owner.pk).is_maintainer
    events = AuditEvent.objects.filter(verb="changed", noun="User", noun_id=owner.pk).order_by("pk")
    assert [event.details for event in events] == [
        {"is_maintainer": True, "reason": "She helps out."},
        {"is_maintainer": False, "reason": "She left."},
    ]


def test_a_closed_account_is_no_maintainers_and_a_role_needs_a_reason(owner: User) -> None:
    with pytest.raises(CommandError, match="The field 'reason' is empty"):
        call_command("set_maintainer", owner.email, reason=" ")
    User.objects.filter(pk=owner.pk).update(is_active=False)
    with pytest.raises(CommandError, match="closed or deleted"):
        call_command("set_maintainer", owner.email, reason="She helps out.")
    assert not User.objects.get(pk=owner.pk).is_staff


# --- nothing that is nobody's business -------------------------------------------------------------------


# --- every action has its words -----------------------------------------------------------------------------

# Verbs that the code makes of something else.
MADE: dict[str, set[str]] = {
    "kind.lower()": {kind.lower() for kind in Publication.Kind.values},
    "outcome.status.lower()": {Status.SCORED.lower(), Status.REJECTED.lower()},
    "verb": set(),  # of what the same file gives this name
}


def written() -> tuple[set[str], set[str]]:
    """Return the verbs and the nouns that the source writes into the audit log."""
    verbs: set[str] = set()
    nouns: set[str] = set()
    folder = Path(leaderboard.__file__).parent
    for path in sorted(folder.rglob("*.py")):
        if path.name == "audit.py":  # passes on what it is given
            continue
        tree = ast.parse(path.read_text())
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            function = ast.unparse(call.func)
            named = {word.arg: word.value for word in call.keywords}
            if function == "audit.record":
                verbs |= texts_of(named["verb"], tree)
                nouns |= texts_of(named["noun"], tree)
            elif function == "audit.record_of":
                verbs |= texts_of(call.args[1], tree)
            elif function == "audit.record_many":
                [rows] = [node for node in ast.walk(call) if isinstance(node, ast.GeneratorExp)][:1]
                assert isinstance(rows.elt, ast.Tuple)
                first = rows.elt.elts[0]
                verbs |= texts_of(first.value.elts[0] if isinstance(first, ast.Starred) else first, tree)  # type: ignore[attr-defined]
    return verbs, nouns


def texts_of(value: ast.expr, tree: ast.Module) -> set[str]:
    """Return the texts that an expression may be. Fails for one that nobody has told of here."""
    if isinstance(value, ast.Constant):
        return {value.value}
    if isinstance(value, ast.IfExp):
        return texts_of(value.body, tree) | texts_of(value.orelse, tree)
    texts = set(MADE[ast.unparse(value)])
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == ast.unparse(value):
            texts |= texts_of(node.value, tree)
    return texts


@pytest.mark.slow
def test_every_verb_that_the_code_writes_has_words_of_its_own_and_none_has_words_in_vain() -> None:
    verbs, nouns = written()
    assert len(verbs) > 40
    assert verbs == set(audit_tables._VERBS)
    for verb in verbs:
        assert re.fullmatch("[a-z][a-z -]+", audit_tables.verb_words(verb)), verb
    for noun in nouns | {model.__name__ for model in (Team, User, Method, Edition, Split, GroundTruth)}:
        assert re.fullmatch("[A-Z]+[a-z ]+[a-z]", audit_tables.noun_words(noun)), noun


@pytest.mark.slow
def test_the_page_shows_every_verb_with_its_words(keeper: Client) -> None:
    verbs, _ = written()
    for number, verb in enumerate(sorted(verbs)):
        audit.record(verb=verb, noun="Door", noun_id=number)
    shown = [row[3] for page in (1, 2) for row in rows(keeper.get(f"{PAGE}?page={page}"))][: len(verbs)]
    assert sorted(shown) == sorted(audit_tables.verb_words(verb) for verb in verbs)
