"""Forms of splits and of the site's announcement."""

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any, Final, NamedTuple

from django import forms
from django.db.models import Max
from django.urls import reverse_lazy
from django.utils.functional import lazy
from django.utils.html import format_html
from django.utils.safestring import SafeString

from leaderboard.editions import deadlines
from leaderboard.editions.policy import (
    FIRST_POLICY,
    MAX_DESCRIPTION,
    MAX_POSITION,
    NAMES,
    POSITION_FAULT,
    Policy,
)
from leaderboard.errors.refusals import Refused
from leaderboard.models import Split
from leaderboard.models.benchmark import Listing
from leaderboard.quotas.spans import span
from leaderboard.web.forms import AskingForm
from leaderboard.web.maintain.quota_forms import QuotaRulesForm

_ZONE: Final = "Add the time zone: UTC, AoE or +01:00."
_KEEP_SMALL: Final = (
    "If this split shares a hidden ground truth with another split, teams get more tries at the same hidden "
    "values. In that case, keep the quota small."
)

_CHALLENGE: Final = "A challenge on the same ground truth. You can list it at once."


def _choice(name: str, about: str) -> SafeString:
    return format_html('<strong>{}</strong> <span class="quiet">{}</span>', name, about)


class Section(NamedTuple):
    """Fields below a heading; those with short values share a row."""

    title: str
    wide: Sequence[str]
    short: Sequence[str] = ()
    note: str = ""


_DATES: Final = Section("Dates", (), ("opens_at", "closes_at"), _ZONE)
_ANNOUNCEMENT: Final = Section("Announcement", ("announcement", "announcement_ends_at"))
_QUOTA_FIELDS: Final = ("quota_limit", "quota_window", "quota_min_gap", "quota_rejected_limit")
_ADMISSION: Final = Section("Admission", ("needs_admission", "how_to_be_admitted"))
_DISPLAY_FIELDS: Final = ("listing", "position", "decimals")


class MomentField(forms.CharField):
    def __init__(self, label: str, help_text: str) -> None:
        attrs = {"placeholder": deadlines.EXAMPLE, "autocomplete": "off"}
        super().__init__(
            label=label,
            required=False,
            max_length=60,
            help_text=help_text,
            widget=forms.TextInput(attrs=attrs),
        )

    def clean(self, value: Any) -> datetime | None:
        text: str = super().clean(value)
        try:
            return deadlines.parse(text) if text else None
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from refusal


class PolicyForm(AskingForm, QuotaRulesForm):
    """The fields of `Policy`."""

    title = forms.CharField(
        max_length=80, error_messages={"required": "No title was given; expected one like Validation."}
    )
    description = forms.CharField(
        required=False,
        max_length=MAX_DESCRIPTION,
        help_text="One or two sentences, plain text.",
        widget=forms.Textarea(attrs={"rows": 3}),
    )
    listing = forms.ChoiceField(
        choices=Listing.choices,
        help_text="Archived: the board stays, submissions are closed. Switched off: shown nowhere.",
    )
    position = forms.IntegerField(
        min_value=0,
        max_value=MAX_POSITION,
        initial=0,
        error_messages=dict.fromkeys(("min_value", "max_value"), POSITION_FAULT),
        help_text="Splits are sorted by this number, smallest first.",
        widget=forms.NumberInput(attrs={"inputmode": "numeric"}),
    )
    opens_at = MomentField("Opens", "Empty: as soon as there is ground truth.")
    closes_at = MomentField("Closes", "Empty: never.")
    announcement = forms.CharField(
        label="Announcement text",
        required=False,
        max_length=300,
        help_text="One line of plain text on the pages of the split and in the API. Empty: no announcement.",
    )
    announcement_ends_at = MomentField("Announcement ends", f"Required if there is an announcement. {_ZONE}")
    decimals = forms.TypedChoiceField(
        choices=[(1, "one"), (2, "two")],
        coerce=int,
        help_text="Decimal places of the scores. More decimals reveal more about a hidden ground truth.",
    )
    needs_admission = forms.BooleanField(
        label="Only admitted teams can submit",
        required=False,
        help_text=lazy(format_html, SafeString)(
            'After saving, admit each team: open it under <a href="{}">Teams</a>, then “Quotas”.',
            reverse_lazy("maintain_teams"),
        ),
    )
    how_to_be_admitted = forms.CharField(
        label="How to request access",
        required=False,
        max_length=300,
        help_text="Shown to teams that are not admitted. Example: write to board@example.org.",
    )

    layout: tuple[tuple[Section, ...], ...] = (
        (Section("Split", ("title", "description"), _DISPLAY_FIELDS), _DATES),
        (_ANNOUNCEMENT, Section("Quota", (), _QUOTA_FIELDS), _ADMISSION),
    )

    is_hidden = False

    def columns(self) -> list[list[tuple[Section, list[forms.BoundField], list[forms.BoundField]]]]:
        """Return two columns of sections with their fields; a hidden split has a note on its quota."""
        return [
            [
                (
                    each._replace(note=_KEEP_SMALL) if self.is_hidden and each.title == "Quota" else each,
                    [self[name] for name in each.wide],
                    [self[name] for name in each.short],
                )
                for each in column
            ]
            for column in self.layout
        ]

    @staticmethod
    def filled_with(policy: Policy) -> dict[str, Any]:
        gap = policy.quota_min_gap
        return asdict(policy) | {
            "opens_at": deadlines.formatted(policy.opens_at),
            "closes_at": deadlines.formatted(policy.closes_at),
            "announcement_ends_at": deadlines.formatted(policy.announcement_ends_at),
            "quota_window": span(policy.quota_window),
            "quota_min_gap": span(gap) if gap else "",
        }

    def policy(self) -> Policy:
        return Policy(**{name: self.cleaned_data[name] for name in NAMES})


class NewSplitForm(PolicyForm):
    """Also what stays as it is: its name, and where its ground truth comes from."""

    name = forms.CharField(
        max_length=32,
        help_text="Lower-case letters, digits and hyphens. It appears in URLs and cannot be changed.",
        error_messages={"required": "No name was given; expected one like challenge-2027."},
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )
    truth = forms.ChoiceField(
        label="Ground truth",
        widget=forms.RadioSelect,
        initial="hidden",
        help_text=lazy(format_html, SafeString)(
            "If the ground truth is new, keep the split switched off until you have "
            '<a href="{}#splits-and-challenges">imported it</a>.',
            reverse_lazy("guide", args=["maintainers"]),
        ),
        error_messages={"required": "No ground truth was chosen; expected one of those listed."},
    )

    field_order = ("name", "title", "truth")
    is_hidden = True
    layout = (
        (Section("Split", field_order), Section("Display", ("description",), _DISPLAY_FIELDS), _DATES),
        (_ANNOUNCEMENT, Section("Quota", (), _QUOTA_FIELDS), _ADMISSION),
    )

    def __init__(self, data: Any = None, *, initial: Any = None) -> None:
        super().__init__(data, initial=initial)
        able = Split.objects.filter(same_truth_as=None).exclude(current_edition=None)
        self.fields["truth"].choices = [  # type: ignore[attr-defined]  # a ChoiceField
            ("hidden", _choice("New, hidden", "Teams cannot read the ground truth.")),
            ("open", _choice("New, open", "The ground truth is public.")),
            *((f"as {row.pk}", _choice(f"Same as {row.title}", _CHALLENGE)) for row in able),
        ]

    @classmethod
    def first_values(cls) -> dict[str, Any]:
        """Return what an empty form begins with: the split comes after the others."""
        last = Split.objects.aggregate(last=Max("position"))["last"]
        after = {} if last is None else {"position": min(last + 1, MAX_POSITION)}
        return cls.filled_with(FIRST_POLICY) | after

    def wanted(self) -> dict[str, Any]:
        """Return the cleaned fields under the names of `new_splits.add_split`."""
        truth = self.cleaned_data["truth"]
        is_own = not truth.startswith("as ")
        return {
            "name": self.cleaned_data["name"],
            "policy": self.policy(),
            "is_hidden": truth == "hidden" if is_own else None,
            "same_truth_as": "" if is_own else truth.removeprefix("as "),
        }


class AnnouncementForm(AskingForm):
    """The arguments of `policy.announce`."""

    announcement = forms.CharField(
        required=False,
        max_length=300,
        help_text="One line of plain text, for example: Maintenance on 3 March, 8:00 to 9:00 UTC.",
    )
    announcement_ends_at = MomentField("Ends", f"Required if there is an announcement. {_ZONE}")
