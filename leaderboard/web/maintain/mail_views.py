"""The emails that wait, and those that were never sent, for maintainers."""

from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from leaderboard.mails import outbox
from leaderboard.web.maintain.maintainer_views import maintainers_only

PER_PAGE = 50


@maintainers_only
@require_safe
def mails(request: HttpRequest) -> HttpResponse:
    page = Paginator(outbox.unsent(), PER_PAGE).get_page(request.GET.get("page"))
    waiting = outbox.put_off()
    context = {
        "n_waiting": outbox.waiting(),
        "n_put_off": waiting.count(),
        "put_off": waiting[:PER_PAGE],
        "page": page,
        "kept_days": outbox.KEPT.days,
        "give_up_days": outbox.GIVE_UP_AFTER.days,
    }
    return render(request, "maintain/mails.html", context)
