"""The base of all forms: filled from a request, refused in the words of the domain function."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, Self
from urllib.parse import urlencode

from django import forms
from django.http import HttpRequest

from leaderboard.errors.refusals import Refused

_ADDRESS: Final = {"placeholder": "https://", "maxlength": 500}


class SiteForm(forms.Form):
    """A form of the site. Most checks are left to the function that the form is for."""

    @classmethod
    def asked(cls, request: HttpRequest, **options: Any) -> Self:
        """The form with what this request sends; with its initial values when it only asks for it."""
        return cls(request.POST if request.method == "POST" else None, **options)

    def refuse(self, refusal: Exception) -> None:
        """Put the advice, or else the sentence, at the field that it is about, if it is one of these."""
        field = getattr(refusal, "field", "")
        if field in self.fields:
            self.add_error(field, getattr(refusal, "advice", "") or str(refusal))
        else:
            self.add_error(None, str(refusal))

    @contextmanager
    def refusals(self) -> Iterator[None]:
        """Put the sentence of a `Refused` on the form."""
        try:
            yield
        except Refused as refusal:
            self.refuse(refusal)

    def query(self, **more: Any) -> str:
        """The values that are given as the query of an address, with `more` in it."""
        asked = {**self.cleaned_data, **more}
        return urlencode({name: str(value) for name, value in asked.items() if value})


class DescriptionForm(SiteForm):
    """The description of a method and its links."""

    description = forms.CharField(
        required=False,
        help_text="One or two sentences: what the method does and which inputs it uses.",
        widget=forms.Textarea(attrs={"rows": 4, "maxlength": 2000}),
    )
    paper_url = forms.CharField(label="Paper", required=False, widget=forms.URLInput(attrs=_ADDRESS))
    code_url = forms.CharField(label="Code", required=False, widget=forms.URLInput(attrs=_ADDRESS))
