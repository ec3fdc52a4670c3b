"""A submission under the wrong method is moved by its team, while no other team sees it."""

import json
from pathlib import Path

import pytest
from django.test import Client
from django.utils import timezone

from evaluator import receipts as library
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, Method, Split, Submission, User
from leaderboard.quotas import usage
from leaderboard.submissions import intake, moving, receipts
from tests import builders, pages


def sent(user: User, edition: Edition, method: str, factor: float = 1.1) -> Submission:
    data = builders.predictions(edition, factor=factor)
    return builders.submit(user, data, method=method, visibility="PRIVATE")


def move(submission: Submission, name: str, actor: User) -> Submission:
    return moving.move(submission=submission, method_name=name, actor=actor, now=timezone.now())


def refused(submission: Submission, name: str, actor: User) -> str:
    before = Submission.objects.get(pk=submission.pk).method_id
    with pytest.raises(Refused) as caught:
        move(submission, name, actor)
    assert Submission.objects.get(pk=submission.pk).method_id == before
    return caught.value.code


def test_a_moved_submission_keeps_its_slot_and_its_receipt(
    edition: Edition, owner: User, teammate: User
) -> None:
    wrong, right = (
        sent(owner, edition, name, factor) for name, factor in (("Fromer", 1.1), ("TTC-Former", 1.2))
    )
    builders.score_all()
    before = receipts.receipt(submission=wrong)
    split, team = Split.objects.get(pk="test"), wrong.method.team
    used = usage.state(team=team, user=owner, split=split, now=timezone.now())
    moved = move(wrong, str(right.method_id), teammate)
    assert (moved.method, moved.digest) == (right.method, wrong.digest)
    assert usage.state(team=team, user=owner, split=split, now=timezone.now()).used == used.used
    keys = library.read_keys(json.dumps(receipts.public_keys()).encode())
    names = [
        library.verify(text.encode(), keys).method for text in (before, receipts.receipt(submission=moved))
    ]
    assert names == ["Fromer", "TTC-Former"]
    [event] = AuditEvent.objects.filter(verb="moved")
    assert (event.actor, event.noun_id) == (teammate, str(wrong.pk))
    assert (event.details["from"], event.details["to"]) == (str(wrong.method_id), str(right.method_id))
    assert move(moved, "TTC-Former", owner).method == right.method
    assert AuditEvent.objects.filter(verb="moved").count() == 1, "it is there already"


@pytest.mark.slow
def test_a_move_touches_one_file_of_one_split_and_one_team(
    edition: Edition, owner: User, stranger: User, tmp_path: Path
) -> None:
    val = builders.import_truth(tmp_path, split="val")
    files = {
        (user, split, name): builders.submit(
            user,
            builders.predictions(made, factor=factor),
            split=split,
            method=name,
            visibility="PRIVATE",
        )
        for user in (owner, stranger)
        for split, made in (("test", edition), ("val", val))
        for name, factor in (("Wrong", 1.1), ("Right", 1.2))
    }
    moved = files.pop((owner, "val", "Wrong"))
    move(moved, "Right", owner)
    moved.refresh_from_db()
    right = files[owner, "test", "Right"].method
    assert (moved.method, moved.split_id) == (right, "val")
    kept = {row.pk: (row.method_id, row.split_id, row.digest) for row in files.values()}
    rows = Submission.objects.exclude(pk=moved.pk)
    assert {row.pk: (row.method_id, row.split_id, row.digest) for row in rows} == kept
    assert [event.noun_id for event in AuditEvent.objects.filter(verb="moved")] == [str(moved.pk)]


def test_the_same_file_on_another_split_or_of_another_team_is_no_obstacle(
    edition: Edition, owner: User, stranger: User, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val")
    data = builders.predictions(edition)
    wrong = builders.submit(owner, data, method="Wrong", visibility="PRIVATE")
    builders.submit(owner, data, split="val", method="Right", visibility="PRIVATE")
    builders.submit(stranger, data, method="Right", visibility="PRIVATE")
    assert move(wrong, "Right", owner).method.name == "Right"
    assert move(wrong, "Wrong", owner).method.name == "Wrong"
    builders.submit(owner, data, method="Right", visibility="PRIVATE")
    assert refused(wrong, "Right", owner) == "same-file"


def test_a_retry_under_the_former_name_is_a_new_submission_and_under_the_new_one_the_first(
    edition: Edition, owner: User
) -> None:
    data = builders.predictions(edition)
    wrong = builders.submit(owner, data, method="Wrong", visibility="PRIVATE")
    sent(owner, edition, "Right", 1.2)
    move(wrong, "Right", owner)
    assert builders.send(owner, data, method="Right").submission == wrong
    assert builders.send(owner, data, method="Wrong").is_new


def test_a_submission_is_not_moved_onto_the_same_file(edition: Edition, owner: User) -> None:
    first, second = (sent(owner, edition, name) for name in ("First", "Second"))
    assert refused(first, "Second", owner) == "same-file"
    intake.withdraw(submission=second, actor=owner, now=timezone.now())
    assert move(first, "Second", owner).method.name == "Second"


@pytest.mark.parametrize("visibility", ["PUBLIC", "ANONYMOUS"])
def test_nothing_is_moved_from_or_to_what_others_see(edition: Edition, owner: User, visibility: str) -> None:
    private = sent(owner, edition, "Private")
    shown = builders.submit(
        owner, builders.predictions(edition, factor=1.2), method="Shown", visibility=visibility
    )
    assert refused(private, "Shown", owner) == "not-movable"
    assert refused(shown, "Private", owner) == "not-movable"
    assert not moving.targets(shown).exists()
    assert not moving.targets(private).exists()


def test_withdrawn_or_hidden_submissions_and_other_teams_methods_stay(
    edition: Edition, owner: User, stranger: User, maintainer: User
) -> None:
    mine, other, theirs = (
        sent(user, edition, name, factor)
        for user, name, factor in ((owner, "Mine", 1.1), (owner, "Other", 1.2), (stranger, "Theirs", 1.3))
    )
    assert refused(mine, "Theirs", owner) == "unknown-method"
    assert refused(mine, str(theirs.method_id), owner) == "unknown-method"
    assert refused(mine, "Other", stranger) == "not-yours"
    assert refused(mine, "Other", maintainer) == "not-yours"
    Method.objects.filter(pk=other.method_id).update(deleted_at=timezone.now())
    assert refused(mine, "Other", owner) == "unknown-method"
    Method.objects.filter(pk=other.method_id).update(deleted_at=None)
    Submission.objects.filter(pk=mine.pk).update(hidden_at=timezone.now())
    assert refused(mine, "Other", owner) == "not-movable"
    Submission.objects.filter(pk=mine.pk).update(hidden_at=None, withdrawn_at=timezone.now())
    assert refused(mine, "Other", owner) == "not-movable"


@pytest.mark.slow
def test_page_and_api_move(client: Client, edition: Edition, owner: User, stranger: User) -> None:
    wrong, right = (
        sent(owner, edition, name, factor) for name, factor in (("Fromer", 1.1), ("TTC-Former", 1.2))
    )
    sent(stranger, edition, "Theirs")
    client.force_login(owner)
    links = pages.page(client.get(f"/submissions/{wrong.pk}/")).one("main").all("a")
    assert f"/submissions/{wrong.pk}/move/" in [link.attributes.get("href") for link in links]
    form = pages.page(client.get(f"/submissions/{wrong.pk}/move/")).one("main")
    assert [option.text for option in form.all("option")] == ["Choose a method", "TTC-Former"]
    assert client.post(f"/submissions/{wrong.pk}/move/", {"method": "Nope"}).status_code == 422
    done = client.post(f"/submissions/{wrong.pk}/move/", {"method": str(right.method_id)})
    assert (done.status_code, done.headers["Location"]) == (302, f"/submissions/{wrong.pk}/")
    address = f"/api/v1/submissions/{wrong.pk}/move"
    headers = {"Authorization": f"Bearer {builders.token(owner)}"}
    back = client.post(address, {"method": "Fromer"}, content_type="application/json", headers=headers)
    assert (back.status_code, back.json()["method"]) == (200, "Fromer")
    nowhere = client.post(address, {}, content_type="application/json", headers=headers)
    assert (nowhere.status_code, nowhere.json()["code"]) == (422, "missing-field")
    foreign = {"Authorization": f"Bearer {builders.token(stranger)}"}
    assert client.post(address, {"method": "Theirs"}, headers=foreign).status_code in {404, 415}
