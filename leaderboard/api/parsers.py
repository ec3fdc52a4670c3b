"""The parsers and the renderer of the API. A request that gives a field twice is refused."""

import io
import json
from collections.abc import Mapping
from typing import IO, Any, Final

from django.conf import settings
from rest_framework import exceptions
from rest_framework.parsers import DataAndFiles, JSONParser, MultiPartParser
from rest_framework.renderers import JSONRenderer

from leaderboard.errors.refusals import Refused

MAX_BYTES: Final = 100_000
"""All details of a method take a third of it, even with every character escaped."""


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
            raise _doubled(name, n_given=sum(name == other for other, _ in pairs))
        seen.add(name)


def _doubled(name: str, *, n_given: int) -> Refused:
    sentence = f"The request has the field {name[:60]!r} {n_given} times; expected it once."
    return Refused("doubled-field", sentence, field=name[:60])


class SingleMultiPartParser(MultiPartParser):
    """A multipart form in which each field comes once, as a text or a file."""

    def parse(
        self,
        stream: IO[Any],
        media_type: str | None = None,
        parser_context: Mapping[str, Any] | None = None,
    ) -> "DataAndFiles[Any, Any]":
        parsed = super().parse(stream, media_type, parser_context)
        for name in [*parsed.data, *parsed.files]:
            n_given = len(parsed.data.getlist(name)) + len(parsed.files.getlist(name))
            if n_given > 1:
                for _, files in parsed.files.lists():  # Django closes those of the requests that it knows
                    for file in files:
                        file.close()
                raise _doubled(name, n_given=n_given)
        return parsed


class UniformJSONRenderer(JSONRenderer):
    # Responses are cached for all clients, whatever indent `Accept` names.
    def get_indent(self, accepted_media_type: str, renderer_context: Mapping[str, Any]) -> None:
        pass
