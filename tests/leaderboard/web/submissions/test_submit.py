"""The form through which a file comes in."""

import json
from datetime import timedelta
from unittest.mock import patch

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.http import HttpResponseBase
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

import evaluator
from leaderboard.models import Edition, Split, Submission, User
from leaderboard.storage import files, manifests
from leaderboard.web.submissions import forms
from tests import builders, pages
from tests.leaderboard.api.test_submissions import client_of, post

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


def test_good_file_leads_to_its_own_page(signed_in: Client, edition: Edition, owner: User) -> None:
    response = send(signed_in, builders.predictions(edition), description="Box ratio.")
    submission = Submission.objects.get()
    assert response.status_code == 302
    assert response.headers["Location"] == f"/submissions/{submission.pk}/"
    assert (submission.via, submission.submitted_by, submission.filename) == ("WEB", owner, "p.json")
    assert submission.method.description == "Box ratio."


def test_a_file_is_hashed_once_by_whatever_way_it_comes(edition: Edition, owner: User) -> None:
    client = Client()
    client.force_login(owner)
    with patch.object(files, "measure", wraps=files.measure) as measured:
        send(client, builders.predictions(edition))
        builders.submit(owner, builders.predictions(edition, factor=1.2))
        post(client_of(owner), builders.predictions(edition, factor=1.3))
    assert (measured.call_count, Submission.objects.count()) == (3, 3)


def test_what_is_left_is_asked_for_only_where_the_form_is_drawn(signed_in: Client, edition: Edition) -> None:
    Split.objects.filter(pk="test").update(quota_limit=5, quota_window=timedelta(days=1))
    with patch.object(forms, "offers_for", wraps=forms.offers_for) as offers_for:
        assert send(signed_in, builders.predictions(edition)).status_code == 302
        assert not offers_for.called
        again = send(signed_in, builders.predictions(edition, factor=1.2), method="")
    assert "4 of 5 submissions left" in pages.page(again).one("main").text


def test_same_file_again_leads_to_the_first_submission_and_says_so(
    signed_in: Client, edition: Edition
) -> None:
    first, again = (send(signed_in, builders.predictions(edition)) for _ in range(2))
    assert first.headers["Location"] == again.headers["Location"]
    assert (
        "You already submitted this file"
        in pages.page(signed_in.get(again.headers["Location"])).one("main").text
    )


def test_page_says_that_a_new_method_is_private_until_it_is_shown(
    signed_in: Client, edition: Edition
) -> None:
    said = pages.page(signed_in.get("/submit/")).one("main").text
    assert "A new method is private: only your team sees its results until you publish it." in said


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
        ("ANONYMOUS", "Mine is anonymous: everyone sees its results on every split, under the name "),
        ("PUBLIC", "Mine is public: everyone sees its results on every split."),
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


def test_the_only_open_split_is_chosen_and_of_closed_ones_stands_the_reason_with_a_link(
    signed_in: Client, edition: Edition
) -> None:
    root = pages.page(signed_in.get("/submit/"))
    [choice] = root.all("input", type="radio")
    assert (choice.attributes["value"], "checked" in choice.attributes) == ("test", True)
    closed = root.one("ul", class_="closed-splits")
    assert closed.text.startswith("val: Submissions to val are not open yet")
    assert [a.attributes["href"] for a in closed.all("a")] == ["/board/val/", "/board/demo/"]


def test_with_every_split_closed_there_is_no_form(signed_in: Client, edition: Edition) -> None:
    Split.objects.update(closes_at=timezone.now() - timedelta(days=1))
    main = pages.page(signed_in.get("/submit/")).one("main")
    assert main.all("form") == []
    assert "No split accepts submissions at the moment." in main.text
    assert "/board/test/" in [a.attributes["href"] for a in main.all("a")]


def test_the_template_has_every_anno_id_and_is_rejected_until_it_is_filled_in(
    client: Client, signed_in: Client, edition: Edition
) -> None:
    answer = client.get("/submit/template/test.json")
    manifest = manifests.load(edition.ground_truth.manifest_digest)
    found = json.loads(answer.content)
    assert list(found) == list(manifest.anno_id_keys)
    assert set(found.values()) == {None}
    with pytest.raises(evaluator.Rejected) as rejected:
        evaluator.read_predictions(answer.content, manifest=manifest)
    assert {problem.code for problem in rejected.value.problems} == {"not-a-number"}
    again = client.get("/submit/template/test.json", headers={"If-None-Match": answer.headers["ETag"]})
    assert again.status_code == 304
    assert client.get("/submit/template/val.json").status_code == 404


def test_details_of_the_method_are_taken_with_the_file_in_words_of_people(
    signed_in: Client, edition: Edition
) -> None:
    said = {"n_parameters": "25M", "latency_ms": "50", "hardware": "one GPU", "uses_nerf": "no"}
    response = send(signed_in, builders.predictions(edition), note="second try", **said)
    assert response.status_code == 302
    sent = Submission.objects.select_related("method").get()
    method = sent.method
    assert (method.n_parameters, method.latency_ms, method.uses_nerf) == (25_000_000, 50.0, False)
    assert sent.note == "second try"
    response = send(signed_in, builders.predictions(edition, factor=1.2), n_parameters="31M")
    assert response.status_code == 302
    method.refresh_from_db()
    assert (method.n_parameters, method.hardware) == (31_000_000, "one GPU")


@pytest.mark.parametrize(
    ("details", "field", "said"),
    [
        ({"n_parameters": "many"}, "n_parameters", "Enter a whole number, e.g. 25,000,000 or 25M."),
        ({"latency_ms": "5"}, "hardware", "Enter the hardware on which the latency was measured"),
    ],
)
def test_wrong_details_are_told_at_their_field_before_anything_is_stored(
    signed_in: Client, edition: Edition, details: dict[str, str], field: str, said: str
) -> None:
    response = send(signed_in, builders.predictions(edition), **details)
    assert error_at(response, field).startswith(said)
    assert not Submission.objects.exists()


def test_a_script_that_follows_the_upload_is_told_where_the_submission_is(
    signed_in: Client, edition: Edition
) -> None:
    file = SimpleUploadedFile("p.json", builders.predictions(edition), "application/json")
    response = signed_in.post(
        "/submit/", {**FIELDS, "file": file}, headers={"Accept": "application/json, text/html"}
    )
    assert response.status_code == 201
    assert response.json() == {"page": f"/submissions/{Submission.objects.get().pk}/"}


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
        assert f"id_{name}_error" in described
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


def test_empty_file_is_refused_at_once_in_the_words_of_the_check(signed_in: Client, edition: Edition) -> None:
    said = error_at(send(signed_in, b""), "file")
    assert said == "The file is empty; expected JSON text with a number for every sequence."
    assert not Submission.objects.exists()


def test_form_without_its_token_is_refused_on_a_page_that_says_why(edition: Edition, owner: User) -> None:
    strict = Client(enforce_csrf_checks=True)
    strict.force_login(owner)
    response = send(strict, json.dumps({"0": 1}).encode())
    assert response.status_code == 403
    assert "form has expired" in pages.page(response).one("h1").text
    assert not Submission.objects.exists()
