"""The audit log as maintainers look through it and take it along."""

import csv
import io
import json
from datetime import UTC, timedelta

import pytest
from django.http import HttpResponseBase, StreamingHttpResponse
from django.test import Client
from django.urls import reverse

from leaderboard import audit
from leaderboard.models import AuditEvent, Edition, Split, User
from leaderboard.storage import truth_values
from tests import builders, pages
from tests.leaderboard.web.test_every_page import assert_sound

PAGE, CSV, JSON = "/maintain/audit/", "/maintain/audit/events.csv", "/maintain/audit/events.json"


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
        ["owner@example.org", "opened", "Door a-1"],
    ]
    assert shown[2][5] == "reason: air"


@pytest.mark.parametrize(
    ("query", "n"),
    [
        ("actor=owner", 1),
        ("verb=opened", 2),
        ("noun=Door", 2),
        ("noun_id=b", 1),
        ("verb=opened&noun=Door", 1),
        ("since=2000-01-01&until=9999-12-31", 3),
        ("until=2000-01-01", 0),
        ("since=0001-01-01", 3),
    ],
)
def test_events_are_filtered_on_the_page_and_in_the_exports(
    keeper: Client, trail: None, query: str, n: int
) -> None:
    page = keeper.get(f"{PAGE}?{query}")
    assert len(rows(page)) == n if n else "No results." in pages.page(page).one("main").text
    assert len(json.loads(text_of(keeper.get(f"{JSON}?{query}")))) == n
    assert len(list(csv.DictReader(io.StringIO(text_of(keeper.get(f"{CSV}?{query}")))))) == n


def test_days_are_of_utc_and_include_their_ends(keeper: Client, trail: None) -> None:
    days = sorted(at.astimezone(UTC).date() for at in AuditEvent.objects.values_list("at", flat=True))
    assert len(rows(keeper.get(f"{PAGE}?since={days[0]}&until={days[-1]}"))) == 3
    yesterday = days[0] - timedelta(days=1)
    assert "No results." in pages.page(keeper.get(f"{PAGE}?until={yesterday}")).one("main").text


@pytest.mark.parametrize("query", ["since=nonsense", "until=2026-02-30", "verb=nowhere", "actor=%00"])
@pytest.mark.parametrize("address", [PAGE, CSV, JSON])
def test_a_question_that_makes_no_sense_is_a_clear_page(
    keeper: Client, trail: None, address: str, query: str
) -> None:
    response = keeper.get(f"{address}?{query}")
    assert response.status_code == 400
    assert "See the field marked above" in assert_sound(response).one("main").text


def test_an_event_that_is_not_sealed_yet_says_so(keeper: Client, trail: None) -> None:
    audit.record(verb="closed", noun="Window", noun_id="b-2")
    assert [row[6] == "not sealed yet" for row in rows(keeper.get(PAGE))] == [True, False, False, False]
    assert json.loads(text_of(keeper.get(JSON)))[0]["hash"] is None


def test_the_exports_hold_every_column_and_the_chain(keeper: Client, trail: None) -> None:
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
    response = keeper.get(CSV)
    assert response.headers["Content-Type"] == "text/csv; charset=utf-8"
    assert 'filename="tsttc-audit.csv"' in response.headers["Content-Disposition"]
    assert "no-store" in response.headers["Cache-Control"]


def test_the_page_has_the_beginning_of_a_digest_and_the_exports_have_all_of_it(
    keeper: Client, owner: User
) -> None:
    digest = f"sha256:{'0123456789abcdef' * 4}"
    audit.record(verb="v", noun="n", noun_id="1", actor=owner, details={"report_digest": digest})
    [[*_, told, _]] = rows(keeper.get(PAGE))
    assert told == "report_digest: sha256:01234567…"
    assert digest in text_of(keeper.get(CSV))
    assert digest in text_of(keeper.get(JSON))


def test_no_cell_of_the_table_is_a_formula(keeper: Client, owner: User) -> None:
    audit.record(verb="v", noun="n", noun_id="=cmd|' /C calc'!A0", actor=owner)
    [row] = csv.DictReader(io.StringIO(text_of(keeper.get(CSV))))
    assert row["noun_id"] == "'=cmd|' /C calc'!A0"


def test_a_long_trail_has_pages_that_keep_the_question(keeper: Client, db: None) -> None:
    audit.record_many(("scored", "Evaluation", number, {}) for number in range(150))
    root = pages.page(keeper.get(f"{PAGE}?verb=scored"))
    [older] = [a for a in root.all("a") if a.text == "older"]
    assert len(rows(keeper.get(PAGE + older.attributes["href"]))) == 50


# --- the administration ----------------------------------------------------------------------------------


def test_a_changed_quota_is_audited_with_its_values(
    keeper: Client, benchmark: None, maintainer: User
) -> None:
    address = reverse("admin:leaderboard_split_change", args=["test"])
    form = keeper.get(address).context["adminform"].form
    present = {name: form.initial.get(name) for name in form.fields}
    data = {name: "" if value is None else value for name, value in present.items()} | {"quota_limit": 7}
    data |= {"quota_window": "30 00:00:00", "quota_min_gap": "24:00:00"}
    for name in ("opens_at", "closes_at"):
        data |= {f"{name}_0": "", f"{name}_1": ""}
    assert keeper.post(address, data).status_code == 302
    assert Split.objects.get(pk="test").quota_limit == 7
    event = AuditEvent.objects.get(verb="changed", noun="Split", noun_id="test", actor=maintainer)
    assert event.details["quota_limit"] == "7"
    assert event.details["said"] == [{"changed": {"fields": ["Quota limit"]}}]


def test_who_became_a_maintainer_is_audited(keeper: Client, owner: User, maintainer: User) -> None:
    address = reverse("admin:leaderboard_user_change", args=[owner.pk])
    data = {"email": owner.email, "name": owner.name, "is_active": "on", "is_staff": "on"}
    data |= {
        "date_joined_0": "2026-11-20",
        "date_joined_1": "12:00:00",
        "last_login_0": "",
        "last_login_1": "",
    }
    assert keeper.post(address, data).status_code == 302
    event = AuditEvent.objects.get(verb="changed", noun="User", noun_id=owner.pk, actor=maintainer)
    assert (event.details["is_staff"], event.details["is_superuser"]) == ("True", "False")


# --- nothing that is nobody's business -------------------------------------------------------------------


def test_no_secret_and_no_true_value_stands_in_the_trail(
    edition: Edition, owner: User, maintainer: User, client: Client
) -> None:
    token = builders.token(owner)
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    client.force_login(maintainer)
    address = reverse("admin:auth_user_password_change", args=[owner.pk])
    client.post(address, {"password1": "new horse battery", "password2": "new horse battery"})
    told = json.dumps([[e.noun_id, e.details] for e in AuditEvent.objects.all()])
    truth = truth_values.load(edition.ground_truth_id).ttc_s.tolist()
    assert token not in told
    assert token.removeprefix("tsttc_")[9:] not in told
    assert "horse" not in told
    assert owner.password not in told
    assert not [value for value in truth if repr(value) in told]
    assert AuditEvent.objects.filter(noun="User", verb="changed").count() == 1
