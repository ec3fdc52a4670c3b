"""`manage.py report_failure NAME`."""

import smtplib
import socket
from argparse import ArgumentParser
from typing import Any

from django.conf import settings
from django.core.mail import send_mail
from django.core.management.base import BaseCommand, CommandError


class Command(BaseCommand):
    help = "Mail TSTTC_ERROR_EMAILS that a service such as the nightly backup failed. Asks no database."
    requires_system_checks: list[str] = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("name", metavar="NAME", help="what failed, such as tsttc-backup.service")

    def handle(self, *args: Any, **options: Any) -> None:
        name, host = options["name"], socket.gethostname()
        if not settings.ERROR_EMAILS:
            raise CommandError(f"{name} failed, and TSTTC_ERROR_EMAILS names nobody to tell.")
        try:
            send_mail(
                f"{settings.ACCOUNT_EMAIL_SUBJECT_PREFIX}{name} failed",
                f"{name} failed on {host}, of {settings.SITE_URL}.\n\n"
                "The log of the service says why. With systemd:\n\n"
                f"    journalctl --unit {name} --lines 50\n",
                None,
                settings.ERROR_EMAILS,
            )
        except (OSError, smtplib.SMTPException) as fault:
            raise CommandError(f"{name} failed, and nobody could be told: {fault}") from fault
