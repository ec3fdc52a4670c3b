"""The page of the paper's tables, and each table in other formats."""

from typing import Final

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe

from evaluator.papers.tables import published_tables
from evaluator.tables import published
from evaluator.tables.formats import FORMATS
from leaderboard.web.boards.paper_charts import sweep

# A table has no papers of its own to cite, and its document is the API's.
DOWNLOADS: Final = tuple(each for each in FORMATS if each.name in {"csv", "latex", "markdown"})


@gzip_page
@require_safe
def published_page(request: HttpRequest) -> HttpResponse:
    """All tables, each with its notes; a chart where a setting is varied."""
    shown = [{"shown": each, "chart": sweep(each)} for each in published.printed_tables()]
    context = {"tables": shown, "source": published_tables().source, "downloads": DOWNLOADS}
    return render(request, "boards/published.html", context)


@require_safe
def published_table(request: HttpRequest, table_name: str, suffix: str) -> HttpResponse:
    """One table as CSV, LaTeX or Markdown."""
    chosen = next((each for each in DOWNLOADS if each.suffix == suffix), None)
    table = next((each for each in published_tables().tables if each.name == table_name), None)
    if chosen is None or table is None:
        raise Http404(f"There is no table {table_name}.{suffix}.")
    return HttpResponse(
        published.WRITERS[chosen.name](published.printed(table)),
        content_type=f"{chosen.media_type}; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="tsttc-paper-{table_name}.{suffix}"'},
    )
