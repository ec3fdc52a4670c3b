"""Score receipts: JSON Web Tokens (RFC 7519) signed by EdDSA, checked offline.

    verified = verify(receipt, read_keys(keys))    # contents of files, raises NotVerified
    verified.scores["mid"], verified.edition, verified.site

Scores are decimal texts with the edition's decimals (`"15.03"`). The keys are a JSON Web Key Set (RFC 7517,
RFC 8037), each named by its RFC 7638 thumbprint.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, cast

from evaluator.metrics.protocol import PROTOCOLS
from evaluator.texts import text_of

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

VERSION: Final = 2
TYPE: Final = "tsttc-receipt+jwt"
KEYS_PATH: Final = "/.well-known/tsttc-receipt-keys.json"
KEY_BYTES: Final = 32
MAX_BYTES: Final = 65_536

Document = dict[str, Any]


class NotVerified(Exception):
    """A receipt that proves nothing; `code` is stable.

    `receipt-malformed`, `receipt-version` (a newer form), `receipt-keys` (an unreadable key set),
    `receipt-key-unknown` (signed by another key) or `receipt-altered` (a wrong signature).
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """A receipt with a checked signature; `method` is the name at signing."""

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


def decimal(value: float | None, *, decimals: int) -> str | None:
    return None if value is None else f"{value:.{decimals}f}"


# --- keys ------------------------------------------------------------------------------------------------


def public_key(private_key: bytes) -> bytes:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415 - slow to import

    return Ed25519PrivateKey.from_private_bytes(private_key).public_key().public_bytes_raw()


def key_id(public_key: bytes) -> str:
    """Return the RFC 7638 thumbprint of an Ed25519 public key of 32 bytes."""
    members = {"crv": "Ed25519", "kty": "OKP", "x": encode(public_key)}
    return encode(hashlib.sha256(json.dumps(members, separators=(",", ":")).encode()).digest())


def key_set(public_keys: list[bytes]) -> Document:
    shared = {"kty": "OKP", "crv": "Ed25519", "use": "sig", "alg": "EdDSA"}
    return {"keys": [shared | {"kid": key_id(key), "x": encode(key)} for key in public_keys]}


def read_keys(data: bytes | str) -> dict[str, Ed25519PublicKey]:
    """Read the Ed25519 keys of a key set, by name. Raises `NotVerified` (`receipt-keys`)."""
    data = _content(data, name="data")
    from jwt import PyJWKSet, PyJWTError  # noqa: PLC0415 - slow to import

    try:
        # Keys of other kinds are somebody else's business, as RFC 7517 says.
        rows = [key for key in PyJWKSet.from_json(text_of(data)) if key.algorithm_name == "EdDSA"]
        return {cast("str", row.key_id): row.key for row in rows} or _no_keys()
    except (PyJWTError, ValueError, TypeError, AttributeError, RecursionError):
        return _no_keys()


def _content(given: bytes | str, *, name: str) -> bytes:
    if isinstance(given, str):
        return given.encode()
    if not isinstance(given, bytes):
        raise TypeError(f"{name} is of type {type(given).__name__}; expected the content of a file.")
    return given


def _no_keys() -> dict[str, Ed25519PublicKey]:
    raise NotVerified(
        "receipt-keys",
        f'The key set cannot be read, or has no Ed25519 key; expected the JSON object {{"keys": [...]}} of '
        f"{KEYS_PATH}.",
    )


def encode(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def decode(text: str) -> bytes:
    """Decode base64url without padding; raises `ValueError` for any other spelling."""
    data = base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True)
    if encode(data) != text:
        raise ValueError("not the canonical base64url text")
    return data


# --- signing and checking --------------------------------------------------------------------------------


def sign(document: Mapping[str, Any], *, private_key: bytes) -> str:
    """Sign a receipt of these fields with an Ed25519 seed of 32 bytes."""
    import jwt  # noqa: PLC0415 - slow to import
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415 - likewise

    key = Ed25519PrivateKey.from_private_bytes(private_key)
    headers = {"typ": TYPE, "kid": key_id(public_key(private_key))}
    return jwt.encode({"version": VERSION, **document}, key, algorithm="EdDSA", headers=headers)


def claimed_site(receipt: bytes | str) -> str:
    """Return the site that a receipt names, unchecked, or an empty text. Its author can name any site."""
    import jwt  # noqa: PLC0415 - slow to import

    try:
        text = text_of(_content(receipt, name="receipt")).strip()
        site = jwt.decode(text, options={"verify_signature": False}).get("site")
    except (jwt.PyJWTError, ValueError, RecursionError):
        return ""
    return site if isinstance(site, str) else ""


def verify(receipt: bytes | str, keys: Mapping[str, Ed25519PublicKey]) -> Verified:
    """Check a receipt's signature by these keys (see `read_keys`) and read it. Raises `NotVerified`."""
    receipt = _content(receipt, name="receipt")
    if len(receipt) > MAX_BYTES:
        raise _malformed(f"it has {len(receipt):,} bytes; expected at most {MAX_BYTES:,}")
    try:
        named, document = _read(receipt, keys)
        if document["version"] > VERSION:
            raise NotVerified(
                "receipt-version",
                f"The receipt has the version {document['version']}; expected at most {VERSION}, the last "
                "that this release of tsttc knows.",
            )
        return _verified(document, named)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        raise _malformed("it cannot be read; expected what the leaderboard wrote") from None


def _read(receipt: bytes, keys: Mapping[str, Ed25519PublicKey]) -> tuple[str, Document]:
    import jwt  # noqa: PLC0415 - slow to import

    text = text_of(receipt).strip()
    try:
        header = jwt.get_unverified_header(text)
        if header.get("typ") != TYPE:
            raise _malformed(f"it is a token of the type {header.get('typ')!r}; expected {TYPE}")
        key = _key(header["kid"], keys)
        return header["kid"], jwt.decode(text, key, algorithms=["EdDSA"])
    except jwt.InvalidSignatureError:
        raise NotVerified(
            "receipt-altered",
            "The signature does not fit what the receipt says; expected it unchanged, as the leaderboard "
            "gave it.",
        ) from None
    except jwt.PyJWTError as fault:
        raise _malformed(f"{fault}; expected the token that the leaderboard wrote") from None


def _key(named: str, keys: Mapping[str, Ed25519PublicKey]) -> Ed25519PublicKey:
    if named not in keys:
        raise NotVerified(
            "receipt-key-unknown",
            f"The receipt names the key {named}, and the key set has {', '.join(keys) or 'none'}; "
            "expected a key of the site that gave the receipt.",
        )
    return keys[named]


def _malformed(what: str) -> NotVerified:
    return NotVerified("receipt-malformed", f"This is not a receipt: {what}.")


def _verified(document: Document, named: str) -> Verified:
    rules = PROTOCOLS.get(document["protocol"])
    names = rules.score_names if rules else sorted(document["scores"])
    texts = {name: document["scores"][name] for name in names}
    ranges = rules.range_names if rules else sorted(document["counts"])
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
        scores={name: None if text is None else float(text) for name, text in texts.items()},
        counts={name: document["counts"][name] for name in ranges},
        scored_at=document["scored_at"],
        decimals=max((len(text.partition(".")[2]) for text in texts.values() if text), default=0),
    )
