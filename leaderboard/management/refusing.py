"""Commands that say in one line what was refused, in the words of the function that refuses."""

from typing import Any

from django.core.management.base import BaseCommand, CommandError

from evaluator import Rejected
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition


class RefusingCommand(BaseCommand):
    """A command whose function may refuse its arguments, or the ground truth at `path` or `truth`."""

    def execute(self, *args: Any, **options: Any) -> str | None:
        """Run it. Raises `CommandError` for what was refused."""
        try:
            return super().execute(*args, **options)
        except Rejected as rejected:
            path = options.get("path") or options.get("truth")
            raise CommandError(f"{path} was refused; nothing was changed.\n{rejected}") from rejected
        except Refused as refused:
            raise CommandError(str(refused)) from refused


def edition_of(options: dict[str, Any]) -> Edition:
    """The edition that SPLIT and NUMBER name. Raises `CommandError`."""
    edition = Edition.objects.filter(split=options["split"], number=options["number"]).first()
    if edition is None:
        raise CommandError(f"There is no edition {options['number']} of {options['split']!r}.")
    return edition
