"""Seeds of an edition's random numbers: public on open splits, known to workers alone on hidden ones.

Intervals, p-values and rank ranges come from random weights and signs. Of an open split they follow from the
digest of its ground truth, so that everybody gets the board's numbers offline. Of a hidden split the digest
is mixed with a secret: numbers that can be computed for every hypothesis about the labels would tell which
one fits. The secret is a file beside the ground truth, in the private directory; it is never in the database,
in a log or in an answer. Another secret gives other random numbers, as good as the former ones.
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
    """The secret of the hidden splits' random numbers is not there, or damaged; the text says what to do."""


def path() -> Path:
    """The path of the secret: next to the ground truth, to be kept in the same backup."""
    return Path(settings.GROUND_TRUTH_DIR) / "seed.key"


def seed_of(edition: Edition) -> str:
    """What the weights and signs of an edition are made of, the same in all editions of one ground truth.

    Raises `NoSecret` of a hidden split where this process can neither read the secret nor make it.
    """
    digest = edition.ground_truth_id
    if not (edition.split.is_hidden or hidden_marks.is_marked(digest)):
        return digest
    return hmac.new(_secret(), f"seed {digest}".encode(), hashlib.sha256).hexdigest()


def ensure() -> None:
    """Make the secret where there is none: whole or not at all, for its owner only.

    Raises `OSError` where the directory is not to be written.
    """
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
