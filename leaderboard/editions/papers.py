"""Documents of published results (`docs/maintainers.md`), read with the place of every fault."""

import json
import math
import re
import unicodedata
from collections.abc import Collection, Iterator, Mapping
from datetime import datetime
from typing import Any, Final

from django.core.exceptions import ValidationError
from django.core.validators import URLValidator

from evaluator.counting import file_size
from evaluator.metrics.protocol import PROTOCOLS, SCORE_NAMES
from leaderboard.errors.refusals import BIDI_CONTROLS, Refused

MAX_BYTES: Final = 1_000_000
MAX_PROBLEMS: Final = 20
_SLUG: Final = re.compile(r"[a-z0-9][a-z0-9-]{0,63}", re.ASCII)
# How long a text may be, as the columns of `PublishedResult` are.
_LIMITS: Final = {"title": 300, "authors": 300, "table": 200, "url": 200, "code": 200, "hardware": 120}
_MAX_NAME, _MAX_DESCRIPTION = 80, 2000
_MAX_LATENCY_MS: Final = 1e9
_is_web_address = URLValidator(schemes=["http", "https"])


class BadDocument(Refused):
    """All faults of a document, each sentence after its place."""

    def __init__(self, problems: list[str]) -> None:
        left_out = len(problems) - MAX_PROBLEMS
        shown = problems[:MAX_PROBLEMS] + ([f"… and {left_out} more"] if left_out > 0 else [])
        super().__init__("bad-value", "\n".join(shown), field="file")
        self.problems = tuple(shown)


def parse(data: bytes) -> dict[str, Any]:
    """Parse a document of JSON. Raises `BadDocument`."""
    if len(data) > MAX_BYTES:
        raise BadDocument([f"The file has {file_size(len(data))}; expected at most {file_size(MAX_BYTES)}."])
    try:
        document = json.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise BadDocument([f"byte {error.start + 1}: not UTF-8; expected JSON in UTF-8."]) from None
    except json.JSONDecodeError as error:
        at = f"line {error.lineno}, column {error.colno}"
        raise BadDocument([f"{at}: no JSON ({error.msg}); expected a JSON object."]) from None
    except (RecursionError, ValueError):
        raise BadDocument(["The file has numbers or lists that are too long to read."]) from None
    if not isinstance(document, dict):
        raise BadDocument(
            [f"/: {_kind(document)}; expected an object with source, columns, methods, results."]
        )
    return document


def rows_of(document: Mapping[str, Any], *, splits: Collection[str], now: datetime) -> list[dict[str, Any]]:
    """Convert a document into columns of `PublishedResult`. Raises `BadDocument`."""
    problems = list(_problems(document, splits, latest_year=now.year + 1))
    if problems:
        raise BadDocument(problems)
    source = document["source"]
    methods = {method["slug"]: method for method in document["methods"]}
    return [
        {
            "split_id": split,
            "slug": slug,
            "method_name": methods[slug]["name"],
            "description": methods[slug].get("description", ""),
            "authors": source["authors"],
            "source_title": source["title"],
            "source_url": source["url"],
            "source_table": source["table"],
            "code_url": source.get("code", ""),
            "year": source["year"],
            "uses_nerf": methods[slug].get("uses_nerf", False),
            "latency_ms": methods[slug].get("latency_ms"),
            "hardware": methods[slug].get("hardware", ""),
            "scores": dict(zip(document["columns"], values, strict=True)),
        }
        for split, rows in document["results"].items()
        for slug, values in rows.items()
    ]


# --- what can be wrong -----------------------------------------------------------------------------------


def _problems(document: Mapping[str, Any], splits: Collection[str], *, latest_year: int) -> Iterator[str]:
    kinds = {"source": dict, "columns": list, "methods": list, "results": dict}
    sound = [name for name, kind in kinds.items() if isinstance(document.get(name), kind)]
    for name, kind in kinds.items():
        if name not in sound:
            expected = "an object" if kind is dict else "a list"
            yield f"/{name}: {_kind_at(document, name)}; expected {expected}."
    if "source" in sound:
        yield from _of_source(document["source"], latest_year=latest_year)
    columns = document["columns"] if "columns" in sound else None
    if columns is not None and not _are_columns(columns):
        names = ", ".join(SCORE_NAMES)
        yield f"/columns: not the scores of a protocol, each once; expected {names}."
    if "methods" in sound:
        for i, method in enumerate(document["methods"]):
            yield from _of_method(method, f"/methods/{i}")
        yield from _twice(document["methods"])
    if len(sound) == len(kinds):
        yield from _of_results(document, splits)


def _of_source(source: Mapping[str, Any], *, latest_year: int) -> Iterator[str]:
    for name in ("title", "authors", "table"):
        yield from _text(source, name, "/source", limit=_LIMITS[name])
    yield from _text(source, "url", "/source", limit=_LIMITS["url"], is_address=True)
    yield from _text(source, "code", "/source", limit=_LIMITS["code"], is_address=True, is_required=False)
    year = source.get("year")
    if isinstance(year, bool) or not isinstance(year, int) or not 1950 <= year <= latest_year:
        # A paper in print may have the year after this one.
        yield f"/source/year: {_kind_at(source, 'year')}; expected a year from 1950 to {latest_year}."


def _of_method(method: Any, where: str) -> Iterator[str]:
    if not isinstance(method, dict):
        yield f"{where}: {_kind(method)}; expected an object with slug and name."
        return
    slug = method.get("slug")
    if not isinstance(slug, str) or not _SLUG.fullmatch(slug):
        kind = _kind_at(method, "slug")
        yield f"{where}/slug: {kind}; expected small letters, digits and hyphens, at most 64."
    yield from _text(method, "name", where, limit=_MAX_NAME)
    yield from _text(method, "description", where, limit=_MAX_DESCRIPTION, is_required=False)
    yield from _text(method, "hardware", where, limit=_LIMITS["hardware"], is_required=False)
    if not isinstance(method.get("uses_nerf", False), bool):
        yield f"{where}/uses_nerf: {_kind_at(method, 'uses_nerf')}; expected true or false."
    latency_ms = method.get("latency_ms")
    if latency_ms is not None and not (_is_number(latency_ms) and 0 < latency_ms < _MAX_LATENCY_MS):
        yield f"{where}/latency_ms: {_kind_at(method, 'latency_ms')}; expected milliseconds above 0, or null."
    elif latency_ms is not None and not method.get("hardware"):
        yield f"{where}/hardware: nothing; expected what the latency was measured on."


def _twice(methods: list[Any]) -> Iterator[str]:
    seen: set[object] = set()
    for i, method in enumerate(methods):
        slug = method.get("slug") if isinstance(method, dict) else None
        if isinstance(slug, str) and slug in seen:
            yield f"/methods/{i}/slug: {slug!r} a second time; expected each slug once."
        seen |= {slug} if isinstance(slug, str) else set()


def _of_results(document: Mapping[str, Any], splits: Collection[str]) -> Iterator[str]:
    slugs = [method.get("slug") for method in document["methods"] if isinstance(method, dict)]
    n_columns = len(document["columns"])
    n_rows = 0
    for split, rows in document["results"].items():
        where = f"/results/{split[:40]}"
        if split not in splits:
            yield f"{where}: no split of this site; expected one of {', '.join(splits)}."
        if not isinstance(rows, dict):
            yield f"{where}: {_kind(rows)}; expected an object with a list of values for each method."
            continue
        for slug, values in rows.items():
            n_rows += 1
            yield from _of_row(slug, values, f"{where}/{slug[:64]}", slugs=slugs, n_columns=n_columns)
    if not n_rows:
        yield "/results: no rows; expected at least one."


def _of_row(
    slug: str, values: Any, where: str, *, slugs: Collection[object], n_columns: int
) -> Iterator[str]:
    if slug not in slugs:
        yield f"{where}: no method of this slug under /methods; expected one of those there."
    if not isinstance(values, list) or len(values) != n_columns:
        length = f"{len(values)} values" if isinstance(values, list) else _kind(values)
        yield f"{where}: {length}; expected a list of {n_columns}, one for each of the columns."
        return
    for i, value in enumerate(values):
        if value is not None and not (_is_number(value) and value >= 0):
            expected = "a number from 0, or null where the paper prints none"
            yield f"{where}/{i}: {_kind(value)}; expected {expected}."


def _text(
    holder: Mapping[str, Any],
    name: str,
    where: str,
    *,
    limit: int,
    is_address: bool = False,
    is_required: bool = True,
) -> Iterator[str]:
    text = holder.get(name, "")
    if not isinstance(text, str) or (is_required and not text.strip()):
        yield f"{where}/{name}: {_kind_at(holder, name)}; expected a text."
    elif len(text) > limit:
        yield f"{where}/{name}: {len(text)} characters; expected at most {limit}."
    elif any(_is_unprintable(character) for character in text):
        yield f"{where}/{name}: a character that cannot be printed; expected printable text."
    elif is_address and text:
        try:
            _is_web_address(text)
        except ValidationError:
            yield f"{where}/{name}: {text[:60]!r}; expected an address that begins with http:// or https://."


def _is_unprintable(character: str) -> bool:
    is_control = unicodedata.category(character) in {"Cc", "Cs"} and character not in "\r\n\t"
    return is_control or character in BIDI_CONTROLS


def _are_columns(columns: list[Any]) -> bool:
    return all(isinstance(name, str) for name in columns) and any(
        sorted(columns) == sorted(protocol.score_names) for protocol in PROTOCOLS.values()
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -math.inf < value < math.inf


def _kind_at(holder: Mapping[str, Any], name: str) -> str:
    return _kind(holder[name]) if name in holder else "nothing"


def _kind(value: object) -> str:
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    return "null" if value is None else repr(value)[:60]
