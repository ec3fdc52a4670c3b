"""A browser without a script forgets the chosen file; the site keeps it until the question is answered."""

import os
from datetime import timedelta
from pathlib import Path

import pytest
from django.core.files.base import ContentFile
from django.core.files.uploadedfile import SimpleUploadedFile
from django.http import HttpResponseBase
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.models import Edition, Split, Submission, User
from leaderboard.storage import asked, files
from leaderboard.upkeep import pollers
from tests import builders, pages

FIELDS = {"split": "test", "method": "Mine"}


@pytest.fixture
def public(edition: Edition, owner: User, stranger: User) -> Edition:
    """Two teams with a public method of one name each: a file for it is asked about."""
    for user, factor, name in ((owner, 1.1, "Mine"), (stranger, 1.15, "Theirs")):
        builders.submit(user, builders.predictions(edition, factor=factor), method=name)
    return edition


def send(
    client: Client, data: bytes | None = None, *, has_script: bool = False, **fields: str
) -> HttpResponseBase:
    file = {} if data is None else {"file": SimpleUploadedFile("mine & <b>.json", data)}
    headers = {"Accept": "application/json, text/html" if has_script else "text/html"}
    return client.post("/submit/", {**FIELDS, **fields, **file}, headers=headers)


def question(response: HttpResponseBase) -> dict[str, str]:
    """The fields with which a browser answers: the tick, and what is hidden."""
    assert response.status_code == 422
    form = pages.page(response).one("form", id="submit")
    fields = {each.attributes["name"]: each.attributes["value"] for each in form.all("input", type="hidden")}
    fields.pop("csrfmiddlewaretoken", None)
    tick = form.one("div", class_="question").one("input", type="checkbox")
    return {name: value or "" for name, value in fields.items()} | {
        "confirmed": tick.attributes["value"] or ""
    }


def stored(settings: Settings) -> list[Path]:
    return sorted((Path(settings.FILES_DIR) / asked.FOLDER).glob("*"))


@pytest.mark.slow
def test_the_tick_alone_submits_the_file_that_was_asked_about(
    signed_in: Client, public: Edition, settings: Settings
) -> None:
    data = builders.predictions(public, factor=1.2)
    response = send(signed_in, data)
    answer = question(response)
    assert "keeps mine & <b>.json for an hour" in pages.page(response).one("div", class_="question").text
    assert "required" not in pages.page(response).one("input", type="file").attributes
    assert Submission.objects.count() == 2
    assert send(signed_in, **answer).status_code == 302
    sent = Submission.objects.latest("submitted_at")
    assert (sent.digest, sent.filename) == (files.measure(ContentFile(data)).digest, "mine & <b>.json")
    assert stored(settings) == []
    assert builders.score_all() == 3


@pytest.mark.slow
def test_without_the_tick_the_question_stays_and_the_file_too(signed_in: Client, public: Edition) -> None:
    answer = question(send(signed_in, builders.predictions(public, factor=1.2)))
    again = question(send(signed_in, **answer | {"confirmed": ""}))
    assert again == answer
    refused = send(signed_in, **answer | {"method": ""})
    assert pages.page(refused).one("input", name="kept").attributes["value"] == answer["kept"]
    assert send(signed_in, **again).status_code == 302


@pytest.mark.slow
def test_a_script_keeps_the_file_itself_so_the_site_does_not(
    signed_in: Client, public: Edition, settings: Settings
) -> None:
    answer = question(send(signed_in, builders.predictions(public, factor=1.2), has_script=True))
    assert "kept" not in answer
    assert stored(settings) == []


@pytest.mark.slow
def test_nobody_answers_with_the_file_of_another_account(
    client: Client, public: Edition, owner: User, stranger: User, teammate: User
) -> None:
    client.force_login(owner)
    answer = question(send(client, builders.predictions(public, factor=1.2)))
    for other, name in ((stranger, "Theirs"), (teammate, "Mine")):
        client.force_login(other)
        response = send(client, **answer | {"method": name})
        assert response.status_code == 422
        assert "The file is no longer kept; choose it again." in pages.page(response).one("main").text
    # With a file of their own kept, the digest is another one.
    own = question(send(client, builders.predictions(public, factor=1.3)))
    assert send(client, **own | {"kept": answer["kept"]}).status_code == 422
    assert Submission.objects.count() == 2
    client.force_login(owner)
    assert send(client, **answer).status_code == 302
    client.force_login(teammate)
    assert send(client, **own).status_code == 302


@pytest.mark.slow
def test_an_answer_for_another_split_or_method_is_asked_again(
    signed_in: Client, public: Edition, owner: User, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val")
    builders.submit(owner, builders.predictions(public, factor=1.4), method="Second")
    answer = question(send(signed_in, builders.predictions(public, factor=1.2)))
    on_val = question(send(signed_in, **answer | {"split": "val"}))
    second = question(send(signed_in, **answer | {"method": "Second"}))
    assert len({answer["confirmed"], on_val["confirmed"], second["confirmed"]}) == 3
    assert Submission.objects.count() == 3
    assert send(signed_in, **on_val | {"split": "val"}).status_code == 302
    assert Submission.objects.latest("submitted_at").split_id == "val"


@pytest.mark.slow
def test_an_account_has_one_file_kept_and_a_later_question_replaces_it(
    signed_in: Client, public: Edition, settings: Settings
) -> None:
    first, second = (
        question(send(signed_in, builders.predictions(public, factor=factor))) for factor in (1.2, 1.3)
    )
    assert len(stored(settings)) == 1
    assert "no longer kept" in pages.page(send(signed_in, **first)).one("main").text
    assert send(signed_in, **second).status_code == 302


@pytest.mark.slow
def test_after_an_hour_the_file_is_no_longer_taken_and_is_cleaned_away(
    client: Client, public: Edition, owner: User, stranger: User, settings: Settings
) -> None:
    answers = {}
    for user, name in ((owner, "Mine"), (stranger, "Theirs")):
        client.force_login(user)
        answers[user] = question(send(client, builders.predictions(public, factor=1.2), method=name))
    client.force_login(owner)
    [mine] = [path for path in stored(settings) if path.name == Path(asked.name_for(owner)).name]
    old = (timezone.now() - asked.MAX_AGE - timedelta(minutes=1)).timestamp()
    os.utime(mine, (old, old))
    response = send(client, **answers[owner])
    assert "The file is no longer kept; choose it again." in pages.page(response).one("main").text
    pollers.clean(now=timezone.now())
    assert len(stored(settings)) == 1
    assert mine not in stored(settings)
    client.force_login(stranger)
    assert send(client, **answers[stranger] | {"method": "Theirs"}).status_code == 302


@pytest.mark.slow
def test_a_store_that_takes_nothing_leaves_the_question_and_asks_for_the_file_again(
    signed_in: Client, public: Edition, settings: Settings
) -> None:
    folder = Path(settings.FILES_DIR) / asked.FOLDER
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("a file in place of the folder")
    answer = question(send(signed_in, builders.predictions(public, factor=1.2)))
    assert "kept" not in answer
    assert send(signed_in, builders.predictions(public, factor=1.2), **answer).status_code == 302


@pytest.mark.slow
def test_a_kept_file_uses_no_slot_and_is_refused_as_any_other(signed_in: Client, public: Edition) -> None:
    answer = question(send(signed_in, builders.predictions(public, factor=1.2)))
    Split.objects.filter(pk="test").update(closes_at=timezone.now())
    response = send(signed_in, **answer)
    assert "closed at" in pages.page(response).text
    assert Submission.objects.count() == 2
    Split.objects.filter(pk="test").update(closes_at=None)
    assert send(signed_in, **answer).status_code == 302
