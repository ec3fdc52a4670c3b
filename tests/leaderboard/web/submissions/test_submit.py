"""The form through which a file comes in."""

import json
from datetime import timedelta

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.http import HttpResponseBase
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

import evaluator
from evaluator.predictions import plausibility
from leaderboard.models import Edition, Split, Submission, User
from leaderboard.storage import manifests
from leaderboard.web.decorators import SESSION_ENDED
from tests import builders, pages

FIELDS = {"split": "test", "method": "Foo", "description": "", "paper_url": "", "code_url": ""}


def send(client: Client, data: bytes | None = b"{}", **fields: str) -> HttpResponseBase:
    """Post the form as a browser does."""
    file = {} if data is None else {"file": SimpleUploadedFile("p.json", data, "application/json")}
    return client.post("/submit/", {**FIELDS, **fields, **file})


def error_at(response: HttpResponseBase, field: str) -> str:
    assert response.status_code == 422
    return pages.page(response).one("div", id=f"id_{field}_error").text


def test_signed_out_visitor_is_led_to_sign_in_and_back(client: Client, edition: Edition) -> None:
    response = client.get("/submit/?split=test")
    assert response.status_code == 302
    assert response.headers["Location"] == "/accounts/login/?next=/submit/%3Fsplit%3Dtest"
    login = pages.page(client.get(response.headers["Location"]))
    (sign_up,) = [a for a in login.one("main").all("a") if a.text == "Sign up"]
    assert sign_up.attributes["href"] == "/accounts/signup/?next=%2Fsubmit%2F%3Fsplit%3Dtest"


def test_form_sent_after_the_session_ended_says_so_on_the_sign_in_page(
    client: Client, edition: Edition
) -> None:
    response = send(client, builders.predictions(edition))
    assert response.status_code == 302
    root = pages.page(client.get(response.headers["Location"]))
    assert root.one("div", class_="messages").text == SESSION_ENDED
    assert not Submission.objects.exists()


@pytest.mark.slow
def test_good_file_leads_to_its_own_page(signed_in: Client, edition: Edition, owner: User) -> None:
    response = send(signed_in, builders.predictions(edition), description="Box ratio.")
    submission = Submission.objects.get()
    assert response.status_code == 302
    assert response.headers["Location"] == f"/submissions/{submission.pk}/"
    assert (submission.via, submission.submitted_by, submission.filename) == ("WEB", owner, "p.json")
    assert submission.method.description == "Box ratio."


@pytest.mark.slow
def test_same_file_again_leads_to_the_first_submission_and_says_so(
    signed_in: Client, edition: Edition
) -> None:
    first, again = (send(signed_in, builders.predictions(edition)) for _ in range(2))
    assert first.headers["Location"] == again.headers["Location"]
    assert (
        "You already submitted this file"
        in pages.page(signed_in.get(again.headers["Location"])).one("main").text
    )


@pytest.mark.slow
def test_own_teams_methods_are_offered_and_nobody_elses(
    signed_in: Client, edition: Edition, owner: User, stranger: User
) -> None:
    builders.submit(owner, builders.predictions(edition), method="Mine")
    builders.submit(stranger, builders.predictions(edition), method="Theirs")
    offered = pages.page(signed_in.get("/submit/")).one("datalist").all("option")
    assert [option.attributes["value"] for option in offered] == ["Mine"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("visibility", "sentence"),
    [
        ("PRIVATE", ""),
        ("ANONYMOUS", "“Mine” is anonymous: everyone sees its results on every split, under the name "),
        ("PUBLIC", "“Mine” is public: everyone sees its results on every split."),
    ],
)
def test_page_and_api_say_who_will_see_the_result_before_anything_is_sent(
    signed_in: Client, edition: Edition, owner: User, visibility: str, sentence: str
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Mine", visibility=visibility)
    notices = pages.page(signed_in.get("/submit/")).one("div", id="notices").text
    assert (sentence in notices, bool(notices)) == (True, bool(sentence))
    [method] = signed_in.get("/api/v1/methods").json()
    answer = signed_in.get(f"/api/v1/submissions/{sent.pk}").json()
    assert method["notice"] == answer["notice"] == notices
    builders.submit(owner, builders.predictions(edition), method="Another")
    refused = pages.page(send(signed_in, None, method="Mine"))
    assert refused.one("div", id="notices").text == notices


def test_who_sees_a_method_is_shown_to_its_own_team_alone(
    client: Client, edition: Edition, owner: User, stranger: User
) -> None:
    made = builders.submit(owner, builders.predictions(edition), method="Mine").method
    client.force_login(stranger)
    assert client.get(f"/api/v1/methods/{made.pk}").json()["notice"] == ""
    assert "Mine is public" not in client.get("/submit/").text


def test_the_only_open_split_is_chosen_and_of_closed_ones_stands_the_reason_with_a_link(
    signed_in: Client, edition: Edition
) -> None:
    root = pages.page(signed_in.get("/submit/"))
    [choice] = root.all("input", type="radio")
    assert (choice.attributes["value"], "checked" in choice.attributes) == ("test", True)
    closed = root.one("ul", class_="closed-splits")
    assert closed.text.startswith(
        "Submissions to Validation open once the maintainers provide the ground truth."
    )
    assert [a.attributes["href"] for a in closed.all("a")] == ["/board/val/", "/board/demo/"]


def test_with_every_split_closed_there_is_no_form(signed_in: Client, edition: Edition) -> None:
    Split.objects.update(closes_at=timezone.now() - timedelta(days=1))
    main = pages.page(signed_in.get("/submit/")).one("main")
    assert main.all("form") == []
    assert "No split accepts submissions at the moment." in main.text
    assert "/board/test/" in [a.attributes["href"] for a in main.all("a")]


def test_the_template_has_every_natural_key_and_is_rejected_until_it_is_filled_in(
    client: Client, signed_in: Client, edition: Edition
) -> None:
    answer = client.get("/submit/template/test.json")
    manifest = manifests.load(edition.ground_truth.manifest_digest)
    template = json.loads(answer.content)
    assert list(template) == list(manifest.natural_keys)
    assert set(template.values()) == {None}
    with pytest.raises(evaluator.Rejected) as rejected:
        evaluator.read_predictions(answer.content, manifest=manifest)
    assert {problem.code for problem in rejected.value.problems} == {"not-a-number"}
    again = client.get("/submit/template/test.json", headers={"If-None-Match": answer.headers["ETag"]})
    assert again.status_code == 304
    assert client.get("/submit/template/val.json").status_code == 404


@pytest.mark.slow
def test_details_of_the_method_are_taken_with_the_file_in_words_of_people(
    signed_in: Client, edition: Edition
) -> None:
    details = {"n_parameters": "25M", "latency_ms": "50", "hardware": "one GPU", "uses_nerf": "no"}
    response = send(signed_in, builders.predictions(edition), note="second try", **details)
    assert response.status_code == 302
    sent = Submission.objects.select_related("method").get()
    method = sent.method
    assert (method.n_parameters, method.latency_ms, method.uses_nerf) == (25_000_000, 50.0, False)
    assert sent.note == "second try"
    response = send(signed_in, builders.predictions(edition, factor=1.2), n_parameters="31M")
    assert response.status_code == 302
    method.refresh_from_db()
    assert (method.n_parameters, method.hardware) == (31_000_000, "one GPU")


@pytest.mark.slow
def test_a_script_that_follows_the_upload_gets_the_address_of_the_submission(
    signed_in: Client, edition: Edition
) -> None:
    file = SimpleUploadedFile("p.json", builders.predictions(edition), "application/json")
    response = signed_in.post(
        "/submit/", {**FIELDS, "file": file}, headers={"Accept": "application/json, text/html"}
    )
    assert response.status_code == 201
    assert response.json() == {"page": f"/submissions/{Submission.objects.get().pk}/"}


@pytest.mark.slow
def test_an_exhausted_quota_stands_at_the_split_before_and_after_the_file_is_sent(
    signed_in: Client, owner: User, edition: Edition
) -> None:
    Split.objects.filter(pk="test").update(quota_limit=1)
    builders.submit(owner, builders.predictions(edition))
    assert "the next slot opens at" in pages.page(signed_in.get("/submit/")).one("main").text
    response = send(signed_in, builders.predictions(edition, factor=1.2))
    assert error_at(response, "split").startswith("Your team has used 1 submission to Test")
    assert Submission.objects.count() == 1


def test_every_missing_field_is_named_at_once(signed_in: Client, edition: Edition) -> None:
    response = send(signed_in, None, split="", method="")
    assert error_at(response, "split") == "No split was chosen; expected one of those listed."
    assert error_at(response, "method") == "No method was named; expected its name on the board."
    assert error_at(response, "file") == "No prediction file was sent; expected a JSON file."
    assert not Submission.objects.exists()


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("split", "nowhere", "There is no split 'nowhere'"),
        ("method", "x" * 81, "has 81 characters; expected at most 80"),
        ("paper_url", "javascript:alert(1)", "expected an address that begins with http:// or https://"),
    ],
)
def test_refusals_stand_at_their_field(
    signed_in: Client, edition: Edition, field: str, value: str, sentence: str
) -> None:
    response = send(signed_in, builders.predictions(edition), **{field: value})
    assert sentence in error_at(response, field)
    assert not Submission.objects.exists()


def test_announced_excess_is_answered_413_without_reading(
    signed_in: Client, edition: Edition, settings: Settings
) -> None:
    settings.MAX_PREDICTIONS_BYTES = 1000
    response = send(signed_in, b"x" * 200_000)
    assert response.status_code == 413
    assert "expected at most 1 kB" in pages.page(response).one("main").text


@pytest.mark.parametrize("field", ["file", "split", "method", "note", "paper_url", "confirmed"])
@pytest.mark.parametrize("kind", ["texts", "files", "both"])
def test_a_field_that_comes_twice_is_refused_in_the_words_of_the_api(
    signed_in: Client, edition: Edition, field: str, kind: str
) -> None:
    data = builders.predictions(edition)
    first, second = (SimpleUploadedFile(name, data) for name in ("a.json", "b.json"))
    twice = {"texts": ["test", "val"], "files": [first, second], "both": ["test", first]}[kind]
    form = {**FIELDS, "file": SimpleUploadedFile("p.json", data), field: twice}
    response = signed_in.post("/submit/", form)
    assert response.status_code == 422
    sentence = f"The request has the field '{field}' 2 times; expected it once."
    assert sentence in pages.page(response).one("form", id="submit").text
    assert not Submission.objects.exists()


# --- asked first: a slot, or what goes public, does not come back -------------------------------------------


def question_of(response: HttpResponseBase) -> tuple[str, str]:
    """The words of the question, and the value that answers it; nothing was submitted."""
    assert response.status_code == 422
    asked = pages.page(response).one("div", class_="question")
    return asked.text, asked.one("input", type="checkbox", name="confirmed").attributes["value"]


def constant(edition: Edition, value: float) -> bytes:
    manifest = manifests.load(edition.ground_truth.manifest_digest)
    return json.dumps({str(row): value for row in manifest.anno_id.tolist()}).encode()


@pytest.mark.slow
def test_a_file_with_a_warning_is_submitted_once_that_is_confirmed(
    signed_in: Client, edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plausibility, "MIN_VALUES", 1)
    files = [constant(edition, value) for value in (2500.0, 2600.0)]
    words, answer = question_of(send(signed_in, files[0]))
    assert "Nothing is submitted yet." in words
    assert "milliseconds" in words
    question_of(send(signed_in, files[1], confirmed=answer))
    assert not Submission.objects.exists()
    assert send(signed_in, files[0], confirmed=answer).status_code == 302
    assert send(signed_in, files[0]).status_code == 302, "a file that is there is no question"
    assert Submission.objects.count() == 1


@pytest.mark.slow
def test_a_file_that_cannot_be_read_is_left_to_the_worker(
    signed_in: Client, edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plausibility, "MIN_VALUES", 1)
    assert send(signed_in, b"[").status_code == 302


@pytest.mark.slow
@pytest.mark.parametrize("visibility", ["PUBLIC", "ANONYMOUS"])
def test_a_file_of_a_method_that_others_see_is_asked_about(
    signed_in: Client, edition: Edition, owner: User, visibility: str
) -> None:
    builders.submit(owner, builders.predictions(edition), method="Mine", visibility=visibility)
    data = builders.predictions(edition, factor=1.2)
    words, answer = question_of(send(signed_in, data, method="Mine"))
    assert "everyone sees its results on every split" in words
    assert Submission.objects.count() == 1
    assert send(signed_in, data, method="Mine", confirmed=answer).status_code == 302


@pytest.mark.slow
def test_a_name_like_another_one_and_bytes_of_another_method_are_asked_about(
    signed_in: Client, edition: Edition, owner: User, stranger: User
) -> None:
    data = builders.predictions(edition)
    builders.submit(owner, data, method="TTC-Former", visibility="PRIVATE")
    builders.submit(stranger, data, method="Neighbour", visibility="PRIVATE")
    words, answer = question_of(send(signed_in, data, method="TTC-Fromer"))
    assert "“TTC-Fromer” is a new method; your team has “TTC-Former”." in words
    assert "the same file to Test before, as “TTC-Former”." in words
    question_of(send(signed_in, data, method="TTC-Formr", confirmed=answer))
    question_of(send(signed_in, builders.predictions(edition, factor=1.2), method="TTC-Fromer"))
    assert "Neighbour" not in question_of(send(signed_in, data, method="Other"))[0]
    other = builders.predictions(edition, factor=1.3)
    assert send(signed_in, other, method="Neighbor").status_code == 302, "another team's name"
    assert send(signed_in, data, method="TTC-Fromer", confirmed=answer).status_code == 302
    api = {"split": "test", "method": "TTC-Forme", "file": SimpleUploadedFile("p.json", data)}
    notes = signed_in.post("/api/v1/submissions", api).json()["notes"]
    assert len(notes) == 2


def test_a_refusal_comes_before_a_question(signed_in: Client, edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition), method="Mine")
    Split.objects.filter(pk="test").update(closes_at=timezone.now())
    response = send(signed_in, builders.predictions(edition, factor=1.2), method="Mine")
    assert "closed at" in pages.page(response).text
    assert not pages.page(response).all("div", class_="question")
