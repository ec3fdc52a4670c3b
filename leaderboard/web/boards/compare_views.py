"""The page that sets two to five methods side by side."""

from typing import Final
from uuid import UUID

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard import comparisons, questions, rates, snapshots
from leaderboard.keeping import kept, matching
from leaderboard.models import Split
from leaderboard.web import compare_tables
from leaderboard.web.context import splits_of
from leaderboard.web.views import HOME_SPLIT

PARAMETERS: Final = {
    "split": matching(r"[a-zA-Z0-9_-]{0,32}"),
    "m": matching(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", is_list=True),
}
NOT_FOUND, UNPROCESSABLE, TOO_MANY = 404, 400, 429
# What the page offers to choose from; the board itself offers all.
MAX_OFFERED = 50


class UnknownSplit(comparisons.BadComparison):
    """There is no such split."""

    code = "unknown-split"


@require_safe
def compare(request: HttpRequest) -> HttpResponse:
    """Two to five methods of one board, their differences and what they mean; or the choice of them."""
    wanted = request.GET.getlist("m")
    try:
        split = _split(request, request.GET.get("split") or HOME_SPLIT)
        if not wanted:
            return _choose(request, split)
        compared = comparisons.of(
            methods=_ids(wanted),
            split=split,
            viewer=request.user,
            now=timezone.now(),
            address=rates.address_of(request),
        )
    except (comparisons.BadComparison, questions.TooManyWaiting) as refusal:
        return _refused(request, refusal)
    draw = kept(_drawn) if compared.is_complete else _drawn  # what is being computed changes by itself
    return draw(request, compared)


@kept
def _choose(request: HttpRequest, split: Split) -> HttpResponse:
    return render(request, "compare/choose.html", _choice(request, split))


def _drawn(request: HttpRequest, compared: comparisons.Compared) -> HttpResponse:
    return render(request, "compare/compare.html", {"page": compare_tables.comparison(compared)})


def _split(request: HttpRequest, name: str) -> Split:
    splits = splits_of(request)
    found = next((split for split in splits if split.pk == name), None)
    if found is None:
        names = ", ".join(split.pk for split in splits)
        raise UnknownSplit(f"There is no split {name[:60]!r}; expected one of {names}.")
    return found


def _ids(texts: list[str]) -> list[UUID]:
    try:
        return [UUID(text) for text in texts]
    except ValueError:
        wrong = next(text for text in texts if not _is_id(text))
        raise comparisons.UnknownMethod(
            f"There is no method {wrong[:60]!r}; expected an identifier as in the address of a method's page."
        ) from None


def _is_id(text: str) -> bool:
    try:
        UUID(text)
    except ValueError:
        return False
    return True


def _choice(request: HttpRequest, split: Split, refusal: Exception | None = None) -> dict[str, object]:
    """What can be compared on this board, the best first."""
    board = snapshots.board(split=split, viewer=request.user)
    entries = [entry for entry in board.entries if entry.method_id and entry.scores["mid"] is not None]
    return {
        "split": split,
        "entries": entries[:MAX_OFFERED],
        "n_in_all": len(entries),
        "chosen": request.GET.getlist("m"),
        "refusal": refusal,
    }


def _refused(
    request: HttpRequest, refusal: comparisons.BadComparison | questions.TooManyWaiting
) -> HttpResponse:
    """What is wrong with the choice, and the choice again."""
    name = request.GET.get("split") or HOME_SPLIT
    split = next((split for split in splits_of(request) if split.pk == name), None)
    status = NOT_FOUND if isinstance(refusal, UnknownSplit | comparisons.UnknownMethod) else UNPROCESSABLE
    context = _choice(request, split, refusal) if split else {"refusal": refusal}
    if isinstance(refusal, questions.TooManyWaiting):
        response = render(request, "compare/choose.html", context, status=TOO_MANY)
        response["Retry-After"] = str(refusal.retry_after_s)
        return response
    return render(request, "compare/choose.html", context, status=status)
