"""Score receipts: for the team alone, and true for ever."""

import json
from io import StringIO
from pathlib import Path

import pytest
from django.core.exceptions import ImproperlyConfigured
from django.core.management import call_command
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from evaluator import receipts as form
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Evaluation, Submission, User
from leaderboard.submissions import intake, receipts
from tests import builders, pages
from tests.editions import corrected, open_edition, publish
from tests.leaderboard.api.test_submissions import client_of

KEYS = "/.well-known/tsttc-receipt-keys.json"


@pytest.fixture
def scored(edition: Edition, owner: User) -> Submission:
    submission = builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    return submission


def address(submission: Submission) -> str:
    return f"/api/v1/submissions/{submission.pk}/receipt"


def verified(receipt: bytes) -> form.Verified:
    return form.verify(receipt, form.read_keys(Client().get(KEYS).content))


def test_receipt_verifies_against_the_published_key_and_says_what_the_api_says(
    scored: Submission, edition: Edition, owner: User
) -> None:
    client = client_of(owner)
    answer = client.get(f"/api/v1/submissions/{scored.pk}").json()
    receipt = verified(client.get(address(scored)).content)
    assert receipt.scores == answer["scores"]
    assert receipt.counts == answer["counts"]
    assert (receipt.split, receipt.edition, receipt.protocol) == ("test", 1, "tsttc-1")
    assert (receipt.ground_truth, receipt.file) == (edition.ground_truth_id, scored.digest)
    assert (receipt.submission, receipt.method) == (str(scored.pk), "Foo")
    assert receipt.site == "http://127.0.0.1:8000"
    # Deterministic: whoever asks again has the same proof.
    assert client.get(address(scored)).content == client.get(address(scored)).content


def test_receipts_before_and_after_a_renaming_verify_and_name_one_method_by_its_id(
    scored: Submission, owner: User
) -> None:
    before = client_of(owner).get(address(scored)).content
    scored.method.__class__.objects.update(name="Another famous method")
    both = [verified(before), verified(client_of(owner).get(address(scored)).content)]
    assert [one.method for one in both] == ["Foo", "Another famous method"]
    assert {one.method_id for one in both} == {str(scored.method_id)}


def test_only_what_is_scored_and_stands_has_a_receipt(edition: Edition, owner: User) -> None:
    client = client_of(owner)
    waiting = builders.submit(owner, builders.predictions(edition))
    response = client.get(address(waiting))
    assert (response.status_code, response.json()["code"]) == (409, "not-scored")
    assert "queued" in response.json()["detail"]
    builders.score_all()
    rejected = builders.submit(owner, b"{}")
    builders.score_all()
    assert client.get(address(rejected)).json()["code"] == "not-scored"
    intake.withdraw(submission=waiting, actor=owner, now=timezone.now())
    response = client.get(address(waiting))
    assert (response.status_code, response.json()["code"]) == (409, "withdrawn")


def test_receipt_of_a_superseded_edition_still_verifies_and_says_which(
    scored: Submission, owner: User, tmp_path: Path
) -> None:
    client = client_of(owner)
    before = client.get(address(scored)).content
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    # What is in preparation may still be given up.
    assert client.get(f"{address(scored)}?edition=2").json()["code"] == "edition-unknown"
    publish(second)
    assert verified(before).edition == 1
    after = client.get(address(scored)).content
    assert verified(after).edition == 2
    assert verified(after).scores != verified(before).scores
    assert client.get(f"{address(scored)}?edition=1").content == before
    for number, code in (("3", "edition-unknown"), ("x", "bad-edition"), ("-1", "bad-edition")):
        assert client.get(f"{address(scored)}?edition={number}").json()["code"] == code


def test_what_a_former_key_signed_verifies_after_another_replaced_it(
    scored: Submission, owner: User, settings: Settings
) -> None:
    before = client_of(owner).get(address(scored)).content
    former = form.encode(form.public_key(receipts.private_key()))
    settings.RECEIPT_KEY = form.encode(bytes(range(32)))
    with pytest.raises(form.NotVerified, match="key set has"):
        verified(before)
    settings.RECEIPT_OLD_KEYS = [former]
    after = client_of(owner).get(address(scored)).content
    assert verified(before).scores == verified(after).scores
    assert verified(before).key_id != verified(after).key_id


def test_keys_are_a_key_set_that_everybody_may_keep_for_an_hour() -> None:
    response = Client().get(KEYS)
    assert response.headers["Content-Type"] == "application/jwk-set+json"
    assert "max-age=3600" in response.headers["Cache-Control"]
    [key] = response.json()["keys"]
    assert (key["kty"], key["crv"], key["alg"]) == ("OKP", "Ed25519", "EdDSA")
    assert "d" not in key


def test_receipt_is_a_file_on_the_submissions_page(
    scored: Submission, client: Client, owner: User, stranger: User
) -> None:
    client.force_login(owner)
    page = pages.page(client.get(f"/submissions/{scored.pk}/"))
    [link] = [a for a in page.all("a") if a.text == "Signed receipt"]
    response = client.get(link.attributes["href"])
    assert f'filename="tsttc-receipt-{scored.pk}.jwt"' in response.headers["Content-Disposition"]
    assert verified(response.content).submission == str(scored.pk)
    client.force_login(stranger)
    assert client.get(link.attributes["href"]).status_code == 404


def test_command_makes_a_key_that_signs(settings: Settings) -> None:
    call_command("make_receipt_key", stdout=(out := StringIO()), stderr=(err := StringIO()))
    lines = dict(line.split("=", 1) for line in out.getvalue().splitlines())
    assert list(lines) == ["TSTTC_RECEIPT_KEY", "TSTTC_RECEIPT_PUBLIC_KEY"]
    settings.RECEIPT_KEY = key = lines["TSTTC_RECEIPT_KEY"]
    published = receipts.public_keys()["keys"][0]
    assert published["kid"] in err.getvalue()
    assert published["x"] == lines["TSTTC_RECEIPT_PUBLIC_KEY"]
    assert key not in json.dumps(published) + err.getvalue()


def test_at_a_rotation_the_command_prints_the_former_keys_with_the_present_one(
    scored: Submission, owner: User, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    oldest = form.encode(form.public_key(bytes(32)))
    settings.RECEIPT_KEY = form.encode(bytes(range(32)))
    before = client_of(owner).get(address(scored)).content
    monkeypatch.setenv("TSTTC_RECEIPT_KEY", settings.RECEIPT_KEY)
    monkeypatch.setenv("TSTTC_RECEIPT_OLD_KEYS", oldest)
    call_command("make_receipt_key", stdout=(out := StringIO()), stderr=StringIO())
    lines = dict(line.split("=", 1) for line in out.getvalue().splitlines())
    former = lines["TSTTC_RECEIPT_OLD_KEYS"].split(",")
    assert former == [form.encode(form.public_key(bytes(range(32)))), oldest]
    settings.RECEIPT_KEY, settings.RECEIPT_OLD_KEYS = lines["TSTTC_RECEIPT_KEY"], former
    assert verified(before).submission == str(scored.pk)
    after = client_of(owner).get(address(scored)).content
    assert verified(after).key_id != verified(before).key_id


def test_a_process_without_the_key_knows_its_public_half_and_publishes_no_random_one(
    settings: Settings,
) -> None:
    own = form.encode(form.public_key(receipts.private_key()))
    settings.HAS_RECEIPT_KEY = False
    assert receipts.known_public_keys() == {"keys": []}
    settings.RECEIPT_PUBLIC_KEY = own
    assert [key["x"] for key in receipts.known_public_keys()["keys"]] == [own]
    settings.HAS_RECEIPT_KEY = True
    settings.RECEIPT_PUBLIC_KEY = form.encode(form.public_key(bytes(32)))
    [error] = receipts.check_keys()
    assert f"expected '{own}', the public half" in error.msg


@pytest.mark.parametrize("key", ["", "A" * 44, "Ä" * 43])
def test_malformed_key_is_reported_at_the_start(settings: Settings, key: str) -> None:
    settings.RECEIPT_KEY = key
    [error] = receipts.check_keys()
    assert "TSTTC_RECEIPT_KEY is malformed" in error.msg
    with pytest.raises(ImproperlyConfigured):
        receipts.private_key()


def test_an_edition_in_preparation_has_no_receipt_even_if_it_alone_has_the_file(
    entries: list[Submission], rescored: Edition
) -> None:
    with pytest.raises(Refused, match="no score in an edition 2"):
        receipts.receipt(submission=entries[0], edition_number=2)
    assert receipts.receipt(submission=entries[0]) == receipts.receipt(
        submission=entries[0], edition_number=1
    )
    Evaluation.objects.exclude(edition=rescored).delete()
    with pytest.raises(Refused, match="expected one that is scored"):
        receipts.receipt(submission=Submission.objects.get(pk=entries[0].pk))
