"""Score receipts: whole and unchanged they verify, and in no other way."""

import copy
import json
from collections.abc import Iterator
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given
from hypothesis import strategies as st

from evaluator import receipts
from evaluator.metrics.protocol import SCORE_NAMES, get_protocol

SEED = bytes(range(32))
OTHER_SEED = bytes(range(1, 33))
UUID = "0f8b1c2d-3e4f-4a5b-8c6d-7e8f9a0b1c2d"


def public(seed: bytes) -> bytes:
    return Ed25519PrivateKey.from_private_bytes(seed).public_key().public_bytes_raw()


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
        "counts": dict.fromkeys(get_protocol("tsttc-1").interval_names, 120),
        "scored_at": "2026-11-21T10:00:00Z",
        **changed,
    }


RECEIPT = receipts.sign(fields(), private_key=SEED)
KEYS = {receipts.key_id(public(SEED)): public(SEED)}


def data(receipt: dict[str, Any]) -> bytes:
    return json.dumps(receipt).encode()


def code_of(receipt: bytes, keys: dict[str, bytes] = KEYS) -> str:
    with pytest.raises(receipts.NotVerified) as caught:
        receipts.verify(receipt, keys)
    message = str(caught.value)
    assert "xpected" in message
    assert message.endswith(".")
    return caught.value.code


def test_receipt_verifies_and_says_the_numbers() -> None:
    verified = receipts.verify(data(RECEIPT), KEYS)
    assert (verified.split, verified.edition, verified.method) == ("test", 3, "Foo τ “++”")
    assert verified.scores["mid"] == 15.03
    assert verified.scores["rte_negative"] is None
    assert list(verified.scores) == list(SCORE_NAMES)
    assert (verified.site, verified.key_id) == ("https://example.org", *KEYS)


def test_order_and_space_of_the_file_do_not_matter() -> None:
    shuffled = dict(sorted(RECEIPT.items(), reverse=True))
    assert receipts.verify(json.dumps(shuffled, indent=4, ensure_ascii=False).encode(), KEYS)


def test_signing_again_gives_the_same_bytes() -> None:
    assert receipts.sign(fields(), private_key=SEED) == RECEIPT
    # Fixed for ever: what was signed years ago is checked by tomorrow's code.
    assert RECEIPT["key_id"] == "1IG2tMH7J2wbJZnOf8LJzQitKf7LMvoAElsuDMVM54Y"
    assert receipts.canonical_bytes(RECEIPT).startswith(
        b'tsttc-score-receipt/1\n{"counts":{"crucial":120,"large":120,"negative":120,"overall":120,'
    )


def leaves(document: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    if isinstance(document, dict):
        for name, value in document.items():
            yield from leaves(value, (*path, name))
    else:
        yield path


LEAVES = list(leaves(RECEIPT))


@given(
    path=st.sampled_from(LEAVES),
    value=st.none() | st.booleans() | st.integers() | st.text() | st.sampled_from(["15.04", "0", UUID[::-1]]),
    is_edit=st.booleans(),
    at=st.integers(0, 200),
)
def test_any_other_value_in_any_field_is_refused(
    path: tuple[str, ...], value: object, is_edit: bool, at: int
) -> None:
    changed = copy.deepcopy(RECEIPT)
    node = changed
    for name in path[:-1]:
        node = node[name]
    before = node[path[-1]]
    if is_edit and isinstance(before, str):  # one character of what stood there
        at %= len(before)
        value = before[:at] + ("1" if before[at] != "1" else "2") + before[at + 1 :]
    elif is_edit and isinstance(before, int):
        value = before + 1
    node[path[-1]] = value
    if (type(value), value) != (type(before), before):
        assert code_of(data(changed)).startswith("receipt-")


@given(at=st.integers(0, 10_000), byte=st.integers(0, 255))
def test_any_other_byte_is_refused_or_says_the_same(at: int, byte: int) -> None:
    whole = data(RECEIPT)
    at %= len(whole)
    changed = whole[:at] + bytes([byte]) + whole[at + 1 :]
    try:
        assert receipts.verify(changed, KEYS) == receipts.verify(whole, KEYS)
        assert json.loads(changed) == RECEIPT  # another kind of space between two tokens
    except receipts.NotVerified:
        assert changed != whole


def test_missing_and_added_fields_are_refused_at_every_level() -> None:
    for name in RECEIPT:
        assert code_of(data({k: v for k, v in RECEIPT.items() if k != name})) == "receipt-malformed"
    assert code_of(data({**RECEIPT, "note": "trust me"})) == "receipt-malformed"
    for name in ("method", "scores", "counts"):
        assert code_of(data({**RECEIPT, name: {**RECEIPT[name], "x": "1"}})) == "receipt-malformed"


def test_wrong_key_is_refused_and_an_old_one_beside_a_new_one_is_not() -> None:
    other = public(OTHER_SEED)
    assert code_of(data(RECEIPT), {receipts.key_id(other): other}) == "receipt-key-unknown"
    assert code_of(data(RECEIPT), {}) == "receipt-key-unknown"
    # Somebody else's key under the right name.
    assert code_of(data(RECEIPT), {RECEIPT["key_id"]: other}) == "receipt-altered"
    both = receipts.read_keys(json.dumps(receipts.key_set([other, public(SEED)])).encode())
    assert receipts.verify(data(RECEIPT), both).edition == 3


def test_key_is_named_as_the_standard_says() -> None:
    # The example of RFC 8037, appendix A.3.
    named = receipts.key_id(receipts.decode("11qYAYKxCrfVS_7TyWQHOg7hcvPapiMlrwIaaPcHURo"))
    assert named == "kPrK_qmxVWaYVA9wwBF6Iuo3vVzz7TxHCTwXBygrS4k"


def test_newer_version_is_told_apart_from_a_forged_one() -> None:
    assert code_of(data({**RECEIPT, "version": 2, "interval": "95"})) == "receipt-version"
    assert code_of(data({**RECEIPT, "version": "2"})) == "receipt-malformed"


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"\xff",
        b"[]",
        b"null",
        b"{",
        b'{"a":NaN}',
        b"[" * 100_000,
        b'{"a":' * 50_000,
        b" " * 70_000,
        b"9" * 5_000,
        data(RECEIPT)[:-1] + b',"edition":3}',
        data(RECEIPT).replace(b"Foo", rb"\ud800"),
    ],
)
def test_what_is_no_receipt_is_refused_in_words(text: bytes) -> None:
    assert code_of(text) in {"receipt-malformed", "receipt-altered"}


@pytest.mark.parametrize(
    "keys",
    [
        b"",
        b"[]",
        b"{}",
        b'{"keys":[]}',
        b'{"keys":[7]}',
        b'{"keys":[{"kty":"OKP","crv":"Ed25519","kid":"x","x":"AAAA"}]}',
        json.dumps(receipts.key_set([public(SEED)])).replace("1IG2", "1IG3").encode(),
    ],
)
def test_key_set_that_cannot_be_relied_on_is_refused(keys: bytes) -> None:
    with pytest.raises(receipts.NotVerified) as caught:
        receipts.read_keys(keys)
    assert caught.value.code == "receipt-keys"


def test_nothing_but_a_receipt_is_ever_signed() -> None:
    unfit: list[dict[str, Any]] = [{"edition": -1}, {"scores": {}}, {"site": "ftp://x"}, {"note": "x"}]
    for wrong in unfit:
        with pytest.raises(ValueError, match="receipt"):
            receipts.sign(fields(**wrong), private_key=SEED)


def test_every_published_decimal_is_written_and_read_back() -> None:
    for value in (0.0, 0.01, 15.03, 123456.78, 99999999.99):
        text = receipts.decimal(value, decimals=2)
        assert text is not None
        assert float(text) == value
        assert receipts.sign(fields(scores=dict.fromkeys(SCORE_NAMES, text)), private_key=SEED)
