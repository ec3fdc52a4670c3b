"""The benchmark that this installation serves: its names, texts, paper and dataset, read from a TOML file.

`settings.BENCHMARK` is the only source of them. One installation serves one benchmark.
"""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from django.core.exceptions import ImproperlyConfigured

from evaluator.papers.tables import published_tables

DEFAULT_PATH: Final = Path(__file__).with_name("benchmark.toml")
_STATIC: Final = Path(__file__).parents[1] / "static"
_BIBTEX: Final = re.compile(r"\s*@\w+\{([^\s,{}]+),")

Text = Annotated[str, msgspec.Meta(min_length=1)]
Address = Annotated[str, msgspec.Meta(pattern=r"^https?://\S+$")]
Size = tuple[int, int]
"""Width and height in px."""


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the file."""


class Landing(_Table, frozen=True):
    """The words with which the landing page begins; each of its facts is a number and what it counts."""

    heading: Text
    text: Text
    facts: tuple[tuple[Text, Text], ...] = ()


class Dataset(_Table, frozen=True):
    """The dataset; `code_url` is empty where there is no code.

    `hugging_face_id` is its `owner/name` on the Hugging Face Hub; `{split}` in the task is a split's name.
    """

    name: Text
    description: Text
    url: Address
    code_url: Address | None = None
    hugging_face_id: Annotated[str, msgspec.Meta(pattern=r"^[\w.-]+/[\w.-]+$")] | None = None
    hugging_face_task: Text = "{split}"


class Paper(_Table, frozen=True):
    """The paper. `has_tables`: its tables are those of `evaluator.papers`."""

    title: Text
    authors: Annotated[tuple[Text, ...], msgspec.Meta(min_length=1)]
    year: int
    url: Address
    bibtex: Text
    has_tables: bool = False

    @property
    def bibtex_key(self) -> str:
        """Return the key of the BibTeX entry; empty where `bibtex` is no entry."""
        match = _BIBTEX.match(self.bibtex)
        return match[1] if match else ""

    @property
    def reference(self) -> str:
        """Return authors, year, title and address as one line."""
        return f"{', '.join(self.authors)} ({self.year}). {self.title}. {self.url}"

    @property
    def bibtex_entry(self) -> str:
        """Return the BibTeX entry, one line break at its end."""
        return self.bibtex.strip() + "\n"


class Figure(_Table, frozen=True):
    """The figure of the task, as files below `static/`; `card` is the picture of links, 1200 × 630 px."""

    wide_light: Text
    wide_dark: Text
    wide_size: Size
    narrow_light: Text
    narrow_dark: Text
    narrow_size: Size
    alternative: Text
    card: Text


class FirstSplit(_Table, frozen=True):
    """A split that a new installation begins with. The quota of a hidden one is that of hidden splits."""

    name: Annotated[str, msgspec.Meta(pattern=r"^[a-z][a-z0-9-]{0,31}$")]
    title: Text
    description: str = ""
    is_hidden: bool = False
    is_simulated: bool = False
    quota_limit: Annotated[int, msgspec.Meta(ge=0)] | None = None


class Benchmark(_Table, frozen=True):
    """What pages, exports, API and mails say of the benchmark. `site_name` is empty only while it is read."""

    name: Text
    title: Text
    task: Text
    default_split: Text
    landing: Landing
    dataset: Dataset
    site_name: str = ""
    keywords: tuple[Text, ...] = ()
    baseline: Text = ""  # the beginning of its name on boards
    paper: Paper | None = None
    figure: Figure | None = None
    splits: tuple[FirstSplit, ...] = ()

    @property
    def description(self) -> str:
        """Return what search engines show of a page that has no description of its own."""
        return f"{self.site_name}: {self.dataset.description}"

    @property
    def summary(self) -> str:
        """Return the task, and what the site shows of it."""
        return f"{self.task} Ranked results with confidence intervals."

    @property
    def has_paper_tables(self) -> bool:
        """Tell whether the site shows the tables of the paper."""
        return self.paper is not None and self.paper.has_tables


def read(path: Path, *, site_name: str = "") -> Benchmark:
    """Read the benchmark of a file; `site_name` replaces the file's.

    Raises `ImproperlyConfigured` with the file, the key, what is there and what is expected.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ImproperlyConfigured(f"{path}: {error}; expected a TOML file in UTF-8.") from None
    try:
        benchmark = msgspec.convert(document, Benchmark)
    except msgspec.ValidationError as error:
        sentence, _, key = str(error).partition(" - at `$.")
        key = key.removesuffix("`")
        value: Any = document
        for part in re.findall(r"\w+", key):  # of a key such as splits[0].name
            value = value[int(part) if isinstance(value, list) else part]
        where = f"{path}: {key} is {value!r:.80}; " if key else f"{path}: "
        raise ImproperlyConfigured(f"{where}{sentence[:1].lower()}{sentence[1:]}.") from None
    for key, value, expected in _faults(benchmark):
        raise ImproperlyConfigured(f"{path}: {key} is {value!r}; expected {expected}.")
    name = site_name or benchmark.site_name or f"{benchmark.name} leaderboard"
    return msgspec.structs.replace(benchmark, site_name=name)


def _faults(benchmark: Benchmark) -> Iterator[tuple[str, object, str]]:
    """Yield each key that does not fit the others or the files, its value, and the expectation."""
    names = [split.name for split in benchmark.splits]
    if len(set(names)) < len(names):
        yield "splits", names, "each name once"
    if names and benchmark.default_split not in names:
        yield "default_split", benchmark.default_split, f"one of {', '.join(names)}"
    if benchmark.paper is not None and not benchmark.paper.bibtex_key:
        yield "paper.bibtex", benchmark.paper.bibtex[:60], "an entry such as @misc{key, …}"
    if benchmark.has_paper_tables:
        quoted = {row.split for table in published_tables().tables for row in table.rows if row.split}
        if missing := sorted(quoted.difference(names)):
            expected = f"false, or splits for the results of its tables, also {' and '.join(missing)}"
            yield "paper.has_tables", True, expected
    if benchmark.figure is not None:
        for key in ("wide_light", "wide_dark", "narrow_light", "narrow_dark", "card"):
            name = getattr(benchmark.figure, key)
            if not (_STATIC / name).is_file():
                yield f"figure.{key}", name, "a file below static/"
