"""The page of the error analysis of one submission to an open split."""

from uuid import UUID

from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from leaderboard.models import Status, Submission
from leaderboard.scoring import analyses
from leaderboard.submissions import submissions
from leaderboard.web.submissions import analysis_charts


@login_required
@never_cache
@require_safe
def analysis(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """Error by time to contact, its distribution, predicted against true, the worst recordings."""
    rows = Submission.objects.visible_to(request.user).select_related("method", "split__published_edition")
    found = get_object_or_404(rows, pk=submission_id, split__is_hidden=False)
    progress = submissions.progress(found)
    if progress.is_final and progress.state != Status.SCORED:
        raise Http404("This submission has no score.")
    closer = analyses.of(submission=found, viewer=request.user)
    tables = analysis_charts.error_analysis_tables(closer) if closer else None
    return render(
        request, "submissions/analysis.html", {"submission": found, "tables": tables, "closer": closer}
    )
