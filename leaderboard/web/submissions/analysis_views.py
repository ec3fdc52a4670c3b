"""The page on which a team looks closer at one of its submissions to an open split."""

from uuid import UUID

from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from leaderboard import analyses
from leaderboard import submissions as verbs
from leaderboard.models import Status, Submission
from leaderboard.web import analysis_charts


@login_required
@never_cache
@require_safe
def analysis(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """Error by time to contact, its distribution, predicted against true, the worst recordings."""
    rows = Submission.objects.visible_to(request.user).select_related("method", "split__published_edition")
    found = get_object_or_404(rows, pk=submission_id, split__is_hidden=False)
    progress = verbs.progress(found)
    if progress.is_final and progress.state != Status.SCORED:
        raise Http404("Nothing of this submission was scored.")
    closer = analyses.of(submission=found, viewer=request.user)
    tables = analysis_charts.closer_tables(closer) if closer else None
    return render(request, "analysis.html", {"submission": found, "tables": tables, "closer": closer})
