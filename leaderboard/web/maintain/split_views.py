"""Splits for maintainers: list, new split, policy, announcements."""

from datetime import datetime

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from evaluator.counting import counted
from leaderboard.editions import deadlines, new_splits, policy
from leaderboard.editions.policy import Policy
from leaderboard.mails import announcements
from leaderboard.mails.announcements import Announcement
from leaderboard.models import PageVersion, Split
from leaderboard.quotas import admissions
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain import quota_tables
from leaderboard.web.maintain.maintainer_views import (
    form_page,
    maintainer_of,
    maintainers_form,
    maintainers_only,
)
from leaderboard.web.maintain.split_forms import AnnouncementForm, NewSplitForm, PolicyForm


@maintainers_only
@require_safe
def splits(request: HttpRequest) -> HttpResponse:
    now = timezone.now()
    rows = [
        (
            split,
            truth_words(split),
            (admissions.sentence_of(split, now=now) or "yes")
            if split.has_ground_truth
            else "no: ground truth not imported",
            split.announcement_at(now),
            quota_tables.submissions_of(split),
        )
        for split in Split.objects.select_related("current_edition", "same_truth_as")
    ]
    return render(request, "maintain/splits.html", {"rows": rows})


def truth_words(split: Split) -> str:
    """Say who knows the ground truth of a split, and whose it is."""
    words = "hidden" if split.is_hidden else "open"
    return f"{words}, that of {split.same_truth_as.title}" if split.same_truth_as else words


@maintainers_form
def add(request: HttpRequest) -> HttpResponse:
    form = NewSplitForm.asked(request, initial=NewSplitForm.first_values())
    now = timezone.now()
    if form.is_valid() and not form.asks(policy.doubtful_dates(None, form.policy(), now=now)):
        with form.refusals():
            split = new_splits.add_split(now=now, actor=maintainer_of(request), **form.wanted())
            messages.success(request, f"{split.title} was added.")
            return redirect("maintain_splits")
    return form_page(request, "maintain/split_form.html", form)


@maintainers_form
def change(request: HttpRequest, split: str) -> HttpResponse:
    split_row = get_object_or_404(Split, pk=split)
    before = policy.policy_of(split_row)
    form = PolicyForm.asked(request, initial=PolicyForm.filled_with(before))
    form.is_hidden = split_row.is_hidden
    if form.is_valid() and not form.asks(policy.doubtful_dates(before, form.policy(), now=timezone.now())):
        with form.refusals():
            policy.change(split_name=split, policy=form.policy(), actor=maintainer_of(request))
            messages.success(request, f"{split_row.title} was changed.")
            return redirect("maintain_splits")
    return form_page(request, "maintain/split_form.html", form, split=split_row)


@maintainers_form
def announcement(request: HttpRequest) -> HttpResponse:
    current = PageVersion.announcement().first()
    initial = (
        {"announcement": current.text, "announcement_ends_at": deadlines.formatted(current.ends_at)}
        if current
        else {}
    )
    form = AnnouncementForm.asked(request, initial=initial)
    if form.is_valid() and not form.asks(_doubts(current, form.cleaned_data["announcement_ends_at"])):
        with form.refusals():
            text, ends_at = form.cleaned_data["announcement"], form.cleaned_data["announcement_ends_at"]
            policy.announce(text=text, ends_at=ends_at, now=timezone.now(), actor=maintainer_of(request))
            messages.success(request, "The announcement was changed.")
            return redirect("maintain_splits")
    is_shown = current is not None and current.ends_at is not None and current.ends_at > timezone.now()
    return form_page(request, "maintain/announcement.html", form, current=current if is_shown else None)


def _doubts(current: PageVersion | None, ends_at: datetime | None) -> tuple[str, ...]:
    """Return what to ask of the end of the site's announcement, as of a split's."""
    now, before = timezone.now(), Policy(title="", announcement_ends_at=current.ends_at if current else None)
    if ends_at is not None and ends_at <= now:
        return ()  # it is refused
    return policy.doubtful_dates(before, Policy(title="", announcement_ends_at=ends_at), now=now)


class MailForm(SiteForm):
    """The arguments of `announcements.cleaned`."""

    subject = forms.CharField(
        max_length=announcements.MAX_SUBJECT,
        help_text="One line. The name of the site is added before it.",
        error_messages={"required": "No subject was given; expected one line."},
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )
    text = forms.CharField(
        max_length=announcements.MAX_TEXT,
        help_text="Plain text, at most 5,000 characters. The name of the site and an unsubscribe link are "
        "added at the end.",
        error_messages={"required": "No text was given; expected a few sentences."},
        widget=forms.Textarea(attrs={"rows": 10}),
    )


@maintainers_form
def mail(request: HttpRequest, split: str) -> HttpResponse:
    """Write, preview and send a mail to the teams of a split: steps of one form."""
    split_row = get_object_or_404(Split, pk=split)
    step = request.POST.get("step", "")
    if step == "write":
        initial = {name: request.POST.get(name, "") for name in MailForm.base_fields}
        return _written(request, MailForm(initial=initial), split_row)
    form = MailForm.asked(request)
    if form.is_valid():
        with form.refusals():
            announcement = announcements.cleaned(split=split_row, **form.cleaned_data)
            return _sent(request, announcement) if step == "send" else _preview(request, announcement)
    return _written(request, form, split_row)


def _written(request: HttpRequest, form: MailForm, split: Split) -> HttpResponse:
    n_people = announcements.readers(split).count()
    return form_page(request, "maintain/mail.html", form, split=split, n_people=n_people)


def _preview(request: HttpRequest, announcement: Announcement) -> HttpResponse:
    subject, text = announcement.mailed
    context = {
        "announcement": announcement,
        "subject": subject,
        "text": text,
        "n_people": len(announcements.recipients(announcement)),
    }
    return render(request, "maintain/mail_preview.html", context)


def _sent(request: HttpRequest, announcement: Announcement) -> HttpResponse:
    # After a second click nobody is left to get it.
    n_people = announcements.announce(announcement, now=timezone.now(), actor=maintainer_of(request))
    if n_people:
        messages.success(request, f"The email to {counted(n_people, 'person', 'people')} is queued.")
    else:
        messages.info(request, "Nothing was sent: everybody who gets this email has got it already.")
    return redirect("maintain_splits")
