"""The form through which a file comes in."""

import json
from datetime import timedelta

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.http import HttpResponseBase
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.models import Edition, Method, Split, Submission, User
from tests import builders, pages

FIELDS = {"split": "test", "method": "Foo", "description": "", "paper_url": "", "code_url": ""}


def send(client: Client, data: bytes | None = b"{}", **fields: str) -> HttpResponseBase:
    """Post the form as a browser does."""
    file = {} if data is None else {"file": SimpleUploadedFile("p.json", data, "application/json")}
    return client.post("/submit/", {**FIELDS, **fields, **file})


def error_at(response: HttpResponseBase, field: str) -> str:
    assert response.status_code == 422
    return pages.page(response).one("div", id=f"{field}-error").text


@pytest.fixture
def signed_in(client: Client, owner: User) -> Client:
    client.force_login(owner)
    return client


def test_signed_out_visitor_is_led_to_sign_in_and_back(client: Client, edition: Edition) -> None:
    response = client.get("/submit/?split=test")
    assert response.status_code == 302
    assert response.headers["Location"] == "/accounts/login/?next=/submit/%3Fsplit%3Dtest"
    login = pages.page(client.get(response.headers["Location"]))
    (sign_up,) = [a for a in login.one("main").all("a") if a.text == "Sign up"]
    assert sign_up.attributes["href"] == "/accounts/signup/?next=%2Fsubmit%2F%3Fsplit%3Dtest"


def test_signed_out_post_keeps_nothing(client: Client, edition: Edition) -> None:
    assert send(client).status_code == 302
    assert not Submission.objects.exists()


def test_good_file_leads_to_its_own_page(signed_in: Client, edition: Edition, owner: User) -> None:
    response = send(signed_in, builders.predictions(edition), description="Box ratio.")
    submission = Submission.objects.get()
    assert response.status_code == 302
    assert response.headers["Location"] == f"/submissions/{submission.pk}/"
    assert (submission.via, submission.submitted_by, submission.filename) == ("WEB", owner, "p.json")
    assert submission.method.description == "Box ratio."


def test_person_without_a_team_becomes_a_team_of_one(signed_in: Client, edition: Edition) -> None:
    send(signed_in, builders.predictions(edition))
    assert Method.objects.get().team.name == "Owls"


def test_same_file_again_leads_to_the_first_submission_and_says_so(
    signed_in: Client, edition: Edition
) -> None:
    first, again = (send(signed_in, builders.predictions(edition)) for _ in range(2))
    assert first.headers["Location"] == again.headers["Location"]
    assert "submitted before" in pages.page(signed_in.get(again.headers["Location"])).one("main").text


def test_page_says_that_a_new_method_is_private_until_it_is_shown(
    signed_in: Client, edition: Edition
) -> None:
    said = pages.page(signed_in.get("/submit/")).one("main").text
    assert "A new method is private: only your team sees what it scores, until you show it." in said


def test_own_teams_methods_are_offered_and_nobody_elses(
    signed_in: Client, edition: Edition, owner: User, stranger: User
) -> None:
    builders.submit(owner, builders.predictions(edition), method="Mine")
    builders.submit(stranger, builders.predictions(edition), method="Theirs")
    offered = pages.page(signed_in.get("/submit/")).one("datalist").all("option")
    assert [option.attributes["value"] for option in offered] == ["Mine"]


@pytest.mark.parametrize(
    ("visibility", "said"),
    [
        ("PRIVATE", ""),
        ("ANONYMOUS", "Mine is anonymous: everybody sees its results on every split, under the name "),
        ("PUBLIC", "Mine is public: everybody sees its results on every split."),
    ],
)
def test_page_and_api_say_who_will_see_the_result_before_anything_is_sent(
    signed_in: Client, edition: Edition, owner: User, visibility: str, said: str
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Mine", visibility=visibility)
    told = pages.page(signed_in.get("/submit/")).one("div", id="notices").text
    assert (said in told, bool(told)) == (True, bool(said))
    [method] = signed_in.get("/api/v1/methods").json()
    answer = signed_in.get(f"/api/v1/submissions/{sent.pk}").json()
    assert method["notice"] == answer["notice"] == told
    builders.submit(owner, builders.predictions(edition), method="Another")
    refused = pages.page(send(signed_in, None, method="Mine"))
    assert refused.one("div", id="notices").text == told


def test_who_sees_a_method_is_told_to_its_own_team_alone(
    client: Client, edition: Edition, owner: User, stranger: User
) -> None:
    made = builders.submit(owner, builders.predictions(edition), method="Mine").method
    client.force_login(stranger)
    assert client.get(f"/api/v1/methods/{made.pk}").json()["notice"] == ""
    assert "Mine is public" not in client.get("/submit/").text


def test_the_only_open_split_is_chosen_and_closed_ones_cannot_be(signed_in: Client, edition: Edition) -> None:
    choices = pages.page(signed_in.get("/submit/")).all("input", type="radio")
    assert [c.attributes["value"] for c in choices if "checked" in c.attributes] == ["test"]
    assert [c.attributes["value"] for c in choices if "disabled" in c.attributes] == ["val", "demo"]


def test_every_missing_field_is_named_at_once(signed_in: Client, edition: Edition) -> None:
    response = send(signed_in, None, split="", method="")
    assert error_at(response, "split") == "No split was chosen; expected one of those listed."
    assert error_at(response, "method") == "No method was named; expected its name on the board."
    assert error_at(response, "file") == "No prediction file was sent; expected a JSON file."
    assert not Submission.objects.exists()


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("split", "nowhere", "There is no split 'nowhere'"),
        ("split", "val", "Submissions to val are not open yet"),
        ("method", "x" * 81, "has 81 characters; expected at most 80"),
        ("method", "bell\x07", "has the character U+0007"),
        ("paper_url", "javascript:alert(1)", "expected an address that begins with http:// or https://"),
        ("code_url", "ftp://example.org/", "expected an address that begins with http:// or https://"),
        ("description", "x" * 2001, "has 2001 characters; expected at most 2000"),
    ],
)
def test_refusals_stand_at_their_field(
    signed_in: Client, edition: Edition, field: str, value: str, said: str
) -> None:
    response = send(signed_in, builders.predictions(edition), **{field: value})
    assert said in error_at(response, field)
    assert not Submission.objects.exists()


@pytest.mark.parametrize(
    ("shift", "said"), [(timedelta(days=1), "open at"), (-timedelta(days=1), "closed at")]
)
def test_early_and_late_are_refused_with_the_time(
    signed_in: Client, edition: Edition, shift: timedelta, said: str
) -> None:
    field = "opens_at" if shift > timedelta(0) else "closes_at"
    Split.objects.filter(pk="test").update(**{field: timezone.now() + shift})
    assert said in error_at(send(signed_in, builders.predictions(edition)), "split")


def test_what_was_typed_is_kept_when_something_is_wrong(signed_in: Client, edition: Edition) -> None:
    response = send(signed_in, None, method="Foo & Sons", paper_url="https://example.org/p")
    root = pages.page(response)
    assert root.one("input", name="method").attributes["value"] == "Foo & Sons"
    assert root.one("input", name="paper_url").attributes["value"] == "https://example.org/p"
    assert "open" in root.one("details").attributes


def test_fields_name_their_errors_for_those_who_cannot_see(signed_in: Client, edition: Edition) -> None:
    root = pages.page(send(signed_in, None, method=""))
    for name in ("method", "file"):
        field = root.one("input", name=name)
        described = field.attributes["aria-describedby"].split()
        assert f"{name}-error" in described
        assert all(root.all(tag, id=i) for i in described for tag in ["div"])
        assert field.attributes["aria-invalid"] == "true"


def test_file_over_the_limit_is_refused_with_its_size(
    signed_in: Client, edition: Edition, settings: Settings
) -> None:
    settings.MAX_PREDICTIONS_BYTES = 1000
    said = error_at(send(signed_in, b"x" * 1500), "file")
    assert "1,500 bytes; expected at most 1,000" in said


def test_announced_excess_is_answered_413_without_reading(
    signed_in: Client, edition: Edition, settings: Settings
) -> None:
    settings.MAX_PREDICTIONS_BYTES = 1000
    response = send(signed_in, b"x" * 200_000)
    assert response.status_code == 413
    assert "expected at most 1,000" in pages.page(response).one("main").text


def test_empty_file_is_taken_and_judged_by_the_worker(signed_in: Client, edition: Edition) -> None:
    response = send(signed_in, b"")
    assert response.status_code == 302
    builders.score_all()
    said = pages.page(signed_in.get(response.headers["Location"])).one("main").text
    assert "1 problem in the file" in said


def test_form_without_its_token_is_refused_on_a_page_that_says_why(edition: Edition, owner: User) -> None:
    strict = Client(enforce_csrf_checks=True)
    strict.force_login(owner)
    response = send(strict, json.dumps({"0": 1}).encode())
    assert response.status_code == 403
    assert "form had expired" in pages.page(response).one("h1").text
    assert not Submission.objects.exists()


def test_form_page_is_never_stored_by_caches(signed_in: Client, edition: Edition) -> None:
    assert "no-store" in signed_in.get("/submit/").headers["Cache-Control"]
