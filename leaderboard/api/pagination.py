"""Lists a page at a time: `limit` rows after the row named by `after`, and a `Link` to the next page.

A page begins behind a row and not at a number, so rows that come in meanwhile move nothing.
"""

from dataclasses import dataclass
from typing import Generic, TypeVar

from django.conf import settings
from django.core.exceptions import ValidationError
from django.db.models import Model, Q, QuerySet
from drf_spectacular.utils import OpenApiParameter
from rest_framework.request import Request

from leaderboard.api.problems import BadValue
from leaderboard.keeping import NEVER

Row = TypeVar("Row", bound=Model)
MOST = 100

QUERY = {"limit": NEVER, "after": NEVER}
PARAMETERS = [
    OpenApiParameter("limit", int, description=f"Rows of a page, 1 to {MOST}; without it {MOST}."),
    OpenApiParameter(
        "Link",
        str,
        OpenApiParameter.HEADER,
        description='The next page, rel="next"; absent on the last one.',
        response=[200],
    ),
    OpenApiParameter(
        "after",
        str,
        description="The page behind this row, as the header `Link` of the page before names it.",
    ),
]


@dataclass(frozen=True)
class Page(Generic[Row]):
    """Some rows of a list, and the headers that say how it goes on."""

    rows: list[Row]
    headers: dict[str, str]


def page_of(rows: QuerySet[Row], request: Request, *, order: str) -> Page[Row]:
    """The page of `rows` that the request asks for, in the order of a column (descending with `-`).

    Raises `BadValue`.
    """
    limit = _limit(request)
    is_descending, column = order.startswith("-"), order.removeprefix("-")
    sign = "-" if is_descending else ""
    after = request.query_params.get("after")
    if after is not None:
        last = _row(rows, after)
        word = "lt" if is_descending else "gt"
        value = getattr(last, column)
        rows = rows.filter(Q(**{f"{column}__{word}": value}) | Q(**{column: value, f"pk__{word}": last.pk}))
    found = list(rows.order_by(order, f"{sign}pk")[: limit + 1])
    if len(found) <= limit:
        return Page(found, {})
    found = found[:limit]
    query = request.query_params.copy()
    query["after"] = str(found[-1].pk)
    # The site's own address, whatever host this was asked of: others may be answered with the same.
    address = f"{settings.SITE_URL}{request.path}?{query.urlencode()}"
    return Page(found, {"Link": f'<{address}>; rel="next"'})


def _limit(request: Request) -> int:
    text = request.query_params.get("limit", str(MOST))
    if not (text.isascii() and text.isdecimal() and len(text) < 5 and 1 <= int(text) <= MOST):
        raise BadValue("bad-limit", "limit", text, f"a whole number from 1 to {MOST}")
    return int(text)


def _row(rows: QuerySet[Row], after: str) -> Row:
    refusal = BadValue("bad-cursor", "after", after, "the row that the header Link of the page before names")
    try:
        row = rows.filter(pk=after).first()
    except (ValueError, OverflowError, ValidationError):
        raise refusal from None
    if row is None:
        raise refusal
    return row
