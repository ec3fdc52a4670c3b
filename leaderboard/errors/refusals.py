"""The refusal of a request; texts of people, cleaned or refused."""

import unicodedata

from django.core.exceptions import ValidationError
from django.core.validators import URLValidator

from leaderboard.models import Split, User

_is_web_address = URLValidator(schemes=["http", "https"])
MAX_URL = 500
# Of how many characters one may be composed. Normalizing takes time that grows with the square of a run of
# marks, so a text that is too long in any case is refused before.
_MOST_COMPOSED = 4


class Refused(Exception):
    """A request is refused. `field` is the input at fault, `code` is stable, `advice` is shown in forms."""

    def __init__(self, code: str, message: str, *, field: str = "", advice: str = "") -> None:
        super().__init__(message)
        self.code = code
        self.field = field
        self.advice = advice


def doubled_field(name: str, *, n_given: int) -> Refused:
    """Make the refusal of a request that gives a field more than once: only one of them would count."""
    name = name[:60]
    sentence = f"The request has the field {name!r} {n_given} times; expected it once."
    return Refused("doubled-field", sentence, field=name)


class NotMaintainer(Exception):
    """The actor is no maintainer."""


def require_maintainer(actor: User | None, *, to: str) -> None:
    """Raise `NotMaintainer` for other actors; None is the command line. `to` ends "Only maintainers may"."""
    if actor is not None and not actor.acts_as_maintainer:
        raise NotMaintainer(f"Only maintainers may {to}.")


def shown_split(name: str) -> Split:
    """Return the split of that name, with its published edition and ground truth. Raises `Refused`."""
    # Looked up here and not there: not every text is one that a database can be asked for.
    rows = Split.objects.shown().select_related("current_edition__ground_truth")
    splits = {split.name: split for split in rows}
    if name not in splits:
        sentence = f"There is no split {name[:80]!r}; expected one of {', '.join(splits)}."
        raise Refused("unknown-split", sentence, field="split")
    return splits[name]


# They change the order in which everything after them is read, beyond the end of the text.
BIDI_CONTROLS = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def clean_text(name: str, text: str, *, limit: int, required: bool = True) -> str:
    """Strip a text. Raises `Refused` for control characters, excess or absence."""
    text = text.strip()
    if len(text) <= _MOST_COMPOSED * limit:
        text = unicodedata.normalize("NFC", text).strip()
    if required and not text:
        raise Refused("missing-field", f"The field '{name}' is empty; expected a text.", field=name)
    if len(text) > limit:
        raise Refused(
            "text-too-long",
            f"The field '{name}' has {len(text)} characters; expected at most {limit}.",
            field=name,
        )
    for character in text:
        is_control = unicodedata.category(character) in {"Cc", "Cs", "Co", "Cn"}
        if (is_control and character not in "\r\n\t") or character in BIDI_CONTROLS:
            raise _bad_character(name, character)
    return text


def _bad_character(name: str, character: str) -> Refused:
    return Refused(
        "bad-character",
        f"The field '{name}' has the character U+{ord(character):04X}; expected printable text.",
        field=name,
    )


def clean_url(name: str, text: str) -> str:
    """Check an address of the web; it may be empty. Raises `Refused`."""
    text = clean_text(name, text, limit=MAX_URL, required=False)
    for character in text:
        # Nobody sees them, and two addresses would look the same.
        if unicodedata.category(character) in {"Cf", "Zl", "Zp"}:
            raise _bad_character(name, character)
    if text:
        try:
            _is_web_address(text)
        except ValidationError:
            raise Refused(
                "bad-address",
                f"The field '{name}' is {text[:80]!r}; expected an address that begins with http:// or https://.",
                field=name,
            ) from None
    return text
