"""What people fill in. What is wrong with it the verbs say: the same words on page, API and command line."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from django import forms
from django.conf import settings
from django.http import HttpRequest
from django.utils import timezone

from leaderboard import admissions, deadlines, names, teams, visibility
from leaderboard.models import Method, Split, Submission, User
from leaderboard.quotas import QuotaExceeded
from leaderboard.submissions import Refused

_ADDRESS: Final = {"placeholder": "https://", "maxlength": 500}


class SignupForm(forms.Form):
    """What signing up asks for beside address and password."""

    name = forms.CharField(
        label="Name shown on the board",
        max_length=80,
        required=False,
        help_text="Your own or your team's. Without one you appear as “Team” with a number; "
        "your email address is shown to your team alone.",
        widget=forms.TextInput(attrs={"autocomplete": "nickname"}),
    )
    field_order = ["email", "name", "password1", "password2"]

    def clean_name(self) -> str:
        """The name as boards will show it; two teams whose names look alike get a number."""
        name: str = self.cleaned_data["name"]
        if not name.strip():
            return ""
        try:
            return names.clean_name("name", name)
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from None

    def signup(self, request: HttpRequest, user: User) -> None:
        """Called once the account exists."""
        user.name = self.cleaned_data["name"]
        user.save(update_fields=["name"])


@dataclass(frozen=True)
class Offer:
    """A split to choose, and in a sentence what its team has left there, or why it takes nothing now."""

    split: Split
    is_open: bool
    sentence: str


def offers_for(user: User, *, now: datetime) -> list[Offer]:
    """Every split as this person finds it."""
    team = teams.present_team_of(user=user)
    found = []
    for split in Split.objects.select_related("published_edition"):
        quota = deadlines.left(team=team, user=user, split=split, now=now)
        is_admitted = admissions.refusal_of(team=team, split=split) is None
        is_open = is_admitted and deadlines.is_open(split, now=now)
        until = deadlines.sentence_of(split, now=now) if is_open else ""
        sentence = f"{quota.sentence} {until}".strip()
        found.append(Offer(split=split, is_open=is_open, sentence=sentence))
    return found


class SubmissionForm(forms.Form):
    """A prediction file, the split it is for and the method that made it.

    Only presence is checked here; everything else is the verb's to refuse, in the verb's words.
    """

    split = forms.CharField(error_messages={"required": "No split was chosen; expected one of those listed."})
    method = forms.CharField(
        help_text="Its name on the board: a new one, or one of your team's.",
        error_messages={"required": "No method was named; expected its name on the board."},
        widget=forms.TextInput(attrs={"list": "methods", "maxlength": 80, "autocomplete": "off"}),
    )
    file = forms.FileField(
        label="Prediction file",
        allow_empty_file=True,
        error_messages={"required": "No prediction file was sent; expected a JSON file."},
        widget=forms.FileInput(attrs={"accept": ".json,application/json"}),
    )
    description = forms.CharField(
        required=False,
        help_text="One or two sentences: what it does and what it looks at.",
        widget=forms.Textarea(attrs={"rows": 3, "maxlength": 2000}),
    )
    paper_url = forms.CharField(label="Paper", required=False, widget=forms.URLInput(attrs=_ADDRESS))
    code_url = forms.CharField(label="Code", required=False, widget=forms.URLInput(attrs=_ADDRESS))

    def __init__(self, *args: Any, offers: Sequence[Offer], methods: Sequence[Method], **kwargs: Any) -> None:
        """`offers` are all splits there are, `methods` the team's own to choose from."""
        super().__init__(*args, **kwargs)
        self.offers = offers
        self.methods = methods
        self.max_bytes = settings.MAX_PREDICTIONS_BYTES
        for name, field in self.fields.items():
            described = [f"{name}-help"] * bool(field.help_text or name == "file") + [f"{name}-error"]
            field.widget.attrs["aria-describedby"] = " ".join(described)

    @classmethod
    def for_user(cls, user: User, request: HttpRequest) -> "SubmissionForm":
        """The form as this person sees it, filled with what this request sends."""
        sent = (request.POST, request.FILES) if request.method == "POST" else ()
        offers = offers_for(user, now=timezone.now())
        open_names = [offer.split.name for offer in offers if offer.is_open]
        chosen = request.GET.get("split") or (open_names[0] if len(open_names) == 1 else "")
        methods = Method.objects.filter(team__memberships__user=user).order_by("name")
        return cls(*sent, offers=offers, methods=list(methods), initial={"split": chosen})

    @property
    def notices(self) -> list[str]:
        """Which of the team's methods others see, each in a sentence; of a chosen one that alone."""
        chosen = [method for method in self.methods if method.name == self["method"].value()]
        told = (visibility.notice_of(method) for method in chosen or self.methods)
        return [sentence for sentence in told if sentence]

    @property
    def options(self) -> list[tuple[str, str]]:
        """The names of the team's methods to choose from, and what is to be told of each."""
        return [(method.name, visibility.notice_of(method)) for method in self.methods]

    @property
    def has_details(self) -> bool:
        """Whether anything was said of the method, or is wrong with it: then the page shows those fields."""
        return any(
            self[name].value() or self[name].errors for name in ("description", "paper_url", "code_url")
        )

    def submission(self) -> dict[str, Any]:
        """What was filled in, under the verb's names."""
        fields = self.cleaned_data
        return {
            "split_name": fields["split"],
            "method_name": fields["method"],
            "upload": fields["file"],
            "filename": fields["file"].name or "",
            "via": Submission.Via.WEB,
            "description": fields["description"],
            "paper_url": fields["paper_url"],
            "code_url": fields["code_url"],
        }

    def refuse(self, refusal: Refused | QuotaExceeded) -> None:
        """Put the verb's sentence at the field that it is about."""
        self.add_error(refusal.field if refusal.field in self.fields else None, str(refusal))
