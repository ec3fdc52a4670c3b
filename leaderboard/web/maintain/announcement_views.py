"""Announcements by mail for maintainers: write one, look at it, send it to the teams of a split."""

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone

from leaderboard.mails import announcements
from leaderboard.mails.announcements import Announcement
from leaderboard.models import Split
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_views import asks_first, form_page, maintainer_of, maintainers_only


class MailForm(SiteForm):
    """The text of an announcement. The names are those of `announcements.written`."""

    subject = forms.CharField(
        max_length=announcements.MAX_SUBJECT,
        help_text="One line. The name of the site stands before it.",
        error_messages={"required": "No subject was given; expected one line."},
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )
    text = forms.CharField(
        max_length=announcements.MAX_TEXT,
        help_text="Plain text, at most 5,000 characters. The mail ends with the name of the site and the "
        "page where one switches such mails off.",
        error_messages={"required": "No text was given; expected a few sentences."},
        widget=forms.Textarea(attrs={"rows": 10}),
    )


@maintainers_only
@asks_first
def mail(request: HttpRequest, split: str) -> HttpResponse:
    """Write a mail to the teams of a split, preview it, and send it: each is a step of one form."""
    found = get_object_or_404(Split, pk=split)
    step = request.POST.get("step", "")
    if step == "write":
        initial = {name: request.POST.get(name, "") for name in MailForm.base_fields}
        return form_page(request, "maintain/mail.html", MailForm(initial=initial), split=found)
    form = MailForm.asked(request)
    if form.is_valid():
        with form.refusals():
            announcement = announcements.written(split=found, **form.cleaned_data)
            return _sent(request, announcement) if step == "send" else _preview(request, announcement)
    return form_page(request, "maintain/mail.html", form, split=found)


def _preview(request: HttpRequest, announcement: Announcement) -> HttpResponse:
    subject, text = announcement.mailed
    context = {
        "announcement": announcement,
        "subject": subject,
        "text": text,
        "n_people": len(announcements.left(announcement)),
    }
    return render(request, "maintain/mail_preview.html", context)


def _sent(request: HttpRequest, announcement: Announcement) -> HttpResponse:
    """Send it, and say to how many. A second click finds nobody who has not got it."""
    n_people = announcements.announce(announcement, now=timezone.now(), actor=maintainer_of(request))
    if n_people:
        people = "1 person" if n_people == 1 else f"{n_people:,} people"
        messages.success(request, f"The mail to {people} is queued.")
    else:
        messages.info(request, "Nothing was sent: everybody who gets this mail has got it already.")
    return redirect("maintain_splits")
