"""What maintainers fill in before an edition is opened, published, taken back or given up."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, Self

from django import forms
from django.http import HttpRequest

from evaluator.protocol import PROTOCOLS
from leaderboard.models import Split
from leaderboard.rescoring import Refused

_STALE: Final = "The form does not say which edition was the board when you looked; load the page again."


class VerbForm(forms.Form):
    """A form for one verb. What the verb refuses stands on it, in the verb's own sentence."""

    @classmethod
    def asked(cls, request: HttpRequest, **options: Any) -> Self:
        """The form with what this request sends; empty when it only asks for it."""
        return cls(request.POST if request.method == "POST" else None, **options)

    @contextmanager
    def refusals(self) -> Iterator[None]:
        """Put the sentence of a `Refused` on the form."""
        try:
            yield
        except Refused as refused:
            self.add_error(None, str(refused))


class OpenForm(VerbForm):
    """Which ground truth and which protocol a new edition is to have."""

    digest = forms.ChoiceField(
        label="Ground truth",
        error_messages={
            "required": "No ground truth was chosen; expected one of those listed.",
            "invalid_choice": "That ground truth is not this split's; expected one of those listed.",
        },
    )
    protocol = forms.ChoiceField(
        choices=[(name, name) for name in PROTOCOLS],
        error_messages={
            "required": "No protocol was chosen; expected one of those listed.",
            "invalid_choice": f"There is no such protocol; expected one of {', '.join(PROTOCOLS)}.",
        },
    )

    def __init__(self, data: Any = None, *, split: Split) -> None:
        """`split` decides what there is to choose from."""
        published = split.published_edition
        self.truths = list(split.ground_truths.order_by("-imported_at"))
        initial = {"digest": published.ground_truth_id, "protocol": published.protocol} if published else {}
        super().__init__(data, initial=initial)
        self.fields["digest"].choices = [(truth.pk, truth.pk) for truth in self.truths]  # type: ignore[attr-defined]  # a ChoiceField


class ReasonForm(VerbForm):
    """A sentence that says why."""

    reason = forms.CharField(
        max_length=1000,
        widget=forms.Textarea(attrs={"rows": 3, "aria-describedby": "reason-help reason-error"}),
        help_text="A sentence or two. It stands in the public changelog and in the audit log.",
        error_messages={"required": "No reason was given; expected a sentence for the public changelog."},
    )


class RollBackForm(ReasonForm):
    """A reason, and the number of the edition that was the board when the maintainer looked."""

    replaces = forms.IntegerField(
        widget=forms.HiddenInput, error_messages={"required": _STALE, "invalid": _STALE}
    )


class PublishForm(RollBackForm):
    """The same, and whether what is unfinished or newly rejected is knowingly left out."""

    leave_out = forms.BooleanField(required=False)


class DiscardForm(ReasonForm):
    """A reason for those who look after the benchmark; nothing public changes."""

    reason = forms.CharField(
        max_length=1000,
        widget=forms.Textarea(attrs={"rows": 3, "aria-describedby": "reason-help reason-error"}),
        help_text="A sentence for the audit log. Nothing public changes.",
        error_messages={"required": "No reason was given; expected a sentence for the audit log."},
    )
