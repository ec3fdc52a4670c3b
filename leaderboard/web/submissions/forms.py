"""The forms of submissions; the domain function refuses wrong values."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any, Self
from urllib.parse import urlencode
from uuid import UUID

from django import forms
from django.conf import settings
from django.core.files.base import File
from django.http import HttpRequest
from django.utils import timezone

from evaluator.predictions.documents import EMPTY_MESSAGE
from leaderboard.methods import visibility
from leaderboard.models import Method, Split, Submission, User
from leaderboard.people import teams
from leaderboard.quotas import admissions, usage
from leaderboard.storage import asked
from leaderboard.submissions import questions, search
from leaderboard.submissions.intake import SubmissionRequest
from leaderboard.submissions.questions import Question
from leaderboard.web.forms import SiteForm
from leaderboard.web.methods.method_forms import DetailsForm


@dataclass(frozen=True)
class SplitChoice:
    """A split to choose, with what its team has left or why it takes nothing."""

    split: Split
    is_open: bool
    sentence: str
    announcement: str


def offers_for(user: User, *, now: datetime) -> list[SplitChoice]:
    team = teams.current_team_of(user=user)
    offers = []
    for split in Split.objects.shown().select_related("current_edition__ground_truth"):
        refusal = admissions.refusal_for_all(split, now=now) or admissions.refusal_of(team=team, split=split)
        if refusal is None:
            quota = usage.state(team=team, user=user, split=split, now=now)
            sentence = f"{quota.sentence} {admissions.closing_of(split)}".strip()
        else:
            sentence = str(refusal)
        offers.append(SplitChoice(split, refusal is None, sentence, split.announcement_at(now)))
    return offers


class SubmissionForm(DetailsForm):
    """A prediction file, its split and its method."""

    split = forms.CharField(error_messages={"required": "No split was chosen; expected one of those listed."})
    method = forms.CharField(
        help_text="Type a new name, or the name of one of your team’s methods.",
        error_messages={"required": "No method was named; expected its name on the board."},
        widget=forms.TextInput(attrs={"list": "methods", "maxlength": 80, "autocomplete": "off"}),
    )
    file = forms.FileField(
        label="Prediction file",
        error_messages={
            "required": "No prediction file was sent; expected a JSON file.",
            "empty": EMPTY_MESSAGE,
        },
        widget=forms.FileInput(
            attrs={
                "accept": ".json,.gz,.csv,application/json,application/gzip,text/csv",
                "aria-describedby": "id_file_helptext id_file_error",
            }
        ),
    )

    confirmed = forms.CharField(required=False, widget=forms.HiddenInput())
    kept = forms.CharField(required=False, widget=forms.HiddenInput())
    kept_name = forms.CharField(required=False, widget=forms.HiddenInput())
    note = forms.CharField(
        required=False,
        help_text="Optional. Only your team sees it.",
        widget=forms.TextInput(attrs={"maxlength": 500, "autocomplete": "off"}),
    )

    def __init__(self, user: User, request: HttpRequest) -> None:
        sent = (request.POST, request.FILES) if request.method == "POST" else (None, None)
        super().__init__(
            sent[0], sent[1], initial={"split": self._split_to_mark, "method": request.GET.get("method", "")}
        )
        self.question: Question | None = None
        self.kept_digest = ""
        # A script keeps the file itself, and asks for JSON.
        self._has_script = "application/json" in request.headers.get("Accept", "")
        self._kept: File[bytes] | None = None
        self._user = user
        self._preferred = request.GET.get("split", "")
        self.max_bytes = settings.MAX_PREDICTIONS_BYTES
        if request.POST.get("kept") and "file" not in request.FILES:
            self._take_kept(request.POST["kept"])

    # Read only where the form is drawn: a file that is accepted is answered without any of it.
    @cached_property
    def offers(self) -> list[SplitChoice]:
        return offers_for(self._user, now=timezone.now())

    @cached_property
    def methods(self) -> list[Method]:
        return list(Method.objects.of(self._user).order_by("name"))

    @property
    def open_offers(self) -> list[SplitChoice]:
        return [offer for offer in self.offers if offer.is_open]

    @property
    def closed_offers(self) -> list[SplitChoice]:
        return [offer for offer in self.offers if not offer.is_open]

    def _split_to_mark(self) -> str:
        open_names = [offer.split.name for offer in self.open_offers]
        return self._preferred or (open_names[0] if len(open_names) == 1 else "")

    @property
    def notices(self) -> list[str]:
        """Say which of the team's methods others see; or of the chosen one."""
        chosen = [method for method in self.methods if method.name == self["method"].value()]
        sentences = (visibility.notice_of(method) for method in chosen or self.methods)
        return [sentence for sentence in sentences if sentence]

    @property
    def options(self) -> list[tuple[str, str]]:
        """Return the team's methods, each with its notice."""
        return [(method.name, visibility.notice_of(method)) for method in self.methods]

    @property
    def shows_details(self) -> bool:
        """Tell whether the details are open: for a first method, and with text or an error."""
        fields = (*self.described, *self.detailed)
        return not self.methods or any(field.value() or field.errors for field in fields)

    def _take_kept(self, digest: str) -> None:
        self._kept = asked.kept(user=self._user, digest=digest, now=timezone.now())
        self.kept_digest = digest if self._kept is not None else ""
        self.fields["file"].required = self._kept is None
        self.fields["file"].error_messages["required"] = "The file is no longer kept; choose it again."

    @property
    def kept_name_shown(self) -> str:
        """Return the name of the file that is kept, as it was sent."""
        chosen = self.files.get("file")
        return str(chosen.name if chosen else self.data.get("kept_name", ""))[:200]

    def asks(self, request: SubmissionRequest) -> bool:
        """Tell whether something is asked first that is not confirmed. Raises as `intake.submit`."""
        question = questions.question(request)
        if question is None or self.cleaned_data["confirmed"] == question.answer:
            return False
        self.question = question
        if not self._has_script and request.upload is not None:
            self._keep(request.upload, digest=question.digest)
        return True

    def _keep(self, upload: "File[bytes]", *, digest: str) -> None:
        if upload is self._kept or asked.keep(upload, user=self._user):
            self.kept_digest = digest
            self.fields["file"].required = False

    def close(self) -> None:
        """Close the file that was kept."""
        if self._kept is not None:
            self._kept.close()

    def forget_kept(self) -> None:
        """Remove the file that was kept: it is submitted."""
        if self._kept is not None:
            asked.forget(user=self._user)

    def submission_request(self, *, now: datetime) -> SubmissionRequest:
        """Make the request of the valid form."""
        fields = self.cleaned_data
        upload = fields["file"] or self._kept
        return SubmissionRequest(
            user=self._user,
            split_name=fields["split"],
            method_name=fields["method"],
            upload=upload,
            via=Submission.Via.WEB,
            now=now,
            filename=self.kept_name_shown,
            details={field.name: fields[field.name] for field in (*self.described, *self.detailed)},
            note=fields["note"],
        )


class MoveForm(SiteForm):
    """The method to which a submission is moved."""

    method = forms.CharField(
        label="To the method",
        help_text="The private methods of your team.",
        error_messages={"required": "No method was chosen; expected one of your team’s private methods."},
    )

    def __init__(self, *args: Any, methods: Iterable[Method], **options: Any) -> None:
        super().__init__(*args, **options)
        choices = [("", "Choose a method"), *((str(method.pk), method.name) for method in methods)]
        self.fields["method"].widget = forms.Select(choices=choices)


def parse_uuid(text: str) -> UUID | None:
    try:
        return UUID(text)
    except ValueError:
        return None


def _splits() -> list[tuple[str, str]]:
    return [("", "all"), *((name, name) for name in Split.objects.shown().values_list("pk", flat=True))]


class SearchForm(forms.Form):
    """The search in one's own submissions; an invalid field shows its fault and filters nothing."""

    q = forms.CharField(
        label="Search",
        required=False,
        max_length=200,
        widget=forms.TextInput(attrs={"placeholder": "method, file or note", "type": "search"}),
    )
    split = forms.ChoiceField(required=False, choices=_splits)
    state = forms.ChoiceField(required=False, choices=[("", "all"), *search.STATES])

    chosen_method: Method | None = None

    @classmethod
    def of(cls, request: HttpRequest) -> Self:
        """Return the form of a query; ignore methods of others."""
        form = cls(request.GET)
        asked = parse_uuid(request.GET.get("method", ""))
        form.chosen_method = Method.objects.of(request.user).filter(pk=asked).first() if asked else None
        form.full_clean()
        return form

    def wanted(self) -> dict[str, Any]:
        """Return the valid fields under the names of `search.matching`."""
        fields = self.cleaned_data
        method = self.chosen_method.pk if self.chosen_method else None
        return {
            "text": fields.get("q", ""),
            "split": fields.get("split", ""),
            "state": fields.get("state", ""),
            "method": method,
        }

    @property
    def has_query(self) -> bool:
        return any(self.wanted().values()) or bool(self.errors)

    @property
    def address(self) -> str:
        """Return the query, to be followed by a page."""
        names = {"text": "q"}
        query = {names.get(name, name): value for name, value in self.wanted().items() if value}
        return f"{urlencode(query)}&" if query else ""
