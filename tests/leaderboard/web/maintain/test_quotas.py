"""Quotas as maintainers see them: the rules, teams with rules of their own, and what a team has left."""

from datetime import timedelta

import pytest
from django.test import Client
from pytest_django.fixtures import Settings

from leaderboard.models import AuditEvent, Edition, QuotaOverride, Split, Submission, Team, User
from leaderboard.people import teams
from tests import builders, pages
from tests.leaderboard.web.maintain.desk import get, main_text
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.slow

QUOTAS, TEAMS = "/maintain/quotas/", "/maintain/teams/"
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
    [region] = [div for div in root.all("div", role="region") if div.attributes.get("aria-label") == label]
    return [[visible_text(cell) for cell in row.all("td")] for row in region.one("tbody").all("tr")]


def visible_text(cell: pages.Element) -> str:
    spoken = " ".join(each.text for each in cell.all("span", class_="spoken"))
    return cell.text.removesuffix(spoken).strip()


def wrong(client: Client, where: str, data: dict[str, str]) -> list[str]:
    """Return the errors of a refused form at its fields."""
    answer = client.post(where, data)
    assert answer.status_code == 422
    root = assert_sound(answer)
    assert "Nothing was changed" in root.one("div", class_="form-errors").text
    return [field.one("div", class_="errors").text for field in root.all("div", class_="wrong")]


# --- the rules -------------------------------------------------------------------------------------------


def test_every_split_shows_its_rules(keeper: Client, team: Team) -> None:
    root = get(keeper, QUOTAS)
    assert [row[:3] for row in cells(root, "Per split")] == [
        ["Test", "3 in 30 days, 24 hours apart", "20"],
        ["Validation", "50 in 24 hours", "20"],
        ["Demo", "20 in 24 hours", "20"],
    ]
    assert "No overrides." in root.one("main").text


def test_overrides_say_whose_why_by_whom_and_since_when(keeper: Client, override: QuotaOverride) -> None:
    page = keeper.get(QUOTAS)
    [row] = cells(pages.page(page), "Overrides")
    assert row == [
        *("Owls on Test", "5 in 36 hours", "7"),
        f"“They asked <i>nicely</i>.” (maintainer@example.org, {override.set_at:%Y-%m-%d})",
        "Edit the override for Owls on test Delete the override for Owls on test",
    ]
    assert "<i>nicely" not in page.text


def test_pages_say_that_quotas_are_off(keeper: Client, team: Team, settings: Settings) -> None:
    assert "switched off" not in main_text(keeper, QUOTAS)
    settings.QUOTAS = False
    assert "switched off" in main_text(keeper, QUOTAS)
    assert "switched off" in main_text(keeper, address(team))


# --- looking up a team -----------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["OWL", "0wls", "teammate@example"])
def test_team_is_listed_by_name_by_look_and_by_its_people(
    keeper: Client, team: Team, teammate: User, stranger: User, text: str
) -> None:
    teams.team_of(user=stranger)
    root = pages.page(keeper.get(TEAMS, {"team": text}))
    people = "owner@example.org teammate@example.org"
    assert cells(root, "Teams") == [["Owls", people, "–", "0", "0", "Quotas"]]
    assert address(team) in [a.attributes["href"] for a in root.all("a")]


def test_a_maintainer_is_offered_only_what_the_rules_allow_on_the_own_account(
    keeper: Client, maintainer: User, stranger: User
) -> None:
    listed = cells(get(keeper, TEAMS), "People without a team")
    own, other = (next(row for row in listed if user.email in row[0]) for user in (maintainer, stranger))
    assert own[0].endswith("you")
    assert "Revoke tokens" in own[1]
    assert not {word for word in ("Close account", "Forget person") if word in own[1]}
    assert all(word in other[1] for word in ("Close account", "Revoke tokens", "Forget person"))


def test_more_people_without_a_team_than_a_page_shows_are_counted(keeper: Client, team: Team) -> None:
    n_before = len(cells(get(keeper, TEAMS), "People without a team"))
    User.objects.bulk_create(User(email=f"alone{number}@example.org") for number in range(52 - n_before))
    assert len(cells(get(keeper, TEAMS), "People without a team")) == 50
    assert "And 2 more: search for an address." in main_text(keeper, TEAMS)
    assert "more: search" not in main_text(keeper, f"{TEAMS}?team=alone7@")


def test_hub_leads_to_a_list_of_all_teams(keeper: Client, team: Team, stranger: User) -> None:
    other = teams.team_of(user=stranger)
    (tile,) = [li for li in get(keeper, "/maintain/").all("li") if li.text.startswith("Teams")]
    assert tile.one("strong").text == "2"
    listed = cells(get(keeper, tile.one("a").attributes["href"]), "Teams")
    assert sorted(row[0] for row in listed) == sorted(["Owls", other.name])


def test_pages_of_a_team_lead_back_to_the_list_of_teams(keeper: Client, team: Team) -> None:
    for where in (f"{TEAMS}{team.pk}/", address(team), address(team, "test")):
        trail = get(keeper, where).one("p", class_="trail").all("a")
        assert [a.attributes["href"] for a in trail][:2] == ["/maintain/", TEAMS], where


@pytest.mark.parametrize("text", ["x" * 255, "\0"])
def test_what_cannot_be_looked_up_has_a_reason_at_its_field(keeper: Client, team: Team, text: str) -> None:
    answer = keeper.get(TEAMS, {"team": text})
    assert answer.status_code == 400
    assert assert_sound(answer).one("div", class_="wrong").one("div", class_="errors").text


# --- what a team has left --------------------------------------------------------------------------------


def test_team_shows_what_it_has_left_on_every_split(
    keeper: Client, team: Team, edition: Edition, owner: User
) -> None:
    builders.submit(owner, builders.predictions(edition))
    test, val, _ = cells(get(keeper, address(team)), f"Quotas for {team.name}")
    next_at = Submission.objects.get().submitted_at + timedelta(hours=24)
    assert test[:5] == [
        *("Test", "3 in 30 days, 24 hours apart", f"{next_at:%Y-%m-%d %H:%M} UTC"),
        *("1 of 3", "0 of 20"),
    ]
    assert val[:5] == [
        *("Validation", "50 in 24 hours", "not open yet"),
        *("0 of 50", "0 of 20"),
    ]


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


@pytest.mark.parametrize(
    ("field", "text", "sentence"),
    [
        ("quota_limit", "many", "That is not a whole number"),
        ("quota_limit", "1000001", "The limit is 1000001 submissions; expected at most 1,000,000, or none."),
        ("quota_window", "", "No window was given"),
        ("quota_window", "3 fortnights", "'3 fortnights' is not a span of time"),
        ("quota_window", "0 days", "The window is empty"),
        ("quota_min_gap", "999,999,999 seconds", "That is longer than ten years"),
        ("reason", " ", "No reason was given"),
    ],
)
def test_what_is_wrong_has_a_reason_at_its_field_and_changes_nothing(
    keeper: Client, team: Team, field: str, text: str, sentence: str
) -> None:
    [message] = wrong(keeper, address(team, "test"), {**RULES, field: text})
    assert sentence in message
    assert not QuotaOverride.objects.exists()
    assert not AuditEvent.objects.filter(verb="quota_overridden").exists()


def test_deleting_an_override_is_red_and_saving_one_is_not(
    keeper: Client, team: Team, override: QuotaOverride
) -> None:
    end = address(team, "test", "end")
    for page in (QUOTAS, address(team)):
        assert get(keeper, page).one("a", href=end).attributes["class"] == "as-link danger"
    assert get(keeper, end).one("main").one("button").attributes["class"] == "danger"
    assert "class" not in get(keeper, address(team, "test")).one("main").one("button").attributes


def test_override_ends_with_a_reason_and_on_the_record(
    keeper: Client, team: Team, override: QuotaOverride, maintainer: User
) -> None:
    end = address(team, "test", "end")
    page = main_text(keeper, end)
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
