"""Pagination: `limit` rows after the row `after`, and a `Link` to the next page; new rows do not shift it."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from django.conf import settings
from django.core.exceptions import ValidationError
from django.db.models import Model, Q, QuerySet
from drf_spectacular.utils import OpenApiParameter
from rest_framework.request import Request

from leaderboard.api.exceptions import BadValue, whole_number
from leaderboard.api.schema import response_header

Row = TypeVar("Row", bound=Model)
MOST = 100

PARAMETERS = [
    OpenApiParameter("limit", int, description=f"Rows per page, 1 to {MOST}; default {MOST}."),
    response_header("Link", str, 'The next page, rel="next"; absent on the last page.', statuses=[200]),
    OpenApiParameter(
        "after",
        str,
        description="The page after this row: the value of `after` in the header `Link` of the page before.",
    ),
]


@dataclass(frozen=True)
class Page(Generic[Row]):
    """Some rows of a list, and the header that links to the next page."""

    rows: list[Row]
    headers: dict[str, str]


def page_of(rows: QuerySet[Row], request: Request, *, order: str) -> Page[Row]:
    """Return a page of `rows`, ordered by a column (descending with `-`). Raises `BadValue`."""
    limit = whole_number(
        request.query_params.get("limit", str(MOST)),
        name="limit",
        code="bad-limit",
        limits=range(1, MOST + 1),
        expected=f"a whole number from 1 to {MOST}",
    )
    is_descending, column = order.startswith("-"), order.removeprefix("-")
    sign = "-" if is_descending else ""
    after = request.query_params.get("after")
    if after is not None:
        last = _row(rows, after)
        word = "lt" if is_descending else "gt"
        value = getattr(last, column)
        rows = rows.filter(Q(**{f"{column}__{word}": value}) | Q(**{column: value, f"pk__{word}": last.pk}))
    page_rows = list(rows.order_by(order, f"{sign}pk")[: limit + 1])
    if len(page_rows) <= limit:
        return Page(page_rows, {})
    page_rows = page_rows[:limit]
    query = request.query_params.copy()
    query["after"] = str(page_rows[-1].pk)
    # The site's own URL, whatever the Host header says: the response may be cached for others.
    address = f"{settings.SITE_URL}{request.path}?{query.urlencode()}"
    return Page(page_rows, {"Link": f'<{address}>; rel="next"'})


def _row(rows: QuerySet[Row], after: str) -> Row:
    error = BadValue(
        "bad-cursor", "after", after, "the value of `after` in the header Link of the page before"
    )
    try:
        row = rows.filter(pk=after).first()
    except (ValueError, OverflowError, ValidationError):
        raise error from None
    if row is None:
        raise error
    return row
