"""A form of the site takes each field once: of two, the last one would win without a word."""

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client

from leaderboard.mails import notices
from leaderboard.models import MailKind, PublishedResult, Team, User
from tests import pages

SENTENCE = "The request has the field '{}' 2 times; expected it once."


@pytest.mark.parametrize("name", ["file", "text"])
@pytest.mark.parametrize("kind", ["texts", "files", "both"])
def test_a_paper_that_comes_twice_is_not_imported(keeper: Client, name: str, kind: str) -> None:
    files = [SimpleUploadedFile(each, b"{}") for each in ("a.json", "b.json")]
    twice = {"texts": ["{}", "{}"], "files": files, "both": ["{}", files[0]]}[kind]
    response = keeper.post("/maintain/published/", {name: twice})
    assert response.status_code == 422
    assert SENTENCE.format(name) in pages.page(response).one("main").text


def test_a_row_that_has_two_scores_is_not_imported(keeper: Client) -> None:
    before = PublishedResult.objects.count()
    form = {"step": "row", "row-name": "Later", "row-scores": ["1", "2"]}
    response = keeper.post("/maintain/published/", form)
    assert SENTENCE.format("scores") in pages.page(response).one("main").text
    assert PublishedResult.objects.count() == before


def test_two_names_of_a_team_are_refused(signed_in: Client, team: Team) -> None:
    former = team.name
    response = signed_in.post("/team/", {"step": "rename", "name": ["Owls", "Hawks"]})
    assert response.status_code == 422
    assert SENTENCE.format("name") in pages.page(response).one("main").text
    team.refresh_from_db()
    assert team.name == former


def test_a_choice_of_several_comes_several_times(signed_in: Client, owner: User) -> None:
    wanted = [MailKind.TOKEN, MailKind.SCORED]
    assert signed_in.post("/mails/", {"wanted": wanted}).status_code == 302
    owner.refresh_from_db()
    assert notices.muted_by(owner) == {"edition", "deadline", "announcement"}
