"""Quotas as maintainers see them: the rules, teams with rules of their own, and what a team has left."""

from datetime import timedelta
from uuid import uuid4

import pytest
from django.test import Client
from django.utils import timezone
from pytest_django import DjangoAssertNumQueries
from pytest_django.fixtures import Settings

from leaderboard.models import AuditEvent, Edition, QuotaOverride, Split, Submission, Team, User
from leaderboard.people import teams
from leaderboard.web.maintain import quota_tables, quota_views
from tests import builders, pages
from tests.leaderboard.web.maintain.desk import get, said
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.slow

QUOTAS = "/maintain/quotas/"
RULES_OF_TEST = (
    "3 submissions within 30 days, at least 24 hours apart; 20 rejected or cancelled files within 24 hours"
)
RULES = {
    "quota_limit": "9",
    "quota_window": "2 days",
    "quota_min_gap": "90 minutes",
    "quota_rejected_limit": "",
    "reason": "The camera-ready <b>deadline</b> is tomorrow.",
}


@pytest.fixture
def team(edition: Edition, owner: User) -> Team:
    """A team under the rules of splits as they are from the start."""
    for name, limit, days, gap_hours in (("test", 3, 30, 24), ("val", 50, 1, 0), ("demo", 20, 1, 0)):
        Split.objects.filter(pk=name).update(
            quota_limit=limit,
            quota_window=timedelta(days=days),
            quota_min_gap=timedelta(hours=gap_hours),
            quota_rejected_limit=20,
        )
    return teams.team_of(user=owner)


@pytest.fixture
def override(team: Team, maintainer: User) -> QuotaOverride:
    return give(team, maintainer)


def give(team: Team, maintainer: User, *, split: str = "test") -> QuotaOverride:
    return builders.override(
        team,
        split=split,
        limit=5,
        window=timedelta(hours=36),
        rejected_limit=7,
        reason="They asked <i>nicely</i>.",
        actor=maintainer,
    )


def address(team: Team, *parts: str) -> str:
    return f"{QUOTAS}{team.pk}/{''.join(f'{part}/' for part in parts)}"


def cells(root: pages.Element, label: str) -> list[list[str]]:
    """The rows of the table in the region of this name, without what is only spoken."""
    [region] = [div for div in root.all("div", role="region") if div.attributes["aria-label"] == label]
    return [[told(cell) for cell in row.all("td")] for row in region.one("tbody").all("tr")]


def told(cell: pages.Element) -> str:
    spoken = " ".join(each.text for each in cell.all("span", class_="spoken"))
    return cell.text.removesuffix(spoken).strip()


def wrong(client: Client, where: str, data: dict[str, str]) -> list[str]:
    """What a refused form says at its fields."""
    answer = client.post(where, data)
    assert answer.status_code == 422
    root = assert_sound(answer)
    assert "Nothing was changed" in root.one("div", class_="form-errors").text
    return [field.one("div", class_="errors").text for field in root.all("div", class_="wrong")]


# --- the rules -------------------------------------------------------------------------------------------


def test_every_split_shows_its_rules(keeper: Client, team: Team) -> None:
    root = get(keeper, QUOTAS)
    assert [row[:1] + row[2:6] for row in cells(root, "Rules")] == [
        ["test", "3", "30 days", "24 hours", "20"],
        ["val", "50", "24 hours", "–", "20"],
        ["demo", "20", "24 hours", "–", "20"],
    ]
    assert "No overrides." in root.one("main").text


def test_no_limit_is_said_in_words(keeper: Client, edition: Edition) -> None:
    assert cells(get(keeper, QUOTAS), "Rules")[0][2] == "no limit"


def test_overrides_say_whose_why_by_whom_and_since_when(keeper: Client, override: QuotaOverride) -> None:
    page = keeper.get(QUOTAS)
    [row] = cells(pages.page(page), "Overrides")
    assert row == [
        *("test", "Owls", "5", "36 hours", "–", "7", "They asked <i>nicely</i>."),
        *("maintainer@example.org", f"{override.set_at:%Y-%m-%d %H:%M} UTC", "Change", "Delete"),
    ]
    assert "<i>nicely" not in page.text


def test_override_of_the_command_line_says_so(keeper: Client, override: QuotaOverride) -> None:
    QuotaOverride.objects.update(set_by=None)
    assert cells(get(keeper, QUOTAS), "Overrides")[0][7] == "the command line"


def test_overrides_come_page_by_page(
    keeper: Client, team: Team, maintainer: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(quota_views, "PER_PAGE", 2)
    for split in ("demo", "test", "val"):
        give(team, maintainer, split=split)
    root = get(keeper, QUOTAS)
    assert [row[0] for row in cells(root, "Overrides")] == ["test", "val"]
    assert "page 1 of 2" in root.one("nav", class_="pages").text
    assert [row[0] for row in cells(get(keeper, f"{QUOTAS}?page=2"), "Overrides")] == ["demo"]


def test_pages_say_that_quotas_are_off(keeper: Client, team: Team, settings: Settings) -> None:
    assert "switched off" not in said(keeper, QUOTAS)
    settings.QUOTAS = False
    assert "switched off" in said(keeper, QUOTAS)
    assert "switched off" in said(keeper, address(team))


# --- looking up a team -----------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["owls", "OWL", "0wls", "Оwls", "owner@", "teammate@example"])
def test_team_is_found_by_name_by_look_and_by_its_people(
    keeper: Client, team: Team, teammate: User, stranger: User, text: str
) -> None:
    teams.team_of(user=stranger)
    root = pages.page(keeper.get(QUOTAS, {"team": text}))
    assert cells(root, "Teams") == [["Owls", "owner@example.org teammate@example.org", "Moderate"]]
    assert address(team) in [a.attributes["href"] for a in root.all("a")]


def test_nobody_found_has_a_sentence(keeper: Client, team: Team) -> None:
    answer = keeper.get(QUOTAS, {"team": "<i>nobody</i>"})
    assert "No results." in assert_sound(answer).one("main").text
    assert "<i>nobody" not in answer.text


def test_too_many_teams_are_cut(keeper: Client, team: Team, monkeypatch: pytest.MonkeyPatch) -> None:
    Team.objects.bulk_create(Team(name=f"Bird {n}", look=f"bird {n}") for n in range(3))
    monkeypatch.setattr(quota_tables, "MAX_FOUND", 2)
    root = get(keeper, f"{QUOTAS}?team=bird")
    assert [row[0] for row in cells(root, "Teams")] == ["Bird 0", "Bird 1"]
    assert "More teams match" in root.one("main").text


@pytest.mark.parametrize("text", ["x" * 255, "\0"])
def test_what_cannot_be_looked_up_is_said_at_its_field(keeper: Client, team: Team, text: str) -> None:
    answer = keeper.get(QUOTAS, {"team": text})
    assert answer.status_code == 400
    assert assert_sound(answer).one("div", class_="wrong").one("div", class_="errors").text


# --- what a team has left --------------------------------------------------------------------------------


def test_team_shows_what_it_has_left_on_every_split(
    keeper: Client, team: Team, edition: Edition, owner: User
) -> None:
    builders.submit(owner, builders.predictions(edition))
    test, val, _ = cells(get(keeper, address(team)), f"Quotas of {team.name}")
    next_at = Submission.objects.get().submitted_at + timedelta(hours=24)
    assert test[:6] == [
        *("test", RULES_OF_TEST),
        *("1", "2", f"{next_at:%Y-%m-%d %H:%M} UTC", "0"),
    ]
    assert val[:6] == [
        *("val", "50 submissions within 24 hours; 20 rejected or cancelled files within 24 hours"),
        *("0", "50", "now", "0"),
    ]


def test_team_that_may_send_nothing_has_no_next_slot(
    keeper: Client, team: Team, override: QuotaOverride
) -> None:
    QuotaOverride.objects.update(quota_limit=0)
    assert cells(get(keeper, address(team)), f"Quotas of {team.name}")[0][3:5] == ["0", "never"]


def test_teams_own_rules_are_marked_with_their_reason(
    keeper: Client, team: Team, override: QuotaOverride
) -> None:
    row = cells(get(keeper, address(team)), f"Quotas of {team.name}")[0]
    assert row[1].startswith("5 submissions within 36 hours; 7 rejected or cancelled files within 24 hours")
    assert "override “They asked <i>nicely</i>.” (maintainer@example.org, " in row[1]
    assert row[-2:] == ["Change", "Delete"]


def test_teams_changes_are_a_link_away(keeper: Client, team: Team, override: QuotaOverride) -> None:
    link = next(a for a in get(keeper, address(team)).all("a") if a.text == "Audit log of this team")
    assert "quota_overridden" in said(keeper, link.attributes["href"])


# --- rules of its own ------------------------------------------------------------------------------------


def test_form_begins_with_the_rules_that_hold(keeper: Client, team: Team, maintainer: User) -> None:
    def filled() -> list[str]:
        root = get(keeper, address(team, "test"))
        inputs = root.one("main").all("input")
        fields = {field.attributes["name"]: field.attributes.get("value", "") for field in inputs}
        return [
            fields[name] for name in ("quota_limit", "quota_window", "quota_min_gap", "quota_rejected_limit")
        ]

    assert filled() == ["3", "30 days", "24 hours", "20"]
    give(team, maintainer)
    assert filled() == ["5", "36 hours", "", "7"]


def test_override_is_set_for_its_team_on_its_split_and_on_the_record(
    keeper: Client, team: Team, maintainer: User
) -> None:
    answer = keeper.post(address(team, "test"), RULES, follow=True)
    assert answer.redirect_chain == [(address(team), 302)]
    assert "Owls now has an override on test." in assert_sound(answer).one("main").text
    row = QuotaOverride.objects.get()
    assert (row.team, row.split_id, row.set_by) == (team, "test", maintainer)
    assert (row.quota_limit, row.quota_rejected_limit) == (9, None)
    assert (row.quota_window, row.quota_min_gap) == (timedelta(days=2), timedelta(minutes=90))
    event = AuditEvent.objects.get(verb="quota_overridden")
    assert (event.actor, event.noun_id) == (maintainer, str(team.pk))
    assert event.details["reason"] == RULES["reason"]
    assert "<b>deadline" not in keeper.get(address(team)).text


def test_override_is_changed_in_its_place(keeper: Client, team: Team, override: QuotaOverride) -> None:
    changed = {**RULES, "quota_min_gap": "", "quota_rejected_limit": "0", "quota_limit": ""}
    assert keeper.post(address(team, "test"), changed).status_code == 302
    row = QuotaOverride.objects.get()
    assert (row.quota_limit, row.quota_min_gap, row.quota_rejected_limit) == (None, timedelta(0), 0)
    assert row.reason == RULES["reason"]


@pytest.mark.parametrize(
    ("text", "span"),
    [
        ("1 day", timedelta(days=1)),
        (" 36  HOURS ", timedelta(hours=36)),
        ("1,000 minutes", timedelta(minutes=1000)),
        ("45 seconds", timedelta(seconds=45)),
    ],
)
def test_spans_are_written_in_words(keeper: Client, team: Team, text: str, span: timedelta) -> None:
    assert keeper.post(address(team, "test"), {**RULES, "quota_window": text}).status_code == 302
    assert QuotaOverride.objects.get().quota_window == span


@pytest.mark.parametrize(
    ("field", "text", "sentence"),
    [
        ("quota_limit", "many", "That is not a whole number"),
        ("quota_limit", "-1", "The number is negative"),
        ("quota_limit", "1000001", "The limit is 1000001 submissions; expected at most 1,000,000, or none."),
        ("quota_rejected_limit", "2.5", "That is not a whole number"),
        ("quota_window", "", "No window was given"),
        ("quota_window", "3 fortnights", "'3 fortnights' is not a span of time"),
        ("quota_window", "1.5 days", "'1.5 days' is not a span of time"),
        ("quota_window", ", days", "', days' is not a span of time"),
        ("quota_window", "٣ days", "is not a span of time"),
        ("quota_window", "0 days", "The window is empty"),
        ("quota_window", "3651 days", "That is longer than ten years"),
        ("quota_min_gap", "-1 hours", "'-1 hours' is not a span of time"),
        ("quota_min_gap", "999,999,999 seconds", "That is longer than ten years"),
        ("reason", " ", "No reason was given"),
        ("reason", "x" * 501, "at most 500 characters"),
    ],
)
def test_what_is_wrong_is_said_at_its_field_and_changes_nothing(
    keeper: Client, team: Team, field: str, text: str, sentence: str
) -> None:
    [said_there] = wrong(keeper, address(team, "test"), {**RULES, field: text})
    assert sentence in said_there
    assert not QuotaOverride.objects.exists()
    assert not AuditEvent.objects.filter(verb="quota_overridden").exists()


def test_override_ends_with_a_reason_and_on_the_record(
    keeper: Client, team: Team, override: QuotaOverride, maintainer: User
) -> None:
    end = address(team, "test", "end")
    page = said(keeper, end)
    assert RULES_OF_TEST in page
    assert "5 submissions within 36 hours" in page
    assert wrong(keeper, end, {"reason": ""}) == [
        "No reason was given; expected a sentence for the audit log."
    ]
    assert QuotaOverride.objects.exists()
    answer = keeper.post(end, {"reason": "The deadline is over."}, follow=True)
    assert "The rules of test hold for Owls again." in assert_sound(answer).one("main").text
    assert not QuotaOverride.objects.exists()
    event = AuditEvent.objects.get(verb="quota_restored")
    assert (event.actor, event.noun_id) == (maintainer, str(team.pk))
    assert event.details == {"split": "test", "reason": "The deadline is over."}
    assert keeper.post(end, {"reason": "Again."}).status_code == 404


def test_asking_for_a_form_changes_nothing(keeper: Client, team: Team, override: QuotaOverride) -> None:
    n_events = AuditEvent.objects.count()
    for where in (QUOTAS, address(team), address(team, "test"), address(team, "test", "end")):
        get(keeper, where)
    assert AuditEvent.objects.count() == n_events
    assert QuotaOverride.objects.count() == 1


# --- the hub, the price ----------------------------------------------------------------------------------


def test_what_is_not_there_is_not_found(keeper: Client, team: Team) -> None:
    absent = f"{QUOTAS}{uuid4()}/"
    parts = (absent, f"{absent}test/", address(team, "nowhere"), address(team, "test", "end"))
    assert [keeper.get(where).status_code for where in parts] == [404] * 4


def test_desk_counts_overrides_and_events_and_leads_to_both(keeper: Client, override: QuotaOverride) -> None:
    root = get(keeper, "/maintain/")
    assert "1 override" in root.one("main").text
    assert f"{AuditEvent.objects.count()} event" in root.one("main").text
    assert {QUOTAS, "/maintain/audit/"} <= {a.attributes["href"] for a in root.one("main").all("a")}


def test_number_of_queries_does_not_grow_with_teams_and_submissions(
    keeper: Client,
    team: Team,
    override: QuotaOverride,
    edition: Edition,
    owner: User,
    stranger: User,
    maintainer: User,
    django_assert_max_num_queries: DjangoAssertNumQueries,
) -> None:
    def ask(where: str, most: int) -> int:
        with django_assert_max_num_queries(most) as asked:
            keeper.get(where)
        return len(asked.captured_queries)

    addresses = {f"{QUOTAS}?team=s": 10, address(team): 20, address(team, "test"): 12}
    before = {where: ask(where, most) for where, most in addresses.items()}
    for split in ("test", "val"):
        give(teams.team_of(user=stranger), maintainer, split=split)
    for factor in (1.2, 1.3):
        builders.submit(owner, builders.predictions(edition, factor=factor), split="test", method=str(factor))
        Submission.objects.update(submitted_at=timezone.now() - timedelta(hours=40))
    assert {where: ask(where, most) for where, most in before.items()} == before
