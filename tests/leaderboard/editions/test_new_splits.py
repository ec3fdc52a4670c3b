"""Splits and challenges without code: made, changed, archived and switched off on a page."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from django.db import IntegrityError, transaction
from django.test import Client
from django.utils import timezone

from leaderboard import board_versions
from leaderboard.editions import corrections, deadlines, new_splits, policy
from leaderboard.editions.policy import Policy
from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.models import AuditEvent, Edition, PageVersion, Split, Submission, User
from tests import builders, pages
from tests.editions import corrected, open_edition, publish
from tests.leaderboard.web.maintain.desk import get
from tests.leaderboard.web.test_every_page import assert_sound

SPLITS, ADD = "/maintain/splits/", "/maintain/splits/add/"
NEW = {
    "name": "challenge-2027",
    "title": "Challenge 2027",
    "truth": "as test",
    "listing": "LISTED",
    "position": "0",
    "opens_at": "",
    "closes_at": "2099-03-01 23:59 AoE",
    "decimals": "1",
    "quota_limit": "2",
    "quota_window": "7 days",
    "quota_min_gap": "",
    "quota_rejected_limit": "5",
}
PUBLIC = (
    *("/", "/board/val/", "/board/val/charts/", "/board/val.csv", "/board/val/editions/", "/sitemap.xml"),
    *("/feed.atom", "/docs/", "/compare/", "/api/v1/splits", "/board/val/feed.atom"),
    *("/api/v1/splits/val/board", "/api/v1/splits/val/editions"),
)


def post_confirmed(keeper: Client, address: str, form: dict[str, str]) -> Any:
    """Send a form, and answer yes to what it asks."""
    asked = pages.page(keeper.post(address, form)).one("input", name="confirmed")
    return keeper.post(address, {**form, "confirmed": asked.attributes["value"]})


def change(name: str, **values: Any) -> Split:
    wanted = Policy(**{**vars(policy.policy_of(Split.objects.get(pk=name))), **values})
    return policy.change(split_name=name, policy=wanted, actor=None)


def add(name: str, *, policy: Policy, same_truth_as: str = "", actor: User | None = None) -> Split:
    return new_splits.add_split(
        name=name,
        policy=policy,
        is_hidden=None if same_truth_as else False,
        same_truth_as=same_truth_as,
        now=timezone.now(),
        actor=actor,
    )


@pytest.fixture
def challenge(edition: Edition) -> Split:
    """A challenge on the ground truth of the test split."""
    closes_at = deadlines.parse("2099-03-01 23:59 Europe/Berlin")
    week = timedelta(days=7)
    return add(
        "challenge",
        policy=Policy(title="Challenge", closes_at=closes_at, quota_limit=1, quota_window=week),
        same_truth_as="test",
    )


# --- making one ------------------------------------------------------------------------------------------


def test_a_challenge_shares_ground_truth_and_has_its_own_deadline_quota_and_board(
    challenge: Split, edition: Edition, owner: User, client: Client
) -> None:
    board = challenge.current_edition
    assert board is not None
    assert (board.number, board.ground_truth_id) == (1, edition.ground_truth_id)
    assert challenge.is_hidden
    assert challenge.closes_at == datetime(2099, 3, 1, 22, 59, tzinfo=UTC)
    builders.submit(owner, builders.predictions(edition), split="challenge")
    assert builders.score_all() == 1
    rows = client.get("/api/v1/splits/challenge/board").json()["entries"]
    assert [row["method"] for row in rows] == ["Foo"]
    # The method is on one board, and the slot was one of the challenge's.
    test_rows = client.get("/api/v1/splits/test/board").json()["entries"]
    assert "Foo" not in [row["method"] for row in test_rows]
    with pytest.raises(Exception, match="Your team has used 1 submission to Challenge, its quota for 7 days"):
        builders.send(owner, builders.predictions(edition, factor=1.2), split="challenge")
    builders.send(owner, builders.predictions(edition, factor=1.2), split="test")
    same_truth_as = {each["split"]: each["same_truth_as"] for each in client.get("/api/v1/splits").json()}
    assert (same_truth_as["challenge"], same_truth_as["test"]) == ("test", None)


@pytest.mark.slow
def test_a_corrected_board_leaves_a_challenge_on_the_same_truth_as_it_is_until_it_is_corrected_too(
    challenge: Split, edition: Edition, owner: User, tmp_path: Path, client: Client
) -> None:
    for split in ("test", "challenge"):
        builders.submit(owner, builders.predictions(edition), split=split)
    builders.score_all()
    before = client.get("/api/v1/splits/challenge/board").json()
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    assert client.get("/api/v1/splits/challenge/board").json() == before
    assert client.get("/api/v1/splits/test/board").json()["edition"] == 2
    theirs = corrections.open_edition(
        split_name="challenge", digest=second.ground_truth_id, now=timezone.now(), actor=None
    )
    builders.score_all()
    publish(theirs)
    assert (theirs.number, theirs.ground_truth_id) == (2, second.ground_truth_id)
    values = [client.get(f"/api/v1/splits/{split}/board").json() for split in ("test", "challenge")]
    assert len({own_score(board) for board in values}) == 1
    assert own_score(before) != own_score(values[0])


@pytest.mark.slow
@pytest.mark.parametrize("origin", ["hidden", "as test"])
def test_new_split_on_hidden_values_starts_off_the_pages_with_the_quota_of_the_test_split(
    keeper: Client, edition: Edition, origin: str
) -> None:
    sent = {"name": "winter", "title": "Winter", "truth": origin}
    assert keeper.post(ADD, filled_in(get(keeper, ADD)) | sent).status_code == 302
    winter = Split.objects.get(pk="winter")
    quota = (winter.quota_limit, winter.quota_window, winter.quota_min_gap, winter.quota_rejected_limit)
    assert quota == (3, timedelta(days=30), timedelta(hours=24), 20)
    assert winter.listing == "OFF"
    for address in ("/", "/board/test/", "/docs/", "/compare/", "/api/v1/splits", "/sitemap.xml"):
        assert b"winter" not in Client().get(address).content.lower(), address


def filled_in(page: pages.Element) -> dict[str, str]:
    """The values of a form's fields; no box of it is ticked."""
    form = page.one("main").one("form")
    fields = [each.attributes for each in form.all("input") if each.attributes.get("type") != "checkbox"]
    values = {each["name"]: each.get("value", "") for each in fields}
    for select in form.all("select"):
        chosen = [each for each in select.all("option") if "selected" in each.attributes]
        values[select.attributes["name"]] = chosen[0].attributes["value"] if chosen else ""
    return values


def test_split_without_ground_truth_cannot_be_listed(
    keeper: Client, edition: Edition, tmp_path: Path
) -> None:
    answer = post_confirmed(keeper, ADD, NEW | {"truth": "hidden"})
    assert answer.status_code == 422
    assert "has no ground truth and would be listed" in pages.page(answer).one("main").text
    assert post_confirmed(keeper, ADD, NEW | {"truth": "hidden", "listing": "OFF"}).status_code == 302
    with pytest.raises(Refused, match="has no ground truth and would be listed") as refused:
        change("challenge-2027", listing="LISTED")
    assert refused.value.field == "listing"
    builders.import_truth(tmp_path, split="challenge-2027", seed=1)
    assert change("challenge-2027", listing="LISTED").listing == "LISTED"


def own_score(board: dict[str, Any]) -> float:
    [row] = [row for row in board["entries"] if row["method"] == "Foo"]
    value: float = row["scores"]["mid"]
    return value


@pytest.mark.slow
def test_page_adds_a_challenge_and_says_what_is_wrong_at_the_field(keeper: Client, edition: Edition) -> None:
    last = max(Split.objects.values_list("position", flat=True))
    assert filled_in(assert_sound(keeper.get(ADD)))["position"] == str(last + 1)
    answer = post_confirmed(keeper, ADD, NEW)
    assert (answer.status_code, answer.headers["Location"]) == (302, SPLITS)
    made = Split.objects.get(pk="challenge-2027")
    assert made.closes_at == datetime(2099, 3, 2, 11, 59, tzinfo=UTC)
    assert (made.quota_limit, made.quota_window, made.position) == (2, timedelta(days=7), 3)
    assert "Challenge 2027" in get(keeper, SPLITS).one("main").text
    [event] = AuditEvent.objects.filter(noun="Split", verb="added")
    assert (event.noun_id, event.details["same_truth_as"]) == ("challenge-2027", "test")
    for field, value, sentence in (
        ("name", "Test 2", "The name 'Test 2' cannot be used"),
        ("name", "challenge-2027", "There is a split 'challenge-2027' already"),
        ("name", "audit", "and none of actions, add, announcement"),
        ("title", "", "No title was given"),
        ("opens_at", "2099-03-01 10:00", "has no time zone"),
        ("quota_window", "-3 days", "'-3 days' is not a span of time"),
        ("position", "99999", "expected a whole number from 0 to 32,767."),
        ("quota_rejected_limit", str(10**12), "expected at most 1,000,000, or none."),
    ):
        refused = keeper.post(ADD, {**NEW, "closes_at": "", "name": "other", field: value})
        assert refused.status_code == 422, field
        wrong = assert_sound(refused).one("div", class_="wrong")
        assert sentence in wrong.text
    assert Split.objects.count() == 4


def test_a_challenge_reveals_no_more_decimals_of_hidden_values(challenge: Split) -> None:
    with pytest.raises(Refused, match=r"2 decimals of the hidden values of 'test'.*at most 1"):
        change("challenge", decimals=2)


def test_only_maintainers_add_and_change(owner: User, benchmark: None) -> None:
    with pytest.raises(NotMaintainer):
        policy.change(split_name="val", policy=Policy(title="Mine"), actor=owner)
    with pytest.raises(NotMaintainer):
        add("mine", policy=Policy(title="Mine"), actor=owner)


@pytest.mark.parametrize(
    "values", [{"title": ""}, {"listing": "GONE"}, {"announcement": "No end"}, {"same_truth_as": "val"}]
)
def test_database_keeps_out_what_makes_no_sense(benchmark: None, values: dict[str, str]) -> None:
    with pytest.raises(IntegrityError), transaction.atomic():
        Split.objects.filter(pk="val").update(**values)


# --- changing one ----------------------------------------------------------------------------------------


def test_page_changes_a_policy_and_the_audit_trail_has_both_values(keeper: Client, edition: Edition) -> None:
    address = f"{SPLITS}test/"
    sent = filled_in(get(keeper, address))
    assert keeper.post(address, {**sent, "title": "Test set", "quota_limit": "4"}).status_code == 302
    split = Split.objects.get(pk="test")
    assert (split.title, split.quota_limit, split.quota_window) == ("Test set", 4, timedelta(days=30))
    [event] = AuditEvent.objects.filter(noun="Split", verb="changed")
    assert event.details["title"] == "Test → Test set"
    assert set(event.details) == {"title", "description", "quota_limit"}
    assert "Test set" in keeper.get("/board/test/").text


NOW = timezone.now().replace(second=0, microsecond=0)
DAY, YEAR = timedelta(days=1), timedelta(days=366)
DOUBTFUL = [
    ({"closes_at": NOW - YEAR}, ["Submissions close at once: {closes_at} is in the past."]),
    ({"closes_at": NOW - 2 * DAY}, ["Submissions close at once: {closes_at} is in the past."]),
    ({"closes_at": NOW + 36 * YEAR}, ["Submissions are open for more than a year, until {closes_at}."]),
    ({"opens_at": NOW + DAY}, ["Submissions are closed from now until {opens_at}."]),
    (
        {"opens_at": NOW + 2 * YEAR, "closes_at": NOW + 3 * YEAR},
        [
            "Submissions are open for more than a year, until {closes_at}.",
            "Submissions open in more than a year, at {opens_at}.",
        ],
    ),
    (
        {"announcement": "Soon", "announcement_ends_at": NOW - DAY},
        ["The announcement is not shown: {announcement_ends_at} is in the past."],
    ),
    (
        {"announcement": "Soon", "announcement_ends_at": NOW + 2 * YEAR},
        ["The announcement is shown for more than a year, until {announcement_ends_at}."],
    ),
]


def as_typed(values: dict[str, Any]) -> dict[str, str]:
    return {
        name: deadlines.formatted(value) if isinstance(value, datetime) else value
        for name, value in values.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize(("values", "questions"), DOUBTFUL)
@pytest.mark.parametrize("name", ["test", "val"])
def test_a_date_of_another_year_is_asked_about_and_nothing_is_changed_before_the_answer(
    keeper: Client, edition: Edition, name: str, values: dict[str, Any], questions: list[str]
) -> None:
    address, before = f"{SPLITS}{name}/", [policy.policy_of(split) for split in Split.objects.order_by("pk")]
    typed = as_typed(values)
    form = {**filled_in(get(keeper, address)), **typed}
    for wrong_answer in ({}, {"confirmed": "yes"}):
        page = assert_sound(keeper.post(address, form | wrong_answer))
        asked = page.one("div", class_="question").text
        for question in questions:
            assert question.format(**typed) in asked
        assert filled_in(page)["title"] == form["title"], "what was typed is still there"
    assert [policy.policy_of(split) for split in Split.objects.order_by("pk")] == before
    assert post_confirmed(keeper, address, form).status_code == 302
    changed = policy.policy_of(Split.objects.get(pk=name))
    assert {field: getattr(changed, field) for field in values} == values
    # What is there already is no news.
    again = {**filled_in(get(keeper, address)), "title": "Another title"}
    assert keeper.post(address, again).status_code == 302


def test_an_answer_is_about_the_date_that_was_asked_about(keeper: Client, edition: Edition) -> None:
    address = f"{SPLITS}test/"
    form = {**filled_in(get(keeper, address)), "closes_at": "2020-01-01 00:00 UTC"}
    answer = pages.page(keeper.post(address, form)).one("input", name="confirmed").attributes["value"]
    other = form | {"closes_at": "2021-01-01 00:00 UTC", "confirmed": answer}
    assert "2021-01-01 00:00 UTC is in the past" in keeper.post(address, other).text
    assert Split.objects.get(pk="test").closes_at is None


def test_a_date_within_a_year_is_saved_at_once(keeper: Client, edition: Edition) -> None:
    for name, days in (("test", 1), ("val", 364)):
        form = filled_in(get(keeper, f"{SPLITS}{name}/")) | as_typed({"closes_at": NOW + days * DAY})
        assert keeper.post(f"{SPLITS}{name}/", form).status_code == 302


def test_a_new_split_and_the_announcement_of_the_site_ask_as_well(keeper: Client, edition: Edition) -> None:
    for closes_at in ("2020-01-01 00:00 UTC", "2099-01-01 00:00 UTC"):
        page = assert_sound(keeper.post(ADD, NEW | {"closes_at": closes_at}))
        assert closes_at in page.one("div", class_="question").text
    assert not Split.objects.filter(pk="challenge-2027").exists()
    address = "/maintain/announcement/"
    form = {"announcement": "Maintenance", "announcement_ends_at": "2099-01-01 00:00 UTC"}
    assert (
        "for more than a year" in assert_sound(keeper.post(address, form)).one("div", class_="question").text
    )
    assert PageVersion.announcement().count() == 0
    assert post_confirmed(keeper, address, form).status_code == 302
    assert PageVersion.announcement().count() == 1


@pytest.mark.slow
def test_the_end_of_one_split_leaves_the_other_open(
    keeper: Client, edition: Edition, owner: User, tmp_path: Path
) -> None:
    val = builders.import_truth(tmp_path, split="val")
    form = filled_in(get(keeper, f"{SPLITS}test/")) | as_typed({"closes_at": NOW - DAY})
    assert post_confirmed(keeper, f"{SPLITS}test/", form).status_code == 302
    with pytest.raises(Refused, match="Submissions to Test closed at"):
        builders.send(owner, builders.predictions(edition))
    assert builders.send(owner, builders.predictions(val), split="val").is_new
    builders.score_all()
    open_by_split = {row["split"]: row["is_open"] for row in keeper.get("/api/v1/splits").json()}
    assert (open_by_split["test"], open_by_split["val"]) == (False, True)
    assert "Closed for submissions" in keeper.get("/board/test/").text
    assert "Closed for submissions" not in keeper.get("/board/val/").text


def test_a_change_that_makes_no_sense_is_refused(benchmark: None) -> None:
    with pytest.raises(Refused, match="There is no split 'nope'; expected one of test, val, demo"):
        policy.change(split_name="nope", policy=Policy(title="N"), actor=None)
    now = timezone.now()
    with pytest.raises(Refused, match="expected to open before it closes"):
        change("val", opens_at=now + timedelta(days=2), closes_at=now + timedelta(days=1))


# --- archived, and switched off --------------------------------------------------------------------------


@pytest.fixture
def val_entry(benchmark: None, owner: User, tmp_path: Path) -> Submission:
    """A scored public entry of the open split."""
    edition = builders.import_truth(tmp_path, split="val")
    return builders.submit(owner, builders.predictions(edition), split="val")


def test_an_archived_split_keeps_its_board_and_takes_no_file(
    client: Client, val_entry: Submission, owner: User
) -> None:
    builders.score_all()
    change("val", listing="ARCHIVED", position=0)
    with pytest.raises(Refused, match="Submissions to Validation are closed: the split is archived"):
        builders.send(owner, b"{}", split="val")
    assert "Archived: closed for submissions" in client.get("/board/val/").text
    split_rows = client.get("/api/v1/splits").json()
    assert [each["split"] for each in split_rows] == ["test", "demo", "val"]
    assert (split_rows[-1]["is_open"], split_rows[-1]["is_archived"]) == (False, True)


@pytest.mark.slow
def test_a_split_that_is_switched_off_is_on_no_page_form_list_or_sitemap(
    client: Client, val_entry: Submission, owner: User
) -> None:
    builders.score_all()
    submission = f"/submissions/{val_entry.pk}/"
    assert all(client.get(address).status_code == 200 for address in PUBLIC)  # and remembered
    change("val", listing="OFF")
    for address in PUBLIC:
        answer = client.get(address)
        if "/val" in address:
            assert answer.status_code == 404, address
        else:
            assert answer.status_code == 200
            assert "/board/val" not in answer.text, address
            assert '"val"' not in answer.text, address
    for address in ("/api/v1/splits/val/manifest", "/compare/?split=val"):
        assert client.get(address).status_code == 404, address
    assert "/board/val" not in client.get(f"/methods/{val_entry.method_id}/").text
    client.force_login(owner)
    for address in ("/submit/", "/submissions/", "/tokens/", "/api/v1/quota", "/api/v1/submissions"):
        assert "val" not in client.get(address).text.replace("value", "").replace("interval", ""), address
    assert client.get(submission).status_code == 404
    with pytest.raises(Refused, match="There is no split 'val'; expected one of test, demo"):
        builders.send(owner, b"{}", split="val")
    change("val", listing="LISTED")
    assert all(client.get(address).status_code == 200 for address in (*PUBLIC, submission))


# --- a line with an end ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_announcement_is_on_pages_and_in_the_api_until_it_ends(keeper: Client, edition: Edition) -> None:
    page, text = "/maintain/announcement/", "Maintenance <b>today</b>, 8:00 UTC."
    visitor = Client()
    assert text not in visitor.get("/board/test/").text
    assert "There is no announcement at the moment." in assert_sound(keeper.get(page)).one("main").text
    for sent, sentence in (
        ({"announcement": text}, "The announcement has no end; expected an end beside its text."),
        ({"announcement": text, "announcement_ends_at": "2020-01-01 00:00 UTC"}, "is in the past"),
    ):
        refused = keeper.post(page, sent)
        assert sentence in assert_sound(refused).one("div", class_="wrong").text
    sent = {"announcement": text, "announcement_ends_at": "2099-01-01 00:00 UTC"}
    assert post_confirmed(keeper, page, sent).status_code == 302
    for address in ("/", "/board/test/", "/board/val/", "/compare/?split=test"):
        [line] = pages.page(visitor.get(address)).all("p", class_="announcement")
        assert line.text == text
    assert keeper.get("/submit/").text.count("Maintenance &lt;b&gt;today") == 1
    split_rows = visitor.get("/api/v1/splits").json()
    assert {each["announcement"] for each in split_rows} == {text}
    assert AuditEvent.objects.get(noun="SiteAnnouncement").details["text"] == text
    main = pages.get(keeper, page).one("main")
    assert text in main.one("input", id="id_announcement").attributes["value"]
    assert f"Announced until 2099-01-01 00:00 UTC: {text}" in main.text
    change("val", announcement="Val only", announcement_ends_at=timezone.now() + timedelta(hours=1))
    lines = pages.page(visitor.get("/board/val/")).all("p", class_="announcement")
    assert [line.text for line in lines] == [text, "Validation: Val only"]
    assert "Val only" not in visitor.get("/board/test/").text
    assert "Announced: Val only" in pages.get(keeper, "/maintain/splits/").one("main").text
    # Its end comes: the next sweep tells remembered pages.
    later = timezone.now() - timedelta(seconds=1)
    Split.objects.filter(pk="val").update(announcement_ends_at=later)
    PageVersion.announcement().update(ends_at=later)
    assert board_versions.bump_passed_deadlines(now=timezone.now()) == 3
    assert "Val only" not in visitor.get("/board/val/").text
    assert {each["announcement"] for each in visitor.get("/api/v1/splits").json()} == {""}
    again = sent | {"announcement": "Known error"}
    assert post_confirmed(keeper, page, again).status_code == 302
    assert "Known error" in visitor.get("/board/test/").text
    assert keeper.post(page, {}).status_code == 302
    assert not PageVersion.announcement().exists()
    assert "Known error" not in visitor.get("/board/test/").text


# --- moments ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("2027-03-01 23:59 UTC", "2027-03-01 23:59"),
        ("2027-03-01 23:59 AoE", "2027-03-02 11:59"),
        ("2027-03-01 23:59 Europe/Berlin", "2027-03-01 22:59"),
        ("2027-03-01 23:59+05:30", "2027-03-01 18:29"),
    ],
)
def test_a_moment_has_a_zone(text: str, moment: str) -> None:
    assert deadlines.parse(text) == datetime.fromisoformat(f"{moment}+00:00")
    assert deadlines.parse(deadlines.formatted(deadlines.parse(text))) == deadlines.parse(text)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("2027-03-01", "is not a date with a time"),
        ("2027-03-01 23:59", "has no time zone"),
        ("2027-02-30 23:59 UTC", "is not in the calendar"),
        ("2027-03-01 23:59 ../../etc/passwd", "There is no time zone"),
        ("2027-03-28 02:30 Europe/Berlin", "2027-03-28 02:30 does not occur in Europe/Berlin"),
        ("2027-10-31 02:30 Europe/Berlin", "2027-10-31 02:30 occurs twice in Europe/Berlin"),
        ("9999-12-31 23:59 AoE", "is outside of the calendar"),
    ],
)
def test_a_moment_that_is_none_is_refused_in_words(text: str, fault: str) -> None:
    with pytest.raises(Refused, match=fault):
        deadlines.parse(text)
