"""What commands share: refusals in one line, in the words of the function that refuses, and arguments."""

from argparse import ArgumentParser
from collections.abc import Mapping
from typing import Any, Final

from django.core.management.base import BaseCommand, CommandError

from evaluator import Rejected
from leaderboard.benchmark import moments
from leaderboard.benchmark.policy import NAMES
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Split, User
from leaderboard.models.benchmark import Listing
from leaderboard.quotas import quotas

NO_LIMIT: Final = "none"


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


class AccountCommand(RefusingCommand):
    """A command about the account of EMAIL that asks for a reason."""

    def add_arguments(self, parser: ArgumentParser) -> None:
        """EMAIL, reason."""
        parser.add_argument("email", help="address of the account")
        parser.add_argument("--reason", required=True, help="a sentence for the audit log, without names")


def account_of(options: Mapping[str, Any]) -> User:
    """The account of EMAIL. Raises `CommandError`."""
    user = User.objects.filter(email=options["email"].strip().lower()).first()
    if user is None:
        raise CommandError("There is no account with that address; expected the primary address of one.")
    return user


def split_of(options: Mapping[str, Any]) -> Split:
    """The split that SPLIT names. Raises `CommandError`."""
    split = Split.objects.filter(pk=options["split"]).first()
    if split is None:
        raise CommandError(f"There is no split {options['split']!r}.")
    return split


def edition_of(options: dict[str, Any]) -> Edition:
    """The edition that SPLIT and NUMBER name. Raises `CommandError`."""
    edition = Edition.objects.filter(split=options["split"], number=options["number"]).first()
    if edition is None:
        raise CommandError(f"There is no edition {options['number']} of {options['split']!r}.")
    return edition


# --- the options of commands that make or change a split ---------------------------------------------------


def add_to(parser: ArgumentParser) -> None:
    """An option for each thing that maintainers decide about a split, without defaults."""
    moment = f"like “{moments.EXAMPLE}”, with a zone (UTC, AoE, Europe/Berlin, +01:00)"
    parser.add_argument("--title", help="what pages call it")
    parser.add_argument("--description", help="one or two sentences")
    parser.add_argument("--position", type=int, help="its place among the splits")
    parser.add_argument("--listing", choices=[value.lower() for value in Listing.values])
    parser.add_argument("--opens", dest="opens_at", metavar="MOMENT", help=f"{moment}; “none”: at once")
    parser.add_argument("--closes", dest="closes_at", metavar="MOMENT", help=f"{moment}; “none”: never")
    parser.add_argument("--announcement", help="a line on its pages; “” with --announcement-ends none: none")
    parser.add_argument("--announcement-ends", dest="announcement_ends_at", metavar="MOMENT", help=moment)
    parser.add_argument("--decimals", type=int, choices=[1, 2], help="decimals of its next edition")
    parser.add_argument("--limit", dest="quota_limit", metavar="N", help="submissions per window; “none”")
    parser.add_argument("--window", dest="quota_window", metavar="SPAN", help="like “30 days”")
    parser.add_argument("--min-gap", dest="quota_min_gap", metavar="SPAN", help="like “24 hours”; “0 hours”")
    parser.add_argument(
        "--rejected-limit",
        dest="quota_rejected_limit",
        metavar="N",
        help="rejected files in 24 hours; “none”",
    )
    parser.add_argument(
        "--by-admission", metavar="HOW", help="how a team asks for admission; “none”: every team may submit"
    )


def given(options: Mapping[str, Any]) -> dict[str, Any]:
    """What was given, under the names of `Policy`. Raises `Refused`."""
    values: dict[str, Any] = {}
    for name in NAMES:
        text = options.get(name)
        if text is not None:
            values[name] = _value(name, text)
    if options.get("by_admission") is not None:
        how = options["by_admission"]
        values["needs_admission"] = how != NO_LIMIT
        values["how_to_be_admitted"] = "" if how == NO_LIMIT else how
    return values


def _value(name: str, text: Any) -> Any:
    if name in {"opens_at", "closes_at", "announcement_ends_at"}:
        return None if text == NO_LIMIT else moments.parse(text)
    if name in {"quota_window", "quota_min_gap"}:
        return quotas.parse_span(text)
    if name in {"quota_limit", "quota_rejected_limit"}:
        return None if text == NO_LIMIT else _count(text)
    return text.upper() if name == "listing" else text


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise Refused("bad-value", f"{text[:40]!r} is not a whole number; expected 0 or more, or “none”.")
    return int(text)
