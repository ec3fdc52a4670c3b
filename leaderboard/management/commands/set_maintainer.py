"""`manage.py set_maintainer EMAIL --reason TEXT [--end]`."""

from argparse import ArgumentParser
from typing import Any

from leaderboard.management.arguments import AccountCommand, account_of
from leaderboard.people import accounts


class Command(AccountCommand):
    help = "Make the owner of an account a maintainer, or end the role with --end."

    def add_arguments(self, parser: ArgumentParser) -> None:
        super().add_arguments(parser)
        parser.add_argument("--end", action="store_true", help="end the role")

    def handle(self, *args: Any, **options: Any) -> None:
        user = accounts.set_maintainer(
            user=account_of(options), is_maintainer=not options["end"], reason=options["reason"]
        )
        role = "a maintainer" if user.is_maintainer else "no maintainer"
        self.stdout.write(f"The account is that of {role} now.")
