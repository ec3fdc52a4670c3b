"""Names that everybody sees: public methods and rows of papers. No two of them look alike."""

from typing import NamedTuple

from django.db import IntegrityError, transaction
from django.db.models import Q

from leaderboard.errors.refusals import Refused
from leaderboard.models import Method, PublishedResult, Team, Visibility
from leaderboard.people.names import confusable_with, skeleton


def twin_of(name: str, *, but: Method | None = None) -> str | None:
    """Return the name of a public method or of a row of a paper that looks like this one."""
    look = skeleton(name)
    # A method from before looks were compared has its number after its look.
    methods = Method.objects.filter(
        Q(look=look) | Q(look__startswith=f"{look} "), visibility=Visibility.PUBLIC
    )
    if but is not None:
        methods = methods.exclude(pk=but.pk)
    public = methods.order_by("look").values_list("name", flat=True).first()
    if public is not None:
        return public
    quoted = PublishedResult.objects.filter(replaced_at=None).values_list("method_name", flat=True)
    return confusable_with(name, quoted)


def require_free(name: str, *, but: Method | None = None, field: str) -> None:
    """Raise `Refused` where a name on the boards looks like this one; certain once the boards are locked."""
    twin = twin_of(name, but=but)
    if twin is not None:
        raise _taken(name, twin, field=field)


def save(method: Method, *, fields: list[str]) -> None:
    """Save a public method with its look. Raises `Refused` where another one has it."""
    method.look = skeleton(method.name)
    try:
        with transaction.atomic():
            method.save(update_fields=[*fields, "look"])
    except IntegrityError:
        raise _taken(method.name, method.name, field="visibility") from None


class Exempt(NamedTuple):
    """A public name from before looks were compared, and the one that it looks like, if it is still there."""

    row: Team | Method
    twin: str | None


def exempt() -> list[Exempt]:
    """Return the names that keep their look until they are renamed: teams, then methods, by name."""
    teams = Team.objects.filter(is_shown=True)
    methods = Method.objects.filter(visibility=Visibility.PUBLIC).select_related("team")
    found = []
    for rows in (teams, methods):
        # Only such a look has a space, before the number of its row.
        for row in rows.filter(look__contains=" ").order_by("name", "pk"):
            look = skeleton(row.name)
            others = rows.filter(Q(look=look) | Q(look__startswith=f"{look} ")).exclude(pk=row.pk)
            found.append(Exempt(row, others.order_by("look").values_list("name", flat=True).first()))
    return found


def _taken(name: str, twin: str, *, field: str) -> Refused:
    return Refused(
        "name-taken",
        f"The boards already have a method {twin!r}, and {name!r} looks like it; expected another "
        "name. Rename your method before you publish it.",
        field=field,
    )
