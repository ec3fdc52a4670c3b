"""The audit log for maintainers: a page with filters, and its export."""

import itertools
import json
from collections.abc import Callable, Iterator
from datetime import UTC, date, datetime, time, timedelta
from functools import partial
from typing import Any

from django import forms
from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse, StreamingHttpResponse
from django.shortcuts import render
from django.urls import reverse
from django.views.decorators.http import require_safe

from leaderboard import audit
from leaderboard.models import AuditEvent
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain import audit_tables
from leaderboard.web.maintain.maintainer_views import maintainers_only

DAY = timedelta(days=1)


def _day(label: str) -> forms.DateField:
    return forms.DateField(
        label=label,
        required=False,
        input_formats=["%Y-%m-%d"],
        widget=forms.DateInput(attrs={"type": "date"}),
        error_messages={"invalid": "That is not a date; expected one like 2026-11-20."},
    )


def _narrow() -> forms.TextInput:
    return forms.TextInput(attrs={"size": 14})


def _occurring(name: str, words_of: Callable[[str], str]) -> list[tuple[str, str]]:
    words = AuditEvent.objects.order_by(name).values_list(name, flat=True).distinct()
    return [("", "any"), *((word, words_of(word)) for word in words)]


class AuditFilter(SiteForm):
    """Actor, verb, noun, and days in UTC, both included."""

    actor = forms.CharField(label="Actor’s email contains", required=False, max_length=254, widget=_narrow())
    verb = forms.ChoiceField(
        label="Action", required=False, choices=partial(_occurring, "verb", audit_tables.verb_words)
    )
    noun = forms.ChoiceField(
        label="Object type", required=False, choices=partial(_occurring, "noun", audit_tables.noun_words)
    )
    people = forms.ChoiceField(
        label="Done by", required=False, choices=[("", "anyone"), ("only", "people only")]
    )
    noun_id = forms.CharField(required=False, max_length=80, widget=forms.HiddenInput)
    since = _day("From")
    until = _day("To")

    def wanted(self) -> dict[str, Any]:
        fields = {name: value for name, value in self.cleaned_data.items() if value}
        fields["people"] = "people" in fields
        if "since" in fields:
            fields["since"] = _midnight(fields["since"])
        if "until" in fields:
            # The calendar ends with the year 9999, and has no day after its last.
            fields["until"] = _midnight(min(fields["until"], date.max - DAY) + DAY)
        return fields


def _midnight(day: date) -> datetime:
    return datetime.combine(day, time(), tzinfo=UTC)


PER_PAGE = 50


@maintainers_only
@require_safe
def events(request: HttpRequest) -> HttpResponse:
    asked = AuditFilter(request.GET)
    if not asked.is_valid():
        return render(request, "maintain/audit.html", {"form": asked}, status=400)
    page = Paginator(audit.events(**asked.wanted()), PER_PAGE).get_page(request.GET.get("page"))
    query, noun_id = asked.query(), asked.cleaned_data["noun_id"]
    context = {
        "form": asked,
        "page": page,
        "query": query,
        "rows": audit_tables.audit_rows(page),
        "of_object": f" of the object with the ID {noun_id}" if noun_id else "",
        "export_path": f"{reverse('maintain_audit_json')}{'?' if query else ''}{query}",
    }
    return render(request, "maintain/audit.html", context)


@maintainers_only
@require_safe
def export(request: HttpRequest) -> HttpResponse | StreamingHttpResponse:
    """Export matching events as JSON; `details` as they were hashed."""
    asked = AuditFilter(request.GET)
    if not asked.is_valid():
        return render(request, "maintain/audit.html", {"form": asked}, status=400)
    return StreamingHttpResponse(
        _json_list(_rows(asked)),
        content_type="application/json; charset=utf-8",
        headers={"Content-Disposition": 'attachment; filename="tsttc-audit.json"'},
    )


def _rows(asked: AuditFilter) -> Iterator[dict[str, Any]]:
    # A few at a time: the log grows with the site's age.
    events = audit.events(**asked.wanted()).iterator(chunk_size=1000)
    while some := list(itertools.islice(events, 1000)):
        names = audit.names_in(some)
        for event in some:
            yield {
                "id": event.pk,
                "at": event.at.isoformat(),
                "actor": event.actor.email if event.actor else None,
                **{name: getattr(event, name) for name in ("verb", "noun", "noun_id", "details")},
                "names": audit_tables.named(event, names),
                "previous_hash": event.previous_hash,
                "hash": event.hash,
            }


def _json_list(rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    opening = "["
    for row in rows:
        yield f"{opening}\n{json.dumps(row, ensure_ascii=False)}"
        opening = ","
    yield "[]\n" if opening == "[" else "\n]\n"
