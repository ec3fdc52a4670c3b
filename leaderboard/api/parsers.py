"""The parsers and the renderer of the API. A request that gives a field twice is refused."""

import io
import json
from collections.abc import Mapping
from typing import IO, Any, Final, cast

from django.conf import settings
from django.utils.http import parse_header_parameters
from rest_framework import exceptions
from rest_framework.parsers import DataAndFiles, JSONParser, MultiPartParser
from rest_framework.renderers import JSONRenderer

from leaderboard.errors.refusals import doubled_field

MAX_BYTES: Final = 100_000
"""All details of a method take a third of it, even with every character escaped."""


_MAX_END: Final = 1_000
CUT_OFF: Final = "The body ends before the last boundary of its form; expected a complete form."


class BodyTooLarge(exceptions.APIException):
    status_code = 413
    default_code = "too_large"
    default_detail = f"The document is too large; expected at most {MAX_BYTES:,} bytes."


class LimitedJSONParser(JSONParser):
    """JSON of limited size and depth: as Python objects a document can take thirty times its bytes."""

    def parse(
        self,
        stream: IO[Any],
        media_type: str | None = None,
        parser_context: Mapping[str, Any] | None = None,
    ) -> Any:
        data = stream.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise BodyTooLarge
        try:
            parsed = super().parse(io.BytesIO(data), media_type, parser_context)
            # Again, for the names: of two fields of one name, the parser above keeps the last.
            encoding = (parser_context or {}).get("encoding", settings.DEFAULT_CHARSET)
            json.loads(data.decode(encoding), object_pairs_hook=_require_once)
        except RecursionError:
            raise exceptions.ParseError("JSON parse error - nested too deeply") from None
        return parsed


def _require_once(pairs: list[tuple[str, Any]]) -> None:
    seen = set[str]()
    for name, _ in pairs:
        if name in seen:
            raise doubled_field(name, n_given=sum(name == other for other, _ in pairs))
        seen.add(name)


class _Body:
    """A body that is read once; it knows its end."""

    def __init__(self, stream: IO[Any]) -> None:
        self._stream, self._end = stream, b""

    def read(self, size: int = -1) -> bytes:
        data: bytes = self._stream.read(size)
        self._end = (self._end + data[-_MAX_END:])[-_MAX_END:]
        return data

    def is_complete(self, content_type: str) -> bool:
        """Say whether the body ends with the last boundary of a form; Django reads one without it, too."""
        boundary = parse_header_parameters(content_type)[1].get("boundary", "").encode("latin-1", "replace")
        return b"--" + boundary + b"--" in self._end


def _close_files(parsed: "DataAndFiles[Any, Any]") -> None:
    # Django closes those of the requests that it knows.
    for _, files in parsed.files.lists():
        for file in files:
            file.close()


class SingleMultiPartParser(MultiPartParser):
    """A multipart form in which each field comes once, as a text or a file."""

    def parse(
        self,
        stream: IO[Any],
        media_type: str | None = None,
        parser_context: Mapping[str, Any] | None = None,
    ) -> "DataAndFiles[Any, Any]":
        body = _Body(stream)
        parsed = super().parse(cast("IO[Any]", body), media_type, parser_context)
        if not body.is_complete(str(media_type)):
            _close_files(parsed)
            raise exceptions.ParseError(CUT_OFF)
        for name in [*parsed.data, *parsed.files]:
            n_given = len(parsed.data.getlist(name)) + len(parsed.files.getlist(name))
            if n_given > 1:
                _close_files(parsed)
                raise doubled_field(name, n_given=n_given)
        return parsed


class UniformJSONRenderer(JSONRenderer):
    # Responses are cached for all clients, whatever indent `Accept` names.
    def get_indent(self, accepted_media_type: str, renderer_context: Mapping[str, Any]) -> None:
        pass
