"""The teams of the site for maintainers, searched by a name or an address."""

from django import forms
from django.core.paginator import Paginator
from django.db.models import Count, Max, Prefetch, Q, QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.models import OldAddress, Team, User
from leaderboard.moderation import forgetting, takeovers
from leaderboard.people import names, public_names
from leaderboard.quotas import mailboxes
from leaderboard.quotas.spans import span
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_views import maintainers_only

PER_PAGE = 50


class TeamSearch(SiteForm):
    team = forms.CharField(label="Team name or email address", required=False, max_length=254)


@maintainers_only
@require_safe
def team_list(request: HttpRequest) -> HttpResponse:
    """List every team, or those that match; also people who are in none."""
    form = TeamSearch(request.GET)
    text = form.cleaned_data["team"] if form.is_valid() else ""
    page = Paginator(_teams(text), PER_PAGE).get_page(request.GET.get("page"))
    matches = Q(email__icontains=text) | Q(pk__in=takeovers.with_former_address(text))
    alone = User.objects.filter(matches, membership=None).order_by("email")
    people = alone.exclude(email__endswith=f"@{forgetting.NOWHERE}")
    context = {
        "form": form,
        "text": text,
        "page": page,
        "people": people[:PER_PAGE],
        "n_more_people": max(0, people.count() - PER_PAGE),
    }
    if not text and page.number == 1:
        context["domains"] = mailboxes.busiest_domains(now=timezone.now())
        context["window"] = span(mailboxes.longest_window())
        context["alike"] = public_names.exempt()
        context["old_addresses"] = OldAddress.objects.order_by("mailbox", "address")
    return render(request, "maintain/teams.html", context, status=400 if form.errors else 200)


def _teams(text: str) -> QuerySet[Team]:
    """Return teams with this text in their name or in a present or former address of a member."""
    has_address = Q(members__email__icontains=text) | Q(members__in=takeovers.with_former_address(text))
    fits = Q(name__icontains=text) | Q(pk__in=Team.objects.filter(has_address).values("pk"))
    if look := names.skeleton(text):
        fits |= Q(look__contains=look)
    rows = Team.objects.filter(fits) if text else Team.objects.all()
    return (
        rows.prefetch_related(Prefetch("members", User.objects.order_by("email")))
        .annotate(
            n_methods=Count("methods", filter=Q(methods__deleted_at=None), distinct=True),
            n_submissions=Count("methods__submissions", distinct=True),
            last_at=Max("methods__submissions__submitted_at"),
        )
        .order_by("name", "pk")
    )
