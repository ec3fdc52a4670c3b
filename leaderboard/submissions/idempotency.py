"""The same request sent twice is one submission: requests that carry an `Idempotency-Key`.

A key is a person's own name for one request. It is written in the transaction that writes the submission, so
there is never one without the other: what was refused burns no key, and of two requests with one key at the
same moment one waits for the other's transaction and is answered with its submission.
"""

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta

from django.db import IntegrityError, transaction

from leaderboard.models import IdempotencyKey, User
from leaderboard.submissions import submissions

MAX_CHARACTERS = 255
KEPT = timedelta(days=7)
_BARE = re.compile(r"[!#-\[\]-~]{1,255}")
_QUOTED = re.compile(r'"((?:[ !#-\[\]-~]|\\["\\])*)"')


class BadKey(Exception):
    """The header is neither a text in quotes, as its draft standard wants it, nor one word."""


class KeyReused(Exception):
    """The key came before with something else."""


def parse(header: str) -> str:
    r"""The key that a header's text means; quotes around it do not count. Raises `BadKey`.

    >>> parse('"8e03978e-40d5"'), parse("8e03978e-40d5"), parse(r'"a \"b\""')
    ('8e03978e-40d5', '8e03978e-40d5', 'a "b"')
    """
    text = header.strip()
    quoted = _QUOTED.fullmatch(text)
    key = re.sub(r"\\(.)", r"\1", quoted[1]) if quoted else text if _BARE.fullmatch(text) else ""
    if not 0 < len(key) <= MAX_CHARACTERS:
        raise BadKey(
            f"The header 'Idempotency-Key' is malformed; expected 1 to {MAX_CHARACTERS} printable ASCII "
            'characters, in quotes if there are spaces, such as "8e03978e-40d5-43dd-bc93-6894a57f9324".'
        )
    return key


def request_digest(*, fields: Mapping[str, object], file_digest: str) -> str:
    """What makes two requests the same: the digest of the file's bytes, and every field of the form."""
    text = json.dumps({"fields": fields, "file": file_digest}, sort_keys=True)
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def once(
    *, user: User, key: str, digest: str, submit: Callable[[], submissions.Submitted], now: datetime
) -> submissions.Submitted:
    """Submit, unless the person's key has come before with this request: then its submission is the answer.

    Raises `KeyReused` if it came with another one, and whatever `submit` does; nothing is kept then.
    """
    earlier = _earlier(user=user, key=key, digest=digest)
    if earlier is not None:
        return earlier
    try:
        with transaction.atomic():
            submitted = submit()
            IdempotencyKey.objects.create(
                user=user, key=key, request_digest=digest, submission=submitted.submission, created_at=now
            )
    except IntegrityError:
        # The same key twice at once; the other request was first, and what this one wrote is undone.
        earlier = _earlier(user=user, key=key, digest=digest)
        if earlier is None:
            raise
        return earlier
    return submitted


def _earlier(*, user: User, key: str, digest: str) -> submissions.Submitted | None:
    row = (
        IdempotencyKey.objects.filter(user=user, key=key)
        .select_related("submission__method__team", "submission__split")
        .first()
    )
    if row is None:
        return None
    # Whoever has left the team since may no longer see what it has.
    is_theirs = row.submission.method.team.memberships.filter(user=user).exists()
    if row.request_digest != digest or not is_theirs:
        raise KeyReused(
            f"The Idempotency-Key {key[:60]!r} came on {row.created_at:%Y-%m-%d %H:%M} UTC with another file "
            "or other fields; expected a new key for a new request."
        )
    return submissions.Submitted(row.submission, is_new=False, is_replayed=True)


def purge(*, now: datetime) -> int:
    """Remove keys that are older than `KEPT`. Returns how many."""
    n_removed, _ = IdempotencyKey.objects.filter(created_at__lt=now - KEPT).delete()
    return n_removed
