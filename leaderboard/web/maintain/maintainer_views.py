"""The maintainers' pages of editions: open, preview, publish, roll back, discard."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, cast

from django.contrib import messages
from django.contrib.auth.views import redirect_to_login
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe
from django_htmx.http import HttpResponseClientRefresh

from evaluator.tables.formats import csv_lines
from leaderboard.db import clock
from leaderboard.editions import corrections, history, preview, splits
from leaderboard.editions.preview import ABSENT
from leaderboard.errors.refusals import NotMaintainer
from leaderboard.mails import outbox
from leaderboard.models import AuditEvent, Edition, QuotaOverride, Split, Status, Team, User
from leaderboard.pages import texts
from leaderboard.web.boards import edition_tables, tables
from leaderboard.web.decorators import asks_first
from leaderboard.web.forms import AskingForm, SiteForm
from leaderboard.web.maintain import edition_words, preview_tables, queue_tables, site_state
from leaderboard.web.maintain.maintainer_forms import (
    DiscardForm,
    OpenForm,
    PublishForm,
    RollBackForm,
)
from leaderboard.web.submissions.submission_views import STOP_POLLING

View = Callable[..., HttpResponseBase]

MAX_LISTED: Final = 50


def maintainers_only(view: View) -> View:
    """Let maintainers in, uncached; a visitor signs in first, others get a 404."""
    uncached = never_cache(view)

    @wraps(view)
    def guarded(request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponseBase:
        if not request.user.is_authenticated:
            # A part of an open page that asks for news: the whole page leads to the sign-in.
            htmx = getattr(request, "htmx", None)
            return HttpResponseClientRefresh() if htmx else redirect_to_login(request.get_full_path())
        if not request.user.is_maintainer:
            raise Http404
        try:
            return uncached(request, *args, **kwargs)
        except NotMaintainer as refusal:
            # They were one when the request came in.
            raise Http404 from refusal

    return guarded


def maintainers_form(view: View) -> View:
    return maintainers_only(asks_first(view))


@maintainers_only
@require_safe
def hub(request: HttpRequest) -> HttpResponse:
    """Show what waits for a decision, then every page and the editions of every split."""
    rows = Split.objects.select_related("current_edition__ground_truth")
    desks = [
        (desk, [edition_tables.running(*each) for each in desk["in_preparation"]])
        for desk in map(history.maintainer_overview, rows)
    ]
    is_running = any(not shown["is_final"] for _, running in desks for shown in running)
    has_imprint = texts.current(texts.IMPRINT) is not None
    is_waiting = not has_imprint or any(running or desk["system_errors"] for desk, running in desks)
    context = {
        "desks": desks,
        "is_running": is_running,
        "is_waiting": is_waiting,
        "queue": queue_tables.totals(),
        "n_overrides": QuotaOverride.objects.count(),
        "n_teams": Team.objects.count(),
        "n_published": splits.quoted().count(),
        "n_pages": len(texts.PAGES),
        "n_mails_waiting": outbox.waiting(),
        "n_mails_unsent": outbox.unsent().count(),
        "n_events": AuditEvent.objects.count(),
        "has_imprint": has_imprint,
        "state": site_state.lines(now=clock.database_now()),
    }
    return render(request, "maintain/hub.html", context)


@maintainers_form
def open_edition(request: HttpRequest, split: str) -> HttpResponse:
    split_row = get_object_or_404(Split.objects.select_related("current_edition__ground_truth"), pk=split)
    form = OpenForm.asked(request, split=split_row)
    if form.is_valid():
        with form.refusals():
            opened = corrections.open_edition(
                split_name=split, now=timezone.now(), actor=maintainer_of(request), **form.cleaned_data
            )
            return redirect("maintain_edition", split, opened.number)
    choices = edition_tables.truth_choices(split_row, form.truths)
    drafts = Edition.objects.in_preparation().filter(split=split_row).select_related("ground_truth")
    verb = "Open a draft edition of" if form.truths else "Import ground truth for"
    about = {"split": split_row, "verb": verb, "choices": choices, "drafts": drafts}
    return form_page(request, "maintain/open.html", form, **about)


@maintainers_only
@require_safe
def edition(request: HttpRequest, split: str, number: int) -> HttpResponse:
    row = _edition(split, number)
    past = history.record_of(row)
    context = {
        **_comparison(row, rows=request.GET.get("rows"), number=request.GET.get("page")),
        "standing": edition_words.standing(row),
        "predecessor": corrections.predecessor(row.split),
        "past": past,
        "change": edition_tables.past_change(past),
        "ttc_ranges": tables.counted_ranges(row.rules, row.ground_truth.counts),
    }
    return render(request, "maintain/edition.html", context)


@maintainers_only
@require_safe
def edition_progress(request: HttpRequest, split: str, number: int) -> HttpResponse:
    row = _edition(split, number)
    running = edition_tables.running(row, corrections.progress(row))
    if request.GET.get("seen") == running["seen"] and not running["is_final"]:
        return HttpResponse(status=204)
    context: dict[str, Any] = {"running": running}
    if running["is_final"] and "comparison" in request.GET:
        context |= _comparison(row)
    status = STOP_POLLING if running["is_final"] else 200
    return render(request, "maintain/progress_state.html", context, status=status)


@maintainers_only
@require_safe
def preview_csv(request: HttpRequest, split: str, number: int) -> HttpResponse:
    compared = preview.preview(_edition(split, number))
    return HttpResponse(
        "".join(csv_lines(preview.rows(compared), columns=compared.columns)),
        content_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="tsttc-{split}-edition-{number}-preview.csv"'},
    )


@maintainers_form
def publish(request: HttpRequest, split: str, number: int) -> HttpResponse:
    row = _edition(split, number)
    context = _effects(row)
    form = PublishForm.asked(request, initial={"replaces": context["preview"].replaces})
    if form.is_valid():
        with form.refusals():
            corrections.publish(
                edition=row, now=timezone.now(), actor=maintainer_of(request), **form.cleaned_data
            )
            messages.success(request, f"Edition {number} is now the {row.split.title} board.")
            return redirect("board", split)
    states = dict(row.evaluations.values_list("submission", "status"))
    unfinished = [(each, states.get(each.pk, ABSENT)) for each in corrections.unfinished(row)]
    kinds = {state for _, state in unfinished}
    rejected = preview_tables.newly_rejected(context["preview"])
    left_out = edition_words.left_out(
        n_unfinished=len(unfinished), n_rejected=context["preview"].n_newly_rejected
    )
    context |= {
        "why_not": edition_words.why_not_published(row),
        "rejected": rejected[:MAX_LISTED],
        "n_more_rejected": max(0, len(rejected) - MAX_LISTED),
        "n_unfinished": len(unfinished),
        "unfinished": [
            (each, preview_tables.STATUS_LABELS[state]) for each, state in unfinished[:MAX_LISTED]
        ],
        "n_more_unfinished": max(0, len(unfinished) - MAX_LISTED),
        "left_out": left_out,
        "has_failed": Status.SYSTEM_ERROR in kinds,
        "can_reopen": row.published_at and not row.reopened_at and ABSENT in kinds,
    }
    return form_page(request, "maintain/publish.html", form, **context)


@maintainers_form
def roll_back(request: HttpRequest, split: str, number: int) -> HttpResponse:
    row = _edition(split, number)
    former = corrections.predecessor(row.split)
    form = RollBackForm.asked(request, initial={"replaces": number})
    if form.is_valid():
        with form.refusals():
            corrections.roll_back(
                split_name=split, now=timezone.now(), actor=maintainer_of(request), **form.cleaned_data
            )
            messages.success(
                request,
                f"Edition {number} was rolled back: the {row.split.title} board is the one before it.",
            )
            return redirect("board", split)
    context = {**_effects(former), "undone": edition_tables.change_words(former, row)} if former else {}
    return form_page(request, "maintain/roll_back.html", form, leaving=row, former=former, **context)


@maintainers_form
def discard(request: HttpRequest, split: str, number: int) -> HttpResponse:
    row = _edition(split, number)
    form = DiscardForm.asked(request)
    if form.is_valid():
        with form.refusals():
            reason, actor = form.cleaned_data["reason"], maintainer_of(request)
            corrections.discard(edition=row, now=timezone.now(), actor=actor, reason=reason)
            done = "closed again" if row.published_at else "discarded"
            messages.success(request, f"Edition {number} of {split} was {done}.")
            return redirect("maintain")
    lead = edition_words.discarding(row, corrections.progress(row))
    verb = "Close" if row.reopened_at else "Discard"
    return form_page(request, "maintain/discard.html", form, edition=row, verb=verb, lead=lead)


def maintainer_of(request: HttpRequest) -> User:
    return cast("User", request.user)


def _edition(split: str, number: int) -> Edition:
    rows = Edition.objects.select_related("split__current_edition__ground_truth", "ground_truth")
    return get_object_or_404(rows, split=split, number=number)


def _comparison(row: Edition, *, rows: str | None = None, number: str | None = None) -> dict[str, Any]:
    context = _effects(row)
    return {
        **context,
        "comparison_heading": edition_words.comparison_heading(row),
        "table": preview_tables.change_table(context["preview"], rows=rows, number=number),
    }


def _effects(row: Edition) -> dict[str, Any]:
    """Return what publishing does in sentences, without the table of all submissions."""
    compared = preview.preview(row)
    return {
        "edition": row,
        "preview": compared,
        "effects": preview_tables.effects(compared),
        "running": edition_tables.running(row, compared.progress),
    }


def form_page(request: HttpRequest, template: str, form: SiteForm, **context: Any) -> HttpResponse:
    """Show a form: for the first time, with its errors, or with what it asks."""
    is_asking = isinstance(form, AskingForm) and bool(form.sentences)
    status = 422 if form.errors or is_asking else 200
    return render(request, template, {"form": form, **context}, status=status)
