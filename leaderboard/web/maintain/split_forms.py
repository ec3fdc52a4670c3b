"""Forms of splits and of the site's announcement."""

from dataclasses import asdict
from datetime import datetime
from typing import Any, Final

from django import forms

from leaderboard.editions import deadlines
from leaderboard.editions.policy import MAX_DESCRIPTION, MAX_POSITION, NAMES, POSITION_FAULT, Policy
from leaderboard.errors.refusals import Refused
from leaderboard.models import Split
from leaderboard.models.benchmark import Listing
from leaderboard.quotas.spans import span
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.quota_forms import QuotaRulesForm

_LISTINGS: Final = [
    (Listing.LISTED, "listed"),
    (Listing.ARCHIVED, "archived: the board stays, submissions are closed"),
    (Listing.OFF, "switched off: on no page, in no form, in no list of the API"),
]
# What is not named here comes first, without a heading.
_SECTIONS: Final = (
    ("Dates", ("opens_at", "closes_at")),
    ("Announcement", ("announcement", "announcement_ends_at")),
    ("Quota", ("quota_limit", "quota_window", "quota_min_gap", "quota_rejected_limit")),
    ("Admission", ("needs_admission", "how_to_be_admitted")),
)


class MomentField(forms.CharField):
    def __init__(self, label: str, help_text: str) -> None:
        attrs = {"placeholder": deadlines.EXAMPLE, "autocomplete": "off"}
        super().__init__(
            label=label,
            required=False,
            max_length=60,
            help_text=f"{help_text} With a zone: UTC, AoE, Europe/Berlin or +01:00.",
            widget=forms.TextInput(attrs=attrs),
        )

    def clean(self, value: Any) -> datetime | None:
        text: str = super().clean(value)
        try:
            return deadlines.parse(text) if text else None
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from refusal


class PolicyForm(QuotaRulesForm):
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
    listing = forms.ChoiceField(choices=_LISTINGS)
    position = forms.IntegerField(
        min_value=0,
        max_value=MAX_POSITION,
        initial=0,
        error_messages=dict.fromkeys(("min_value", "max_value"), POSITION_FAULT),
        help_text="Splits are listed by this number.",
        widget=forms.NumberInput(attrs={"inputmode": "numeric"}),
    )
    opens_at = MomentField("Opens", "Empty: as soon as it has ground truth.")
    closes_at = MomentField("Closes", "Empty: never.")
    announcement = forms.CharField(
        required=False,
        max_length=300,
        help_text="One line of plain text on the pages of the split and in the API. Empty: none.",
    )
    announcement_ends_at = MomentField("Announcement ends", "Needed for an announcement.")
    decimals = forms.TypedChoiceField(
        choices=[(1, "one"), (2, "two")],
        coerce=int,
        help_text="Decimals of its next edition. Each decimal reveals more of hidden values.",
    )
    needs_admission = forms.BooleanField(
        label="Restricted", required=False, help_text="Only admitted teams can submit."
    )
    how_to_be_admitted = forms.CharField(
        label="How to request access",
        required=False,
        max_length=300,
        help_text="Ends the sentence that teams read, such as: write to board@example.org.",
    )

    def sections(self) -> list[tuple[str, list[forms.BoundField]]]:
        """Return headings with their fields."""
        below = {name: title for title, names in _SECTIONS for name in names}
        by_title: dict[str, list[forms.BoundField]] = {"": [], **{title: [] for title, _ in _SECTIONS}}
        for field in self:
            by_title[below.get(field.name, "")].append(field)
        return list(by_title.items())

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
        help_text="Small letters, digits and hyphens. Used in URLs; permanent.",
        error_messages={"required": "No name was given; expected one like challenge-2027."},
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )
    truth = forms.ChoiceField(
        label="Ground truth",
        error_messages={"required": "No ground truth was chosen; expected one of those listed."},
    )

    field_order = ("name", "title", "truth")

    def __init__(self, data: Any = None, *, initial: Any = None) -> None:
        super().__init__(data, initial=initial)
        able = Split.objects.filter(same_truth_as=None).exclude(current_edition=None)
        self.fields["truth"].choices = [  # type: ignore[attr-defined]  # a ChoiceField
            ("hidden", "its own, hidden"),
            ("open", "its own, open"),
            *((f"as {split.pk}", f"that of {split.title}, shared: a challenge") for split in able),
        ]

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


class AnnouncementForm(SiteForm):
    """The arguments of `policy.announce`."""

    announcement = forms.CharField(
        required=False,
        max_length=300,
        help_text="One line of plain text, such as: Maintenance on 3 March, 8:00 to 9:00 UTC. Empty: none.",
    )
    announcement_ends_at = MomentField("Ends", "Needed for an announcement.")
