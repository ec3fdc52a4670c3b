"""Seeds of an edition's random numbers: public on open splits, known to workers alone on hidden ones.

On an open split they follow from the digest of the ground truth, so that anybody gets the board's numbers
offline. On a hidden split a secret is added: else numbers could be computed for every hypothesis about the
labels. The secret is a file in the private directory, never in the database, a log or an answer.
"""

import hashlib
import hmac
import secrets
from pathlib import Path
from typing import Final

from django.conf import settings

from leaderboard.models import Edition
from leaderboard.storage import files, hidden_marks

N_BYTES: Final = 32


class NoSecret(OSError):
    """The secret of the hidden splits is missing or damaged."""


def path() -> Path:
    """Return the path of the secret, next to the ground truth."""
    return Path(settings.GROUND_TRUTH_DIR) / "seed.key"


def seed_of(edition: Edition) -> str:
    """Return the seed, the same in all editions of one ground truth. Raises `NoSecret`."""
    digest = edition.ground_truth_id
    if not (edition.split.is_hidden or hidden_marks.is_marked(digest)):
        return digest
    return hmac.new(_secret(), f"seed {digest}".encode(), hashlib.sha256).hexdigest()


def ensure() -> None:
    """Make the secret where there is none: whole or not at all, private to its owner. Raises `OSError`."""
    if not path().exists():
        with files.replacing(path()) as made:
            made.write_text(secrets.token_hex(N_BYTES) + "\n")


def _secret() -> bytes:
    try:
        ensure()
        secret = bytes.fromhex(path().read_text(encoding="ascii"))
    except ValueError:
        secret = b""
    except OSError as fault:
        raise NoSecret(
            f"The secret {path().name} beside the ground truth is not readable, and cannot be made here "
            f"({fault.strerror}); make it where the ground truth is written: manage.py make_seed_key"
        ) from fault
    if len(secret) != N_BYTES:
        raise NoSecret(
            f"The secret {path().name} beside the ground truth is damaged: found {len(secret)} bytes in "
            f"hexadecimal digits, expected {N_BYTES}; put it back from the backup of the ground truth."
        )
    return secret
