"""The parser and renderer of JSON."""

import io
from collections.abc import Mapping
from typing import IO, Any, Final

from rest_framework import exceptions
from rest_framework.parsers import JSONParser
from rest_framework.renderers import JSONRenderer

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
            return super().parse(io.BytesIO(data), media_type, parser_context)
        except RecursionError:
            raise exceptions.ParseError("JSON parse error - nested too deeply") from None


class UniformJSONRenderer(JSONRenderer):
    # Responses are cached for all clients, whatever indent `Accept` names.
    def get_indent(self, accepted_media_type: str, renderer_context: Mapping[str, Any]) -> None:
        pass
