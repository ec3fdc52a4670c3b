"""`manage.py make_receipt_key`."""

import secrets
from typing import Any

from django.core.management.base import BaseCommand

from evaluator import receipts


class Command(BaseCommand):
    help = "Make a key that signs score receipts, and print it with its public half. Nothing is stored."
    # Also where the settings lack the key that this makes.
    requires_system_checks: list[str] = []

    def handle(self, *args: Any, **options: Any) -> None:
        private_key = secrets.token_bytes(receipts.KEY_BYTES)
        public_key = receipts.public_key(private_key)
        self.stdout.write(f"TSTTC_RECEIPT_KEY={receipts.encode(private_key)}")
        self.stderr.write(
            f"Its name is {receipts.key_id(public_key)}. Once another takes its place, its public half "
            f"belongs into TSTTC_RECEIPT_OLD_KEYS: {receipts.encode(public_key)}"
        )
