"""Score receipts: a score, signed by the leaderboard that gave it, for anybody to check offline.

A receipt is one JSON object. What is signed (Ed25519) is `PREFIX` and the canonical form of the object
without its `signature`: keys sorted, no space between tokens, UTF-8, as RFC 8785 has it. Scores are decimal
texts with the edition's decimals (`"15.03"`), so that no two programs can print one number differently.

The site's keys are a JSON Web Key Set (RFC 7517, RFC 8037) at `/.well-known/tsttc-receipt-keys.json`, each
named by its RFC 7638 thumbprint. Retired keys stay in the set: what they signed still verifies.

    verified = verify(receipt_bytes, read_keys(keys_bytes))    # raises NotVerified
    verified.scores["mid"], verified.edition, verified.site
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from evaluator.metrics.protocol import PROTOCOLS

VERSION: Final = 1
KIND: Final = "tsttc-score-receipt"
PREFIX: Final = b"tsttc-score-receipt/1\n"
KEYS_PATH: Final = "/.well-known/tsttc-receipt-keys.json"
KEY_BYTES: Final = 32
MAX_BYTES: Final = 65_536

Document = dict[str, Any]


class NotVerified(Exception):
    """The receipt says nothing that one may rely on. `code` is stable; the text says what, found, expected.

    `receipt-malformed`: no receipt, or one with something missing or added. `receipt-version`: of a newer
    form. `receipt-keys`: the key set cannot be read. `receipt-key-unknown`: signed by none of these keys.
    `receipt-altered`: the signature does not fit what the receipt says.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """What a receipt says, its signature checked. `scores` has the protocol's names; None for no value.

    `edition` is the edition in which the score stands, whether or not a later one has taken its place.
    `method_id` stays for ever; `method` is the name that it had when the receipt was signed.
    """

    site: str
    key_id: str
    submission: str
    split: str
    edition: int
    protocol: str
    ground_truth: str
    file: str
    method_id: str
    method: str
    scores: Mapping[str, float | None]
    counts: Mapping[str, int]
    scored_at: str
    decimals: int = 2  # of its scores


# --- the form --------------------------------------------------------------------------------------------


def _text(pattern: str) -> Callable[[object], bool]:
    wanted = re.compile(pattern)
    return lambda value: isinstance(value, str) and wanted.fullmatch(value) is not None


def _count(value: object) -> bool:
    return type(value) is int and 0 <= value < 2**53


def _members(wanted: Mapping[str, Callable[[object], bool]]) -> Callable[[object], bool]:
    return lambda value: (
        isinstance(value, dict)
        and value.keys() == wanted.keys()
        and all(fits(value[name]) for name, fits in wanted.items())
    )


def _named(fits: Callable[[object], bool]) -> Callable[[object], bool]:
    """Of members under names of scores or TTC ranges: `_names_of` says which."""
    return lambda value: isinstance(value, dict) and all(map(_NAME, value)) and all(map(fits, value.values()))


_UUID: Final = r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}"
_DIGEST: Final = _text(r"sha256:[0-9a-f]{64}")
_DECIMAL: Final = _text(r"(0|[1-9][0-9]{0,14})(\.[0-9]{1,6})?")

_NAME: Final = _text(r"[a-z][a-z0-9]{0,31}(_[a-z][a-z0-9]{0,31})?")

# Every field of a receipt, and what it may be. There are no others. Which names stand in `scores` and
# `counts` is the protocol's to say, for ever: a protocol never changes, so what was signed stays a receipt.
FIELDS: Final[dict[str, Callable[[object], bool]]] = {
    "kind": _text(re.escape(KIND)),
    "version": _count,
    "site": _text(r"https?://[!-~]{1,200}"),
    "key_id": _text(r"[A-Za-z0-9_-]{43}"),
    "submission": _text(_UUID),
    "split": _text(r"[a-zA-Z0-9_-]{1,32}"),
    "edition": _count,
    "protocol": _text(r"[!-~]{1,32}"),
    "ground_truth": _DIGEST,
    "file": _DIGEST,
    "method": _members({"id": _text(_UUID), "name": _text(r"(?s).{1,80}")}),
    "scores": _named(lambda value: value is None or _DECIMAL(value)),
    "counts": _named(_count),
    "scored_at": _text(r"[0-9]{4}(-[0-9]{2}){2}T[0-9]{2}(:[0-9]{2}){2}Z"),
    "signature": _text(r"[A-Za-z0-9_-]{86}"),
}


def canonical_bytes(document: Mapping[str, Any]) -> bytes:
    """What of a receipt is signed: the prefix, and everything but the signature in canonical form.

    >>> canonical_bytes({"b": 1, "a": "τ", "signature": "…"}).decode()
    'tsttc-score-receipt/1\\n{"a":"τ","b":1}'
    """
    content = {name: value for name, value in document.items() if name != "signature"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return PREFIX + text.encode()


def decimal(value: float | None, *, decimals: int) -> str | None:
    """A score as a receipt has it.

    >>> decimal(15.0, decimals=2), decimal(None, decimals=2)
    ('15.00', None)
    """
    return None if value is None else f"{value:.{decimals}f}"


# --- keys ------------------------------------------------------------------------------------------------


def public_key(private_key: bytes) -> bytes:
    """The public half of an Ed25519 seed."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415 - slow to import

    return Ed25519PrivateKey.from_private_bytes(private_key).public_key().public_bytes_raw()


def key_id(public_key: bytes) -> str:
    """The name of an Ed25519 public key of 32 bytes: its RFC 7638 thumbprint."""
    members = {"crv": "Ed25519", "kty": "OKP", "x": encode(public_key)}
    return encode(hashlib.sha256(json.dumps(members, separators=(",", ":")).encode()).digest())


def key_set(public_keys: list[bytes]) -> Document:
    """The JSON Web Key Set of these keys."""
    return {
        "keys": [
            {
                "kty": "OKP",
                "crv": "Ed25519",
                "use": "sig",
                "alg": "EdDSA",
                "kid": key_id(key),
                "x": encode(key),
            }
            for key in public_keys
        ]
    }


def read_keys(data: bytes) -> dict[str, bytes]:
    """The Ed25519 keys of a key set, by name. Raises `NotVerified` (`receipt-keys`)."""
    expected = 'expected the JSON object {"keys": [...]} of ' + KEYS_PATH
    try:
        rows = _parsed(data)["keys"]
        # Keys of other kinds are somebody else's business, as RFC 7517 says.
        found = [decode(row["x"]) for row in rows if (row["kty"], row.get("crv")) == ("OKP", "Ed25519")]
        named = [row["kid"] for row in rows if (row["kty"], row.get("crv")) == ("OKP", "Ed25519")]
    except (ValueError, KeyError, TypeError, AttributeError):
        raise NotVerified("receipt-keys", f"The key set cannot be read; {expected}.") from None
    keys = {key_id(key): key for key in found if len(key) == KEY_BYTES}
    if not keys or list(keys) != list(dict.fromkeys(named)):
        raise NotVerified(
            "receipt-keys", f"The key set has no Ed25519 key, or one under a wrong name; {expected}."
        )
    return keys


def encode(data: bytes) -> str:
    """Bytes as base64url without padding.

    >>> encode(b"tsttc?>")
    'dHN0dGM_Pg'
    """
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def decode(text: str) -> bytes:
    """The bytes of a base64url text without padding. Raises `ValueError` for any other spelling of them."""
    data = base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True)
    if encode(data) != text:
        raise ValueError("not the canonical base64url text")
    return data


# --- signing and checking --------------------------------------------------------------------------------


def sign(document: Mapping[str, Any], *, private_key: bytes) -> Document:
    """The receipt of these fields (`kind`, `version`, `key_id` and `signature` are added), signed.

    `private_key` is the Ed25519 seed of 32 bytes. Raises `ValueError` for fields that no receipt has.
    """
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415 - slow to import

    named = key_id(public_key(private_key))
    receipt: Document = {"kind": KIND, "version": VERSION, "key_id": named, **document}
    key = Ed25519PrivateKey.from_private_bytes(private_key)
    receipt["signature"] = encode(key.sign(canonical_bytes(receipt)))
    wrong = _misfit(receipt)
    if wrong:
        raise ValueError(wrong)
    return {name: receipt[name] for name in FIELDS}


def verify(receipt: bytes, keys: Mapping[str, bytes]) -> Verified:
    """What the receipt says, if one of these keys (see `read_keys`) signed it so. Raises `NotVerified`."""
    document = _document(receipt)
    named = document["key_id"]
    if named not in keys:
        raise NotVerified(
            "receipt-key-unknown",
            f"The receipt names the key {named}, and the key set has {', '.join(keys) or 'none'}; "
            "expected a key of the site that gave the receipt.",
        )
    if not _is_signed(document, keys[named]):
        raise NotVerified(
            "receipt-altered",
            f"The signature does not fit what the receipt says; expected it unchanged, as {document['site']} "
            "gave it.",
        )
    return Verified(
        site=document["site"],
        key_id=named,
        submission=document["submission"],
        split=document["split"],
        edition=document["edition"],
        protocol=document["protocol"],
        ground_truth=document["ground_truth"],
        file=document["file"],
        method_id=document["method"]["id"],
        method=document["method"]["name"],
        scores={
            name: None if document["scores"][name] is None else float(document["scores"][name])
            for name in _names_of(document)["scores"]
        },
        counts={name: document["counts"][name] for name in _names_of(document)["counts"]},
        scored_at=document["scored_at"],
        decimals=max(
            (len(text.partition(".")[2]) for text in document["scores"].values() if text), default=0
        ),
    )


def _is_signed(document: Document, public_key: bytes) -> bool:
    from cryptography.exceptions import InvalidSignature  # noqa: PLC0415 - slow to import, seldom needed
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey  # noqa: PLC0415 - likewise

    try:
        signature = decode(document["signature"])
        Ed25519PublicKey.from_public_bytes(public_key).verify(signature, canonical_bytes(document))
    except (InvalidSignature, ValueError):
        # A text that is not UTF-8, or a spelling of the signature that was never given, is altered as well.
        return False
    return True


def _document(receipt: bytes) -> Document:
    """The receipt's fields, all of them and no others."""
    try:
        document = _parsed(receipt)
    except ValueError as fault:
        raise NotVerified("receipt-malformed", f"This is not a receipt: {fault}.") from None
    version = document.get("version")
    if document.get("kind") == KIND and _count(version) and version != VERSION:
        raise NotVerified(
            "receipt-version",
            f"The receipt has the version {version}; expected {VERSION}, the only one that this release of "
            "tsttc knows.",
        )
    wrong = _misfit(document)
    if wrong:
        raise NotVerified("receipt-malformed", wrong)
    return document


def _names_of(document: Document) -> dict[str, Sequence[str]]:
    """The names in the receipt's scores and counts: its protocol's; of one that is newer, those it has."""
    rules = PROTOCOLS.get(document["protocol"])
    if rules is None:
        return {name: sorted(document[name]) for name in ("scores", "counts")}
    return {"scores": rules.score_names, "counts": rules.interval_names}


def _misfit(document: Document) -> str:
    """What is missing, added or malformed; empty if nothing is."""
    missing = [name for name in FIELDS if name not in document]
    added = [name for name in document if name not in FIELDS]
    if missing:
        return f"The receipt lacks {', '.join(missing)}; expected every field of version {VERSION}."
    if added:
        names = ", ".join(json.dumps(name[:40]) for name in added[:5])
        return f"The receipt has {names} beside its fields; expected those of version {VERSION} alone."
    wrong = [name for name, fits in FIELDS.items() if not fits(document[name])]
    if not wrong:
        expected = _names_of(document)
        wrong = [name for name, names in expected.items() if document[name].keys() != set(names)]
    if wrong:
        return f"The receipt's {', '.join(wrong)} is malformed; expected what the leaderboard wrote."
    return ""


def _parsed(data: bytes) -> Document:
    """The object that a text is. Raises `ValueError` saying what it is instead."""
    if len(data) > MAX_BYTES:
        raise ValueError(f"it has {len(data):,} bytes; expected at most {MAX_BYTES:,}")
    try:
        document = json.loads(
            data.decode(), object_pairs_hook=_once, parse_constant=_refuse_constant, parse_int=_integer
        )
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8 text; expected a JSON object") from None
    except json.JSONDecodeError as fault:
        raise ValueError(f"line {fault.lineno}, column {fault.colno}: {fault.msg}; expected JSON") from None
    except RecursionError:
        raise ValueError("it is nested too deep; expected a JSON object") from None
    if not isinstance(document, dict):
        raise ValueError("it is JSON, but no object; expected a JSON object")
    return document


def _once(pairs: list[tuple[str, Any]]) -> Document:
    members = dict(pairs)
    if len(members) != len(pairs):
        raise ValueError("a field appears more than once; expected each once")
    return members


def _integer(digits: str) -> int:
    if len(digits) > 20:
        raise ValueError(f"it has a number of {len(digits)} digits; expected at most 20")
    return int(digits)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"it has {name}; expected numbers as JSON has them")
