"""Forms for opening, publishing, rolling back and discarding editions."""

from functools import partial
from typing import Any, Final

from django import forms

from evaluator.metrics.protocol import PROTOCOLS, Protocol
from leaderboard.errors.refusals import Refused, clean_text
from leaderboard.models import GroundTruth, Split
from leaderboard.web.forms import SiteForm, confirmation

_STALE: Final = "The form lacks the current edition; reload the page."


def reason_field(help_text: str, *, at: str = "audit log", max_length: int = 1000) -> forms.CharField:
    return forms.CharField(
        max_length=max_length,
        widget=forms.Textarea(attrs={"rows": 3}),
        help_text=help_text,
        error_messages={"required": f"No reason was given; expected a sentence for the {at}."},
        validators=[partial(_require_printable, max_length=max_length)],
    )


def _require_printable(text: str, *, max_length: int) -> None:
    try:
        clean_text("reason", text[:max_length], limit=max_length)
    except Refused as refused:
        raise forms.ValidationError(str(refused)) from refused


def _protocol_words(protocol: Protocol) -> str:
    """Tell protocols apart.

    >>> _protocol_words(PROTOCOLS["tsttc-2"]), _protocol_words(PROTOCOLS["toolkit"])
    ('MiD, RTE, WE; truncates predictions near 0', 'MiD, RTE; rejects a file with an undefined MiD')
    """
    rejects = "rejects a file with an undefined MiD"
    near_zero = "truncates predictions near 0" if protocol.near_zero_s else rejects
    return f"{', '.join(metric.symbol for metric in protocol.metrics)}; {near_zero}"


class OpenForm(SiteForm):
    digest = forms.ChoiceField(
        label="Ground truth",
        error_messages={
            "required": "No ground truth was chosen; expected one of those listed.",
            "invalid_choice": "That ground truth is not this split's; expected one of those listed.",
        },
    )
    protocol = forms.ChoiceField(
        choices=[(name, _protocol_words(protocol)) for name, protocol in PROTOCOLS.items()],
        error_messages={
            "required": "No protocol was chosen; expected one of those listed.",
            "invalid_choice": f"There is no such protocol; expected one of {', '.join(PROTOCOLS)}.",
        },
    )

    def __init__(self, data: Any = None, *, split: Split) -> None:
        self.truths = list(GroundTruth.objects.filter(split=split.truth_split_id).order_by("-imported_at"))
        super().__init__(data)
        self.fields["digest"].choices = [(truth.pk, truth.pk) for truth in self.truths]  # type: ignore[attr-defined]  # a ChoiceField


class ReasonForm(SiteForm):
    reason = reason_field(
        "Required: one or two sentences. Shown in the public changelog and in the notice to the teams.",
        at="public changelog",
    )


class RollBackForm(ReasonForm):
    """A reason, and the number of the edition that the maintainer saw as the board."""

    replaces = forms.IntegerField(
        widget=forms.HiddenInput, error_messages={"required": _STALE, "invalid": _STALE}
    )


class PublishForm(RollBackForm):
    """Also whether unfinished or newly rejected submissions may be left out."""

    leave_out = forms.BooleanField(required=False)


class DiscardForm(ReasonForm):
    reason = reason_field("Required: one sentence for the audit log.")
    confirm = confirmation()
