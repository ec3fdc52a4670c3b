"""Methods as programs name them: by name, or by id, which a script keeps while people rename things."""

from uuid import UUID

from leaderboard.models import Method, User
from leaderboard.submissions import Refused

UUID_CHARACTERS = 36


def name_meant(*, user: User, text: str) -> str:
    """The name of the person's own method that a text means, which is its name, new or not, or its id.

    Raises `Refused` for an id that is none of theirs: nobody calls a method so.
    """
    text = text.strip()
    try:
        pk = UUID(text) if len(text) == UUID_CHARACTERS else None
    except ValueError:
        pk = None
    own = Method.objects.filter(team__memberships__user=user)
    if pk is None or own.filter(name=text).exists():
        return text
    name = own.filter(pk=pk).values_list("name", flat=True).first()
    if name is None:
        raise Refused("unknown-method", f"Your team has no method with the id {pk}.", field="method")
    return name
