"""What a team fills in of a method: what it says of it, and who may see it. What is wrong the verbs say."""

from datetime import UTC, datetime
from typing import Any, Final

from django import forms
from django.http import HttpRequest

from leaderboard import methods, visibility
from leaderboard.models import BoxSource, Cameras, Method, Visibility
from leaderboard.texts import Refused

_ADDRESS: Final = {"placeholder": "https://", "maxlength": 500}
_NOT_SAID: Final = ("", "not said")
_YES_NO: Final = [_NOT_SAID, ("yes", "yes"), ("no", "no")]


def _describe(form: forms.Form) -> None:
    """Tell readers by ear which help and which errors belong to a field."""
    for name, field in form.fields.items():
        field.widget.attrs["aria-describedby"] = (
            f"{name}-help {name}-error" if field.help_text else f"{name}-error"
        )


class RefusableForm(forms.Form):
    """A form whose faults a verb names."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        _describe(self)

    def refuse(self, refusal: Refused) -> None:
        """Put the verb's sentence at the field that it is about."""
        self.add_error(refusal.field if refusal.field in self.fields else None, str(refusal))


class MethodForm(RefusableForm):
    """Everything that a team says of a method. Empty: nothing is said."""

    name = forms.CharField(required=False, widget=forms.TextInput(attrs={"maxlength": 80}))
    description = forms.CharField(
        required=False,
        help_text="One or two sentences: what it does and what it looks at.",
        widget=forms.Textarea(attrs={"rows": 4, "maxlength": 2000}),
    )
    paper_url = forms.CharField(label="Paper", required=False, widget=forms.URLInput(attrs=_ADDRESS))
    code_url = forms.CharField(label="Code", required=False, widget=forms.URLInput(attrs=_ADDRESS))
    n_frames = forms.CharField(
        label="Frames used",
        required=False,
        widget=forms.Select(choices=[_NOT_SAID, *((str(n), str(n)) for n in range(2, 7))]),
    )
    cameras = forms.CharField(required=False, widget=forms.Select(choices=[_NOT_SAID, *Cameras.choices]))
    box_source = forms.CharField(
        label="Box of the object",
        required=False,
        widget=forms.Select(choices=[_NOT_SAID, *BoxSource.choices]),
    )
    uses_nerf = forms.CharField(
        label="Trained with the NeRF data", required=False, widget=forms.Select(choices=_YES_NO)
    )
    uses_extra_data = forms.CharField(
        label="Trained with data from elsewhere", required=False, widget=forms.Select(choices=_YES_NO)
    )
    pretraining = forms.CharField(
        required=False,
        help_text="What its weights were trained on before, such as “ImageNet-1k”.",
        widget=forms.TextInput(attrs={"maxlength": 200}),
    )
    n_parameters = forms.CharField(
        label="Parameters", required=False, widget=forms.TextInput(attrs={"inputmode": "numeric"})
    )
    latency_ms = forms.CharField(
        label="Latency in ms", required=False, widget=forms.TextInput(attrs={"inputmode": "decimal"})
    )
    hardware = forms.CharField(
        required=False,
        help_text="What the latency was measured on. A latency needs it.",
        widget=forms.TextInput(attrs={"maxlength": 120}),
    )

    @classmethod
    def asked(cls, request: HttpRequest, *, method: Method) -> "MethodForm":
        """The form filled with what was sent, or with what is said now."""
        return cls(request.POST) if request.method == "POST" else cls(initial=_said(method))

    def changes(self) -> dict[str, object]:
        """What was sent, under the verb's names; a field that was not sent stays as it is."""
        return {name: value for name, value in self.cleaned_data.items() if name in self.data}


def _said(method: Method) -> dict[str, Any]:
    words = {True: "yes", False: "no", None: ""}
    found = {name: getattr(method, name) for name in methods.FIELDS}
    for name in ("uses_nerf", "uses_extra_data"):
        found[name] = words[found[name]]
    return found


class ShowForm(RefusableForm):
    """Who is to see a method, and that its team knows what that means."""

    visibility = forms.CharField(
        required=False,
        widget=forms.RadioSelect(choices=[(choice.value, choice.label) for choice in Visibility]),
    )
    reveal_on = forms.CharField(
        label="Reveal on",
        required=False,
        help_text="For an anonymous one: the day, in UTC, on which it turns public by itself. May be empty.",
        widget=forms.DateInput(attrs={"type": "date"}),
    )
    confirm = forms.BooleanField(
        required=False, label="Show it like this. I know that it cannot be taken back."
    )

    @classmethod
    def asked(cls, request: HttpRequest, *, method: Method) -> "ShowForm":
        """The form as it was sent, or as the address asks to look at it."""
        if request.method == "POST":
            return cls(request.POST)
        chosen = request.GET.get("visibility", "")
        if chosen not in visibility.choices(method):
            return cls(initial={"visibility": method.visibility, "reveal_on": _day(method.reveal_at)})
        return cls({"visibility": chosen, "reveal_on": request.GET.get("reveal_on", "")})

    def wanted(self, *, now: datetime) -> dict[str, Any]:
        """What was chosen, under the verb's names. Raises `Refused`."""
        if not self.is_valid():
            raise Refused("bad-value", "The form cannot be read.")
        fields = self.cleaned_data
        is_anonymous = fields["visibility"] == Visibility.ANONYMOUS
        return {
            "visibility": fields["visibility"],
            "reveal_at": _moment(fields["reveal_on"]) if is_anonymous else None,
        }

    def refuse(self, refusal: Refused) -> None:
        """Put the verb's sentence at the field that it is about."""
        field = {"reveal_at": "reveal_on"}.get(refusal.field, refusal.field)
        super().refuse(Refused(refusal.code, str(refusal), field=field))

    def require_confirmation(self) -> None:
        """Raise `Refused` for somebody who has not said that they know."""
        if not self.cleaned_data["confirm"]:
            raise Refused(
                "not-confirmed",
                "You have not confirmed that it cannot be taken back; expected a tick.",
                field="confirm",
            )


def _day(moment: datetime | None) -> str:
    return f"{moment:%Y-%m-%d}" if moment else ""


def _moment(text: str) -> datetime | None:
    """The beginning of a day."""
    if not text.strip():
        return None
    try:
        return datetime.fromisoformat(text.strip()[:10]).replace(tzinfo=UTC)
    except ValueError:
        raise Refused(
            "bad-value",
            f"The field 'reveal_on' is {text[:60]!r}; expected a date such as 2027-03-01.",
            field="reveal_on",
        ) from None
