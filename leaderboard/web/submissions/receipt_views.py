"""Score receipts on the pages, and the public keys that check them."""

from typing import cast
from uuid import UUID

from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.cache import cache_control, never_cache
from django.views.decorators.http import require_safe

from leaderboard.models import Submission, User
from leaderboard.submissions import receipts


@require_safe
@cache_control(public=True, max_age=3600)
def receipt_keys(request: HttpRequest) -> HttpResponse:
    """The public halves of the keys that receipts were ever signed with, as a JSON Web Key Set."""
    return JsonResponse(receipts.public_keys(), content_type="application/jwk-set+json")


@login_required
@never_cache
@require_safe
def receipt(request: HttpRequest, submission_id: UUID) -> HttpResponse:
    """The receipt of a score as a file, for the submission's own team."""
    rows = Submission.objects.of(cast("User", request.user))
    found = get_object_or_404(rows.select_related("method__team", "split"), pk=submission_id)
    try:
        document = receipts.receipt(submission=found)
    except receipts.NoReceipt as fault:
        return render(request, "400.html", {"sentence": str(fault)}, status=409)
    response = JsonResponse(document, json_dumps_params={"indent": 2, "ensure_ascii": False})
    response["Content-Disposition"] = f'attachment; filename="tsttc-receipt-{found.pk}.json"'
    return response
