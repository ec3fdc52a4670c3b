"""`manage.py make_receipt_key`."""

import os
import secrets
from typing import Any

from django.core.management.base import BaseCommand, CommandError

from evaluator import receipts


class Command(BaseCommand):
    help = (
        "Make a key that signs score receipts, and print it with its public half. Where there is a key "
        "already, also print the list of former keys that its public half belongs to. Nothing is stored."
    )
    # Also where the settings lack the key that this makes.
    requires_system_checks: list[str] = []

    def handle(self, *args: Any, **options: Any) -> None:
        private_key = secrets.token_bytes(receipts.KEY_BYTES)
        public_key = receipts.public_key(private_key)
        self.stdout.write(f"TSTTC_RECEIPT_KEY={receipts.encode(private_key)}")
        self.stdout.write(f"TSTTC_RECEIPT_PUBLIC_KEY={receipts.encode(public_key)}")
        present = os.environ.get("TSTTC_RECEIPT_KEY", "")
        if present:
            former = [part for part in os.environ.get("TSTTC_RECEIPT_OLD_KEYS", "").split(",") if part]
            old_keys = ",".join(dict.fromkeys([_public_half(present), *former]))
            self.stdout.write(f"TSTTC_RECEIPT_OLD_KEYS={old_keys}")
            self.stderr.write(
                f"Replace all three lines: receipts of the key until now, {_name(present)}, then stay valid."
            )
        self.stderr.write(f"The name of the new key is {receipts.key_id(public_key)}.")


def _seed(text: str) -> bytes:
    try:
        seed = receipts.decode(text.strip())
    except ValueError:
        seed = b""
    if len(seed) != receipts.KEY_BYTES:
        raise CommandError("TSTTC_RECEIPT_KEY is malformed; expected 43 characters of base64url.")
    return seed


def _public_half(text: str) -> str:
    return receipts.encode(receipts.public_key(_seed(text)))


def _name(text: str) -> str:
    return receipts.key_id(receipts.public_key(_seed(text)))
