"""The page of a comparison."""

from collections import Counter

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from evaluator.metrics.protocol import metric_of
from evaluator.scoring.results import format_rounded
from leaderboard.boards import snapshots
from leaderboard.boards.snapshots import splits_of
from leaderboard.http_caching import cacheable
from leaderboard.models import Split
from leaderboard.ops import rate_limits
from leaderboard.statistics import analyses, comparison_queue, comparisons
from leaderboard.web.compare import compare_tables
from leaderboard.web.compare.contact_lens import contact_lens

UNKNOWN, BAD_REQUEST, TOO_MANY = 404, 400, 429
# What the page offers to choose from; the board itself offers all.
MAX_OFFERED = 50


class UnknownSplit(comparisons.BadComparison):
    code = "unknown-split"


@require_safe
def compare(request: HttpRequest) -> HttpResponse:
    """Show two to five methods of one board and their differences, or the choice of them."""
    splits, wanted = splits_of(request), request.GET.getlist("m")
    # Without a name the first split whose submissions are scored, the default one before others.
    default = settings.BENCHMARK.default_split
    ordered = sorted(splits, key=lambda split: (not split.has_ground_truth, split.pk != default))
    name = request.GET.get("split") or (ordered[0].pk if ordered else default)
    split = next((split for split in splits if split.pk == name), None)
    try:
        if split is None:
            names = ", ".join(split.pk for split in splits)
            raise UnknownSplit(f"There is no split {name[:60]!r}; expected one of {names}.")
        if not wanted:
            return _choose(request, split)
        compared = comparisons.compare(
            methods=[comparisons.method_id(text) for text in wanted],
            split=split,
            viewer=request.user,
            now=timezone.now(),
            address=rate_limits.address_of(request),
            best_first=True,
        )
    except (comparisons.BadComparison, comparison_queue.TooManyComparisons) as refusal:
        return _refused(request, split, refusal)
    draw = cacheable(_drawn) if compared.is_complete else _drawn  # what is being computed changes by itself
    return draw(request, compared)


@cacheable
def _choose(request: HttpRequest, split: Split) -> HttpResponse:
    return render(request, "compare/choose.html", _choice(request, split))


def _drawn(request: HttpRequest, compared: comparisons.Compared) -> HttpResponse:
    # As many as everybody sees on the methods' pages.
    attempts = snapshots.shown(split=compared.split, edition=compared.edition).attempts
    n_tried = Counter(attempt.method_id for attempt in attempts)
    page = compare_tables.comparison(compared, n_tried=n_tried)
    ids = [entry.evaluation_id for entry in compared.entries if entry.evaluation_id]
    lens = contact_lens(compared.entries, analyses.curves(edition=compared.edition, evaluations=ids))
    context = {"page": page, "board_split": compared.split.pk, "lens": lens}
    return render(request, "compare/compare.html", context)


def _choice(request: HttpRequest, split: Split, refusal: Exception | None = None) -> dict[str, object]:
    board = snapshots.board(split=split, viewer=request.user)
    entries = [entry for entry in board.entries if entry.method_id and entry.value is not None]
    names = board.rules.overall_names
    # A method's page asks for the choice of others beside it.
    chosen = [*request.GET.getlist("m"), *request.GET.getlist("with")]
    rows = []
    for i, entry in enumerate(entries):
        is_chosen = str(entry.method_id) in chosen
        if i < MAX_OFFERED or is_chosen:
            values = [format_rounded(entry.scores[name], decimals=entry.decimals) for name in names]
            rows.append((entry, values, is_chosen))
    return {
        "split": split,
        "board_split": split.pk,
        "rows": rows,
        "n_in_all": len(entries),
        "metrics": list(map(metric_of, names)),
        "max_methods": comparisons.MAX_METHODS,
        "refusal": refusal,
    }


def _refused(
    request: HttpRequest,
    split: Split | None,
    refusal: comparisons.BadComparison | comparison_queue.TooManyComparisons,
) -> HttpResponse:
    status = UNKNOWN if isinstance(refusal, UnknownSplit | comparisons.UnknownMethod) else BAD_REQUEST
    context = _choice(request, split, refusal) if split else {"refusal": refusal}
    response = render(request, "compare/choose.html", context, status=status)
    if isinstance(refusal, comparison_queue.TooManyComparisons):
        response.status_code = TOO_MANY
        response["Retry-After"] = str(refusal.retry_after_s)
    return response
