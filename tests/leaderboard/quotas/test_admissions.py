"""A split by admission takes files of admitted teams alone, and says at every door how to be admitted."""

import pytest
from django.core.files.base import ContentFile
from django.test import Client
from django.utils import timezone

from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.models import Admission, AuditEvent, Edition, Split, Submission, Team, User
from leaderboard.people import teams
from leaderboard.quotas import admissions
from tests import builders, pages
from tests.leaderboard.web.test_every_page import assert_sound

SENTENCE = (
    "Only admitted teams can submit to Test, and your team is not one of them; write to jury@example.org."
)


@pytest.fixture
def by_admission(edition: Edition) -> Edition:
    """The test split, by admission."""
    Split.objects.filter(pk="test").update(
        needs_admission=True, how_to_be_admitted="write to jury@example.org."
    )
    return edition


def admit(team: Team, maintainer: User) -> Admission:
    split = Split.objects.get(pk="test")
    return admissions.admit(team=team, split=split, reason="R", actor=maintainer, now=timezone.now())


def test_a_team_that_is_not_admitted_reads_so_everywhere_in_the_same_words(
    client: Client, by_admission: Edition, owner: User
) -> None:
    client.force_login(owner)
    form = pages.page(client.get("/submit/"))
    assert SENTENCE in [
        row.text.partition(" See the ")[0] for row in form.one("ul", class_="closed-splits").all("li")
    ]
    assert "test" not in [row.attributes["value"] for row in form.all("input", type="radio", name="split")]
    [quota] = [row for row in client.get("/api/v1/quota").json() if row["split"] == "test"]
    assert (quota["is_open"], quota["next_slot_at"], quota["sentence"]) == (False, None, SENTENCE)
    data = builders.predictions(by_admission)
    fields = {"split": "test", "method": "Foo"}
    sent = client.post("/submit/", {**fields, "file": ContentFile(data, name="p.json")})
    assert (sent.status_code, SENTENCE in pages.page(sent).text) == (422, True)
    headers = {"Authorization": f"Bearer {builders.token(owner)}"}
    file = ContentFile(data, name="p.json")
    answer = client.post("/api/v1/submissions", {**fields, "file": file}, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (403, "not-admitted")
    assert answer.json()["detail"] == SENTENCE
    assert not Submission.objects.exists()
    splits = {row["split"]: row["needs_admission"] for row in client.get("/api/v1/splits").json()}
    assert splits == {"test": True, "val": False, "demo": False}


def test_an_admitted_team_submits_until_its_admission_ends(
    by_admission: Edition, owner: User, teammate: User, stranger: User, maintainer: User
) -> None:
    team = teams.team_of(user=owner)
    row = admit(team, maintainer)
    builders.submit(teammate, builders.predictions(by_admission))
    with pytest.raises(Refused, match="Only admitted teams"):
        builders.submit(stranger, builders.predictions(by_admission))
    admissions.end(row=row, reason="Left.", actor=maintainer)
    with pytest.raises(Refused, match="Only admitted teams"):
        builders.submit(owner, builders.predictions(by_admission, factor=1.2))
    assert Submission.objects.count() == 1
    events = AuditEvent.objects.filter(noun_id=str(team.pk), verb__in=["admitted", "admission_ended"])
    assert [(event.verb, event.actor, event.details) for event in events.order_by("pk")] == [
        ("admitted", maintainer, {"split": "test", "reason": "R"}),
        ("admission_ended", maintainer, {"split": "test", "reason": "Left."}),
    ]


def test_maintainers_admit_from_the_page_of_a_team_and_nobody_else_does(
    keeper: Client, by_admission: Edition, owner: User, maintainer: User
) -> None:
    team = teams.team_of(user=owner)
    page = f"/maintain/quotas/{team.pk}/"
    [link] = [a for a in pages.page(keeper.get(page)).all("a") if a.text == "admit it to test"]
    address = link.attributes["href"] or ""
    assert keeper.get(address).status_code == 200
    assert_sound(keeper.post(address, {"reason": " "}))
    assert keeper.post(address, {"reason": "They asked."}).status_code == 302
    assert Admission.objects.get().admitted_by == maintainer
    [link] = [a for a in pages.page(keeper.get(page)).all("a") if a.text == "revoke its admission to test"]
    assert keeper.post(link.attributes["href"] or "", {"reason": "It left."}).status_code == 302
    assert not Admission.objects.exists()
    assert keeper.get(link.attributes["href"] or "").status_code == 404
    with pytest.raises(NotMaintainer):
        admit(team, owner)


def test_an_admission_that_somebody_else_than_a_maintainer_ends_stays(
    by_admission: Edition, owner: User, stranger: User, maintainer: User
) -> None:
    rows = [admit(teams.team_of(user=user), maintainer) for user in (owner, stranger)]
    for row in rows:
        for actor in (owner, stranger):
            with pytest.raises(NotMaintainer):
                admissions.end(row=row, reason="R", actor=actor)
    assert set(Admission.objects.all()) == set(rows)
    assert not AuditEvent.objects.filter(verb="admission_ended").exists()
