"""Score receipts verify when they are whole and unchanged, and only then."""

import base64
import json
from typing import Any

import jwt
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from hypothesis import given
from hypothesis import strategies as st

from evaluator import receipts
from evaluator.metrics.protocol import SCORE_NAMES, get_protocol

SEED = bytes(range(32))
OTHER_SEED = bytes(range(1, 33))
UUID = "0f8b1c2d-3e4f-4a5b-8c6d-7e8f9a0b1c2d"


def read(*seeds: bytes) -> Any:
    """The keys of these seeds, as one reads them."""
    keys = receipts.key_set([receipts.public_key(seed) for seed in seeds])
    return receipts.read_keys(json.dumps(keys).encode())


def fields(**changed: Any) -> dict[str, Any]:
    return {
        "site": "https://example.org",
        "submission": UUID,
        "split": "test",
        "edition": 3,
        "protocol": "tsttc-1",
        "ground_truth": "sha256:" + "a" * 64,
        "file": "sha256:" + "b" * 64,
        "method": {"id": UUID, "name": "Foo τ “++”"},
        "scores": dict.fromkeys(SCORE_NAMES, "15.03") | {"rte_negative": None},
        "counts": dict.fromkeys(get_protocol("tsttc-1").range_names, 120),
        "scored_at": "2026-11-21T10:00:00Z",
        **changed,
    }


RECEIPT = receipts.sign(fields(), private_key=SEED).encode()
KEYS = read(SEED)


def code_of(receipt: bytes, keys: Any = KEYS) -> str:
    with pytest.raises(receipts.NotVerified) as caught:
        receipts.verify(receipt, keys)
    message = str(caught.value)
    assert "xpected" in message
    assert message.endswith(".")
    return caught.value.code


def token(claims: dict[str, Any], **headers: str) -> bytes:
    key = Ed25519PrivateKey.from_private_bytes(SEED)
    wanted = {"typ": receipts.TYPE, "kid": next(iter(KEYS)), **headers}
    return jwt.encode(claims, key, algorithm="EdDSA", headers=wanted).encode()


def test_receipt_verifies_and_says_the_numbers() -> None:
    verified = receipts.verify(RECEIPT, KEYS)
    assert (verified.split, verified.edition, verified.method) == ("test", 3, "Foo τ “++”")
    assert verified.scores["mid"] == 15.03
    assert verified.scores["rte_negative"] is None
    assert list(verified.scores) == list(SCORE_NAMES)
    assert (verified.site, verified.key_id, verified.decimals) == ("https://example.org", *KEYS, 2)
    assert receipts.verify(b"\n" + RECEIPT + b"\n", KEYS) == verified


def test_text_is_read_like_bytes_and_anything_else_is_a_type_error() -> None:
    keys = json.dumps(receipts.key_set([receipts.public_key(SEED)]))
    assert receipts.verify(RECEIPT.decode(), receipts.read_keys(keys)) == receipts.verify(RECEIPT, KEYS)
    others: list[Any] = [None, 5, ["a"]]
    for other in others:
        with pytest.raises(TypeError, match="expected the content of a file"):
            receipts.verify(other, KEYS)
        with pytest.raises(TypeError, match="expected the content of a file"):
            receipts.read_keys(other)


def test_site_of_a_receipt_can_be_read_before_it_is_checked() -> None:
    assert receipts.claimed_site(RECEIPT) == "https://example.org"
    for text in (b"", b"x", b"a.b.c", b"\xff\xfe\x00", token({"site": 5})):
        assert receipts.claimed_site(text) == ""


def test_signing_again_gives_the_same_bytes() -> None:
    assert receipts.sign(fields(), private_key=SEED).encode() == RECEIPT
    # Fixed for ever: what was signed years ago is checked by tomorrow's code.
    assert list(KEYS) == ["1IG2tMH7J2wbJZnOf8LJzQitKf7LMvoAElsuDMVM54Y"]


def test_the_standard_alone_verifies_a_receipt_with_the_published_key() -> None:
    [key] = receipts.key_set([receipts.public_key(SEED)])["keys"]
    signed, _, signature = RECEIPT.rpartition(b".")
    public = Ed25519PublicKey.from_public_bytes(base64.urlsafe_b64decode(key["x"] + "="))
    public.verify(base64.urlsafe_b64decode(signature + b"=="), signed)
    claims = json.loads(base64.urlsafe_b64decode(signed.split(b".")[1] + b"=="))
    assert claims == {"version": 2, **fields()}


@given(at=st.integers(0, 10_000), byte=st.integers(0, 255))
def test_any_other_byte_is_refused_or_says_the_same(at: int, byte: int) -> None:
    at %= len(RECEIPT)
    changed = RECEIPT[:at] + bytes([byte]) + RECEIPT[at + 1 :]
    try:
        assert receipts.verify(changed, KEYS) == receipts.verify(RECEIPT, KEYS)
    except receipts.NotVerified:
        assert changed != RECEIPT


def test_another_number_is_refused() -> None:
    header, payload, signature = RECEIPT.decode().split(".")
    better = receipts.encode(receipts.decode(payload).replace(b"15.03", b"10.03"))
    assert code_of(f"{header}.{better}.{signature}".encode()) == "receipt-altered"


def test_wrong_key_is_refused_and_an_old_one_beside_a_new_one_is_not() -> None:
    [own], [other] = KEYS, read(OTHER_SEED).values()
    assert code_of(RECEIPT, read(OTHER_SEED)) == "receipt-key-unknown"
    assert code_of(RECEIPT, {}) == "receipt-key-unknown"
    # Somebody else's key under the right name.
    assert code_of(RECEIPT, {own: other}) == "receipt-altered"
    assert receipts.verify(RECEIPT, read(OTHER_SEED, SEED)).edition == 3


def test_a_token_that_is_signed_in_no_way_or_by_a_shared_word_is_no_receipt() -> None:
    headers = {"typ": receipts.TYPE, "kid": next(iter(KEYS))}
    claims = {"version": 2, **fields()}
    unsigned = jwt.encode(claims, None, algorithm="none", headers=headers)
    assert code_of(unsigned.encode()) == "receipt-malformed"
    shared = jwt.encode(claims, "x" * 64, algorithm="HS256", headers=headers)
    assert code_of(shared.encode()) == "receipt-malformed"


def test_what_the_site_signed_for_another_purpose_is_no_receipt() -> None:
    assert code_of(token({"version": 2, **fields()}, typ="JWT")) == "receipt-malformed"
    assert code_of(token({"hello": "world"})) == "receipt-malformed"
    assert code_of(token({"version": 2, **fields(scores=7)})) == "receipt-malformed"


def test_newer_version_is_distinguished_from_a_forged_one() -> None:
    assert code_of(token({**fields(), "version": 3})) == "receipt-version"


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"\xff",
        b"[]",
        b"{",
        b"[" * 60_000,
        b" " * 70_000,
        b"9" * 5_000,
        b"a.b.c",
        receipts.encode(b"[" * 40_000).encode() + b".e30.e30",
    ],
)
def test_what_is_no_receipt_is_refused_in_words(text: bytes) -> None:
    assert code_of(text) in {"receipt-malformed", "receipt-altered"}


@pytest.mark.parametrize(
    "keys",
    [
        b"",
        b"\xff",
        b"[]",
        b"{}",
        b"[" * 60_000,
        b'{"keys":[]}',
        b'{"keys":[7]}',
        b'{"keys":{"x":7}}',
        b'{"keys":[{"kty":"OKP","crv":"Ed25519","kid":"x","x":"AAAA"}]}',
        b'{"keys":[{"kty":"oct","k":"AAAA","kid":"x"}]}',
    ],
)
def test_key_set_that_cannot_be_relied_on_is_refused(keys: bytes) -> None:
    with pytest.raises(receipts.NotVerified) as caught:
        receipts.read_keys(keys)
    assert caught.value.code == "receipt-keys"


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [(15.0, 2, "15.00"), (0.125, 2, "0.12"), (15.06, 1, "15.1"), (None, 2, None)],
)
def test_a_score_is_signed_as_a_decimal_text(value: float | None, decimals: int, text: str | None) -> None:
    assert receipts.decimal(value, decimals=decimals) == text


def test_base64url_has_one_spelling() -> None:
    assert receipts.encode(b"tsttc?>") == "dHN0dGM_Pg"
    assert receipts.decode("dHN0dGM_Pg") == b"tsttc?>"
    for spelling in ("dHN0dGM_Pg==", "dHN0dGM/Pg", "dHN0dGM_Ph", "dHN0 dGM_Pg"):
        with pytest.raises(ValueError):
            receipts.decode(spelling)
