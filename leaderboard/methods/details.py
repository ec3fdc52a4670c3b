"""The registry of method details: forms, filters, API, exports and pages follow from its rows.

Free texts of an anonymous method are hidden.
"""

import math
import re
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any, ClassVar, Final, NamedTuple

from django.db.models import TextChoices

from leaderboard.errors.refusals import Refused, clean_text
from leaderboard.models import BoxSource, Cameras, Method

MAX_MEASURED: Final = 1e9
MAX_FILTER_TEXT: Final = 80
_COUNT: Final = re.compile(
    r"((?:[0-9]{1,3}(?:,[0-9]{3})+|[0-9]{1,16})(?:\.[0-9]{1,15})?) ?([kmb]?)", re.ASCII | re.IGNORECASE
)
_TIMES: Final = {"": 1, "k": 10**3, "m": 10**6, "b": 10**9}

Details = Mapping[str, Any]
"""A method's details by name: each of the registry, an empty text or None where it is not specified."""


def bad_value(name: str, given: object, expected: str, *, advice: str = "") -> Refused:
    message = f"The field '{name}' is {str(given)[:60]!r}; expected {expected}."
    return Refused("bad-value", message, field=name, advice=advice)


def text_of(name: str, value: object) -> str:
    """Return a text; None becomes empty. Raises `Refused`."""
    if value is None:
        return ""
    if not isinstance(value, str):
        raise bad_value(name, value, "a text")
    return value


# --- kinds of values -------------------------------------------------------------------------------------


class Option(NamedTuple):
    """A choice: in forms and addresses, as stored, and in words."""

    text: str
    value: object
    words: str


@dataclass(frozen=True, kw_only=True)
class Kind:
    """The values that a detail can have, and how a filter compares them."""

    is_free_text: ClassVar[bool] = True  # unless a kind denies it: then others see it of an anonymous method
    filter_label: ClassVar[str] = "{}"  # around the detail's own
    type: type
    expected: str = ""  # of a value, in words
    advice: str = ""  # the same for whoever fills in a form
    takes: str  # of a filter's value, in words
    options: tuple[Option, ...] = ()  # none where the value is typed
    limits: Mapping[str, Any] = field(default_factory=dict)  # by the names that a serializer's field has

    @property
    def empty(self) -> str | None:
        """Return the value of a detail that is not specified."""
        return "" if self.type is str else None

    def clean(self, name: str, value: object) -> Any:
        """Convert a text or a JSON value; `name` is the field's. Raises `Refused`."""
        if value is None or value == "":
            return self.empty
        try:
            return self.read(value)
        except (ValueError, OverflowError):
            raise bad_value(name, value, self.expected, advice=self.advice) from None

    def read(self, value: object) -> Any:
        """Convert a value that is not empty. Raises `ValueError`."""
        raise NotImplementedError

    def words(self, value: Any) -> str:
        return str(value)

    def wanted(self, text: str) -> Any:
        """Convert the text of a filter. Raises `ValueError`."""
        raise NotImplementedError

    def admits(self, wanted: Any, stated: Any) -> bool:
        """Tell whether a stated value passes the filter."""
        return bool(wanted == stated)


class Listed(Kind):
    """A choice of a few values; a filter asks for one."""

    is_free_text = False

    def read(self, value: object) -> Any:
        for option in self.options:
            if value == option.text or (value == option.value and type(value) is self.type):
                return option.value
        raise ValueError(value)

    def words(self, value: Any) -> str:
        return next(option.words for option in self.options if option.value == value)

    def wanted(self, text: str) -> Any:
        return self.read(next((each.text for each in self.options if each.text.lower() == text.lower()), ""))


class Number(Kind):
    """A number; a filter asks for at most this."""

    is_free_text = False
    filter_label = "Max {}"

    def admits(self, wanted: Any, stated: Any) -> bool:
        return stated is not None and stated <= wanted


class Whole(Number):
    """A whole number, as 25000000 or as 25M."""

    def read(self, value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, str | int):
            raise ValueError(value)
        number = count_of(value) if isinstance(value, str) else value
        if number != int(number) or not self.limits["min_value"] <= number <= self.limits["max_value"]:
            raise ValueError(value)
        return int(number)

    def words(self, value: Any) -> str:
        return f"{value:,}"

    def wanted(self, text: str) -> int:
        value = int(count_of(text))
        if not value:
            raise ValueError(text)
        return value


class Measured(Number):
    """A finite number above 0."""

    def read(self, value: object) -> float:
        number = self.wanted(value)
        if number > MAX_MEASURED:
            raise ValueError(value)
        return number

    def words(self, value: Any) -> str:
        return f"{value:g}"

    def wanted(self, text: object) -> float:
        if isinstance(text, bool) or not isinstance(text, str | int | float):
            raise ValueError(text)
        number = float(text)
        if not math.isfinite(number) or number <= 0:
            raise ValueError(text)
        return number


class FreeText(Kind):
    """Free text; a filter asks for a part of it, in any case."""

    filter_label = "{} contains"

    def clean(self, name: str, value: object) -> str:
        return clean_text(name, text_of(name, value), limit=self.limits["max_length"], required=False)

    def wanted(self, text: str) -> str:
        return _folded(text)

    def admits(self, wanted: Any, stated: Any) -> bool:
        return wanted in _folded(stated)


def count_of(text: str) -> Decimal:
    """Parse a number like 25M. Raises `ValueError`.

    >>> [int(count_of(text)) for text in ("25M", "25,000,000", "0.4 m", "7")]
    [25000000, 25000000, 400000, 7]
    """
    match = _COUNT.fullmatch(text.strip())
    if match is None:
        raise ValueError(text)
    return Decimal(match[1].replace(",", "")) * _TIMES[match[2].lower()]


def _folded(text: str) -> str:
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def _listed(type_: type, options: Iterable[Option], *, expected: str, **limits: Any) -> Listed:
    listed = tuple(options)
    takes = f"one of {', '.join(option.text.lower() for option in listed)}"
    return Listed(type=type_, options=listed, expected=f"{expected} or nothing", takes=takes, limits=limits)


def choice(choices: type[TextChoices]) -> Listed:
    options = (Option(str(each.value), str(each.value), str(each.label)) for each in choices)
    return _listed(str, options, expected=f"one of {', '.join(choices.values)},", choices=choices.choices)


def few(low: int, high: int) -> Listed:
    options = (Option(str(n), n, str(n)) for n in range(low, high + 1))
    expected = f"a whole number from {low} to {high},"
    return _listed(int, options, expected=expected, min_value=low, max_value=high)


YES_NO: Final = _listed(bool, (Option("yes", True, "yes"), Option("no", False, "no")), expected="yes, no")


def whole(low: int, high: int) -> Whole:
    return Whole(
        type=int,
        limits={"min_value": low, "max_value": high},
        expected=f"a whole number from {low:,} to {high:,}, such as 25000000 or 25M, or nothing",
        advice="Enter a whole number, e.g. 25,000,000 or 25M.",
        takes="a number above 0, such as 25M (million), 400k or 25000000",
    )


def measured(unit: str) -> Measured:
    """Make the kind of a number with a unit, named in the plural."""
    return Measured(
        type=float,
        expected=f"{unit} above 0, or nothing",
        advice=f"Enter a number of {unit} above 0, e.g. 12.5.",
        takes=f"a number of {unit} above 0",
    )


def free_text(limit: int) -> FreeText:
    takes = f"a text of at most {MAX_FILTER_TEXT} characters, whatever the case"
    return FreeText(type=str, limits={"max_length": limit}, takes=takes)


# --- the registry ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Detail:
    """A detail; `name` is the field of `Method` and of the API, `filter` the parameter of addresses."""

    name: str
    kind: Kind
    label: str
    help: str  # for whoever fills it in, and for whoever reads it in a program
    filter: str
    example: Any
    filter_example: str = ""
    chip: str = ""  # around a value that stands alone, as "{} frames"; of yes or no the noun
    is_in_row: bool = False  # a row of a board shows it

    def words_alone(self, value: Any) -> str:
        """Word a value so that it needs no label."""
        if self.kind is YES_NO and self.chip:
            return self.chip if value else f"no {self.chip}"
        return (self.chip or f"{self.label}: {{}}").format(self.kind.words(value))

    @property
    def filter_label(self) -> str:
        """Return the label of the filter, as "Max latency (ms)"."""
        around = self.kind.filter_label
        return around.format(self.label if around.startswith("{") else self.label.lower())

    @property
    def meaning(self) -> str:
        """Describe the field for the API's schema."""
        values = [value for value, _ in self.kind.limits.get("choices", ())]
        one_of = f" One of {', '.join(values)}." if values else ""
        empty = "Null" if self.kind.empty is None else "Empty"
        masked = ", or the method is anonymous" if self.kind.is_free_text else ""
        return f"{self.help}{one_of} {empty}: not specified{masked}."


DETAILS: tuple[Detail, ...] = (
    Detail(
        name="n_frames",
        kind=few(2, 6),
        label="Frames used",
        help="How many frames each prediction uses.",
        filter="frames",
        example=6,
        chip="{} frames",
        is_in_row=True,
    ),
    Detail(
        name="cameras",
        kind=choice(Cameras),
        label="Cameras",
        help="How many cameras the method uses.",
        filter="cameras",
        example="ONE",
        chip="{}",
        is_in_row=True,
    ),
    Detail(
        name="box_source",
        kind=choice(BoxSource),
        label="Bounding boxes",
        help="Where the object boxes come from.",
        filter="boxes",
        example="GIVEN",
        chip="boxes: {}",
    ),
    Detail(
        name="uses_nerf",
        kind=YES_NO,
        label="NeRF-augmented data",
        help="Trained with the NeRF-rendered sequences?",
        filter="nerf",
        example=False,
        chip="NeRF",
        is_in_row=True,
    ),
    Detail(
        name="uses_extra_data",
        kind=YES_NO,
        label="External training data",
        help="Trained with data other than this dataset?",
        filter="extra",
        example=False,
        chip="external data",
    ),
    Detail(
        name="pretraining",
        kind=free_text(200),
        label="Pretraining",
        help="Dataset of the pretrained weights.",
        filter="pretraining",
        example="ImageNet",
        chip="pretrained on {}",
    ),
    Detail(
        name="n_parameters",
        kind=whole(1, 10**15),
        label="Parameters",
        help="Number of weights of the whole model.",
        filter="parameters",
        example=25_000_000,
        filter_example="25M",
        chip="{} parameters",
    ),
    Detail(
        name="latency_ms",
        kind=measured("milliseconds"),
        label="Latency (ms)",
        help="Milliseconds per prediction.",
        filter="latency",
        example=12.5,
        chip="{} ms latency",
    ),
    Detail(
        name="hardware",
        kind=free_text(120),
        label="Hardware",
        help="Machine on which the latency was measured.",
        filter="hardware",
        example="one RTX 4090",
        chip="{}",
    ),
)


def stated(**values: Any) -> Details:
    """Return all details, empty but for these values."""
    return {detail.name: values.get(detail.name, detail.kind.empty) for detail in DETAILS}


def details_of(method: Method, *, is_masked: bool = False) -> Details:
    """Return the details of a method; masked: without free texts."""
    shown = (each.name for each in DETAILS if not (is_masked and each.kind.is_free_text))
    return stated(**{name: getattr(method, name) for name in shown})


def words(details: Details) -> tuple[tuple[str, str], ...]:
    """Return label and words of each specified detail."""
    return tuple(
        (each.label, each.kind.words(details[each.name]))
        for each in DETAILS
        if details[each.name] != each.kind.empty
    )


def chips(details: Details, *, of_row: bool = False) -> tuple[tuple[str, str], ...]:
    """Return label and words of each specified detail, short; of a row not what is answered with no.

    >>> chips(stated(n_frames=2, uses_nerf=False, latency_ms=5.7))
    (('Frames used', '2 frames'), ('NeRF-augmented data', 'no NeRF'), ('Latency (ms)', '5.7 ms latency'))
    >>> chips(stated(n_frames=2, uses_nerf=False, latency_ms=5.7), of_row=True)
    (('Frames used', '2 frames'),)
    """
    return tuple(
        (each.label, each.words_alone(details[each.name]))
        for each in DETAILS
        if details[each.name] != each.kind.empty
        if not of_row or (each.is_in_row and details[each.name] is not False)
    )
