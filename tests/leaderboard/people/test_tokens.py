"""API tokens: what they are good for, and when they are good for nothing any more."""

from datetime import UTC, datetime, timedelta
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from django.apps import apps
from django.core.files.base import ContentFile
from django.utils import timezone
from rest_framework.test import APIClient

from leaderboard import audit
from leaderboard.errors.refusals import Refused
from leaderboard.models import ApiToken, AuditEvent, Edition, Method, Submission, User
from leaderboard.people import tokens
from tests import builders
from tests.leaderboard.api.test_submissions import post

REVOKE = "/api/v1/tokens/revoke"
ENDED_AT = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)


def client_with(secret: str) -> APIClient:
    client = APIClient()
    client.credentials(HTTP_AUTHORIZATION=f"Bearer {secret}")
    return client


@pytest.fixture
def secret(owner: User) -> str:
    return builders.token(owner)


# --- the table -------------------------------------------------------------------------------------------

SCOPES = [("read",), ("submit",), ("publish",), ("read", "submit"), ("read", "submit", "publish")]
TABLE = list(product(SCOPES, ["standing", "expired"], ["standing", "revoked"], ["", "test", "val"]))


@pytest.mark.slow
@pytest.mark.parametrize(("scopes", "expiry", "revocation", "split"), TABLE)
def test_a_token_opens_what_it_was_made_for_and_nothing_else(
    edition: Edition, owner: User, scopes: tuple[str, ...], expiry: str, revocation: str, split: str
) -> None:
    sent = builders.submit(owner, builders.predictions(edition))
    client = client_with(builders.token(owner, scopes=scopes, split_name=split))
    row = ApiToken.objects.get()
    if expiry == "expired":
        ApiToken.objects.update(expiry=timezone.now() - timedelta(days=1))
    if revocation == "revoked":
        tokens.revoke(token=row, now=timezone.now(), actor=owner)
    is_dead = expiry == "expired" or revocation == "revoked"
    is_elsewhere = split == "val"
    may_read, may_submit, may_publish = (scope in scopes for scope in ("read", "submit", "publish"))

    def wanted(*, may: bool, answer: int) -> int:
        return 401 if is_dead else answer if may else 403

    submission = f"/api/v1/submissions/{sent.pk}"
    statuses = {
        "board": client.get("/api/v1/splits/test/board").status_code,
        "list": client.get("/api/v1/submissions").status_code,
        "one": client.get(submission).status_code,
        "quota": client.get("/api/v1/quota").status_code,
        "withdraw": client.post(f"{submission}/withdraw").status_code,
        "submit": post(client, builders.predictions(edition, factor=1.3)).status_code,
        "publish": client.post(f"/api/v1/methods/{sent.method_id}/visibility").status_code,
    }
    assert statuses == {
        "board": wanted(may=may_read and not is_elsewhere, answer=200),
        "list": wanted(may=may_read, answer=200),
        "one": wanted(may=may_read, answer=404 if is_elsewhere else 200),
        "quota": wanted(may=True, answer=200),
        "withdraw": wanted(may=may_submit, answer=404 if is_elsewhere else 200),
        "submit": wanted(may=may_submit and not is_elsewhere, answer=201),
        "publish": wanted(may=may_publish and not split, answer=422),  # it does not say `confirm`
    }
    assert Submission.objects.count() == 1 + (statuses["submit"] == 201)


# --- what is said ----------------------------------------------------------------------------------------


def refusal(client: APIClient, address: str = "/api/v1/submissions") -> tuple[int, str, str]:
    response = client.get(address)
    assert response.headers["Content-Type"] == "application/problem+json"
    return response.status_code, response.json()["code"], response.json()["detail"]


@pytest.mark.parametrize(
    ("changed", "status", "code", "sentence"),
    [
        (
            {"expiry": ENDED_AT},
            401,
            "token-expired",
            "expired on 2026-01-02 03:04 UTC; create another",
        ),
        ({"revoked_at": ENDED_AT}, 401, "token-revoked", "revoked on 2026-01-02 03:04 UTC"),
        (
            {"may_read": False},
            403,
            "token-scope",
            "has the scope 'submit publish'; expected 'read' for this.",
        ),
    ],
)
def test_a_token_that_does_not_open_says_why(
    owner: User, secret: str, changed: dict[str, Any], status: int, code: str, sentence: str
) -> None:
    ApiToken.objects.update(**changed)
    answer = refusal(client_with(secret))
    assert (answer[:2], sentence in answer[2]) == ((status, code), True)
    assert ApiToken.objects.get().last_used_at is None or status == 403


def test_a_closed_account_closes_its_tokens(owner: User, secret: str) -> None:
    User.objects.filter(pk=owner.pk).update(is_active=False)
    assert refusal(client_with(secret))[:2] == (401, "account-closed")


def test_another_split_is_named(edition: Edition, owner: User) -> None:
    client = client_with(builders.token(owner, split_name="val"))
    sentence = "The token is valid for the split 'val' only; expected that, found 'test'."
    assert refusal(client, "/api/v1/splits/test/board") == (403, "token-split", sentence)
    assert refusal(client, "/api/v1/compare?split=test&m=x&m=y") == (403, "token-split", sentence)
    response = post(client, builders.predictions(edition))
    assert (response.status_code, response.json()["detail"]) == (403, sentence)


# --- where it may stand ----------------------------------------------------------------------------------


def test_a_token_in_the_address_or_the_body_opens_nothing(edition: Edition, secret: str) -> None:
    client = APIClient()
    assert client.get(f"/api/v1/submissions?token={secret}").status_code == 401
    assert client.get("/api/v1/submissions", headers={"Cookie": f"token={secret}"}).status_code == 401
    assert post(client, builders.predictions(edition), token=secret).status_code == 401


# --- last used -------------------------------------------------------------------------------------------


def test_the_last_use_is_noted_once_a_minute(owner: User, secret: str) -> None:
    now = timezone.now()
    for seconds in (0, 1, 59):
        tokens.use(secret=secret, now=now + timedelta(seconds=seconds))
    assert ApiToken.objects.get().last_used_at == now
    tokens.use(secret=secret, now=now + timedelta(seconds=60))
    assert ApiToken.objects.get().last_used_at == now + timedelta(seconds=60)


# --- making one ------------------------------------------------------------------------------------------


def test_nobody_piles_up_tokens(owner: User) -> None:
    for number in range(tokens.MAX_ACTIVE):
        tokens.create(user=owner, name=str(number), now=timezone.now())
    with pytest.raises(Refused, match="50 tokens in use"):
        builders.token(owner)
    row = ApiToken.objects.first()
    assert row is not None
    tokens.revoke(token=row, now=timezone.now(), actor=owner)
    assert builders.token(owner)


def test_making_and_revoking_are_audited_without_the_secret(owner: User, secret: str) -> None:
    row = ApiToken.objects.get()
    assert secret not in {row.digest, row.token_key}
    assert tokens.revoke(token=row, now=timezone.now(), actor=owner)
    assert not tokens.revoke(token=row, now=timezone.now(), actor=owner)
    revoked, created = AuditEvent.objects.filter(noun="ApiToken", noun_id=row.token_key)
    assert (revoked.verb, created.verb, revoked.actor) == ("revoked", "created", owner)
    name = created.details.pop("name")
    assert audit.names_in([revoked, AuditEvent(details={"name": name})])[name] == "CI"
    assert created.details == {"scopes": ["read", "submit", "publish"], "split": None, "days": 90}
    assert secret not in str(created.details) + created.noun_id


def test_a_token_made_without_scopes_cannot_publish(owner: User) -> None:
    tokens.create(user=owner, name="CI", now=timezone.now())
    assert ApiToken.objects.get().scopes == ("read", "submit")


def test_a_token_from_before_the_scope_can_still_publish_if_it_could(owner: User) -> None:
    for scope in ("read", "submit"):
        builders.token(owner, scopes=[scope])
    migration = import_module("leaderboard.migrations.0003_token_may_publish")
    migration.keep_what_tokens_could(apps, None)
    rows = ApiToken.objects.order_by("created")
    assert [row.scopes for row in rows] == [("read",), ("submit", "publish")]


# --- a leaked one ----------------------------------------------------------------------------------------


def test_anyone_who_finds_a_token_can_end_it(owner: User, secret: str) -> None:
    response = APIClient().post(REVOKE, {"token": f" {secret}\n"}, format="json")
    assert response.status_code == 200
    assert refusal(client_with(secret))[:2] == (401, "token-revoked")
    event = AuditEvent.objects.get(verb="revoked")
    assert (event.actor, event.details["how"]) == (None, "reported as leaked")


def test_the_answer_does_not_tell_whether_it_was_a_token(owner: User, secret: str) -> None:
    reported = [secret, secret, "tsttc_" + "0" * 64, "nonsense"]
    answers = [APIClient().post(REVOKE, {"token": each}, format="json") for each in reported]
    assert len({(answer.status_code, answer.content) for answer in answers}) == 1
    assert AuditEvent.objects.filter(verb="revoked").count() == 1


@pytest.mark.parametrize("body", [[], {"token": ""}, {"token": "a\x00"}, None])
def test_a_report_without_a_token_says_what_is_expected(db: None, body: object) -> None:
    response = APIClient().post(REVOKE, body, format="json")
    assert response.status_code == 422
    assert response.json()["problems"][0]["where"] == "token"


def test_secret_scanners_read_what_a_token_looks_like_and_where_to_end_it() -> None:
    text = (Path(__file__).resolve().parents[3] / "SECURITY.md").read_text()
    assert f"    {tokens.PATTERN.pattern}\n" in text
    assert f"POST {REVOKE}" in text


# --- one split ---------------------------------------------------------------------------------------------


@pytest.fixture
def public(edition: Edition, owner: User) -> Method:
    """A public method whose description everybody reads, on every split."""
    return builders.submit(owner, builders.predictions(edition), description="What it does.").method


def send(client: APIClient, data: bytes, **fields: str) -> tuple[int, dict[str, Any]]:
    file = ContentFile(data, name="p.json")
    answer = client.post("/api/v1/submissions", {"split": "test", "method": "Foo", "file": file, **fields})
    return answer.status_code, answer.json()


@pytest.mark.parametrize("is_known", [True, False])
def test_a_token_for_one_split_changes_nothing_of_a_method(
    edition: Edition, owner: User, public: Method, is_known: bool
) -> None:
    client = client_with(builders.token(owner, split_name="test"))
    before, n_events = Method.objects.values().get(), AuditEvent.objects.count()
    data = builders.predictions(edition, factor=1.1 if is_known else 1.3)
    status, answer = send(client, data, description="DEFACED", code_url="https://evil.example/")
    assert Method.objects.values().get() == before
    assert (Submission.objects.count(), AuditEvent.objects.count()) == (1, n_events)
    if is_known:
        assert (status, answer["id"]) == (200, str(public.submissions.get().pk))
    else:
        assert (status, answer["code"], answer["problems"][0]["where"]) == (403, "token-split", "description")
        assert answer["detail"] == (
            "The token is valid for one split only, and the fields 'description', 'code_url' would "
            "change the method 'Foo' on every split; expected the present value, no value, or a token for "
            "every split."
        )


def test_a_token_for_one_split_sends_with_the_details_that_stand_and_makes_new_methods(
    edition: Edition, owner: User, public: Method
) -> None:
    client = client_with(builders.token(owner, split_name="test"))
    data = builders.predictions(edition, factor=1.3)
    assert send(client, data, description="What it does.")[0] == 201
    assert send(client, data, method="Bar", description="Another.")[0] == 201
    assert Method.objects.get(name="Bar").description == "Another."
    assert not AuditEvent.objects.filter(verb="edited").exists()


# --- of two tokens ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["by its owner", "as leaked", "all of a person"])
def test_revoking_one_token_leaves_those_of_others(
    owner: User, stranger: User, maintainer: User, how: str
) -> None:
    first, second, others = builders.token(owner), builders.token(owner), builders.token(stranger)
    now = timezone.now()
    if how == "by its owner":
        row = ApiToken.objects.filter(user=owner).earliest("created")
        assert tokens.revoke(token=row, now=now, actor=owner)
        assert not tokens.revoke(token=row, now=now, actor=owner)
    elif how == "as leaked":
        assert APIClient().post(REVOKE, {"token": first}, format="json").status_code == 200
    else:
        tokens.revoke_all(user=owner, reason="R", actor=maintainer, now=now)
    statuses = [client_with(secret).get("/api/v1/account").status_code for secret in (first, second, others)]
    assert statuses == [401, 401 if how == "all of a person" else 200, 200]


@pytest.mark.parametrize("ended", ["expired", "revoked", "of another person"])
def test_only_a_persons_own_working_tokens_count_towards_the_maximum(
    owner: User, stranger: User, ended: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tokens, "MAX_ACTIVE", 2)
    builders.token(owner)
    builders.token(stranger if ended == "of another person" else owner)
    rows = ApiToken.objects.filter(user=owner).order_by("created")
    if ended == "expired":
        rows.filter(pk=rows[0].pk).update(expiry=timezone.now() - timedelta(seconds=1))
    elif ended == "revoked":
        tokens.revoke(token=rows[0], now=timezone.now(), actor=owner)
    builders.token(owner)
    with pytest.raises(Refused, match="There are 2 tokens in use"):
        builders.token(owner)


def test_a_token_for_one_split_reads_the_quota_of_that_split_alone(edition: Edition, owner: User) -> None:
    def splits_of(**options: Any) -> set[str]:
        answer = client_with(builders.token(owner, **options)).get("/api/v1/quota")
        return {row["split"] for row in answer.json()}

    assert splits_of(split_name="val") == {"val"}
    assert {"test", "val"} <= splits_of()
