"""Reading many rows a part at a time, so that the whole of a large table is never in memory."""

from collections.abc import Iterator
from typing import Final, TypeVar

from django.db.models import Model, QuerySet

M = TypeVar("M", bound=Model)
PART: Final = 500


def in_parts(rows: "QuerySet[M]", *, size: int = PART) -> Iterator[list[M]]:
    """The rows, `size` at a time; they are in the order of their primary keys. One query for each part.

    A cursor of the server would do it with one, but lives only as long as a transaction.
    """
    part = list(rows[:size])
    yield part
    if len(part) < size:
        return
    rest = list(rows.filter(pk__gt=part[-1].pk).values_list("pk", flat=True))
    for first in range(0, len(rest), size):
        yield list(rows.filter(pk__in=rest[first : first + size]))
