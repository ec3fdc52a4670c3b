"""Arguments and refusals that commands share."""

from argparse import ArgumentParser
from collections.abc import Mapping
from typing import Any

from django.core.management.base import BaseCommand, CommandError

from evaluator import Rejected
from leaderboard.errors.refusals import Refused
from leaderboard.models import User
from leaderboard.people import addresses


class RefusingCommand(BaseCommand):
    """A command whose function may refuse its arguments, or the ground truth at `path` or `truth`."""

    def execute(self, *args: Any, **options: Any) -> str | None:
        # Refusals become `CommandError`, in the words of the function that refuses.
        try:
            return super().execute(*args, **options)
        except Rejected as rejected:
            path = options.get("path") or options.get("truth")
            raise CommandError(f"{path} was refused; nothing was changed.\n{rejected}") from rejected
        except Refused as refused:
            raise CommandError(str(refused)) from refused


class AccountCommand(RefusingCommand):
    """A command about the account of EMAIL that asks for a reason."""

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("email", help="address of the account")
        parser.add_argument("--reason", required=True, help="a sentence for the audit log, without names")


def account_of(options: Mapping[str, Any]) -> User:
    user = User.objects.filter(email=addresses.stored(options["email"])).first()
    if user is None:
        raise CommandError("There is no account with that address; expected the primary address of one.")
    return user
