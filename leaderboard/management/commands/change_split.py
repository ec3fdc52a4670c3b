"""`manage.py change_split NAME [--closes MOMENT] [--listing off] …`."""

from argparse import ArgumentParser
from dataclasses import replace
from typing import Any

from leaderboard.benchmark import policy
from leaderboard.benchmark.policy import Policy
from leaderboard.management.arguments import RefusingCommand, add_to, given
from leaderboard.models import Split


class Command(RefusingCommand):
    """Changes what maintainers decide about a split."""

    help = "Change the texts, dates, quota or listing of a split. What is not given stays."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """NAME, and its policy."""
        parser.add_argument("name", help="name of the split")
        add_to(parser)

    def handle(self, *args: Any, **options: Any) -> None:
        """Change it, and say what it was before."""
        values = given(options)
        before = Split.objects.filter(pk=options["name"]).first()
        old = policy.policy_of(before) if before else Policy(title="")
        after = policy.change(split_name=options["name"], policy=replace(old, **values), actor=None)
        changes = policy.changed(old, policy.policy_of(after))
        for name, (was, is_now) in changes.items():
            self.stdout.write(f"{name}: {was} → {is_now}")
        if not changes:
            self.stdout.write("Nothing changed.")
