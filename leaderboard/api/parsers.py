"""JSON that programs send and get: read so that no document makes the reader fail, written in one form."""

import io
from collections.abc import Mapping
from typing import IO, Any, Final

from rest_framework import exceptions
from rest_framework.parsers import JSONParser
from rest_framework.renderers import JSONRenderer

MAX_BYTES: Final = 100_000
"""Everything that can be said of a method takes a third of it, even with every character escaped."""


class TooLarge(exceptions.APIException):
    """The document is larger than anything that is asked for."""

    status_code = 413
    default_code = "too_large"
    default_detail = f"The document is too large; expected at most {MAX_BYTES:,} bytes."


class DocumentParser(JSONParser):
    """JSON as the framework reads it; one that is nested too deeply is malformed like any other.

    Its size is limited as well: as Python's objects a document can take thirty times its bytes.
    """

    def parse(
        self,
        stream: IO[Any],
        media_type: str | None = None,
        parser_context: Mapping[str, Any] | None = None,
    ) -> Any:
        """The document. Raises `ParseError` or `TooLarge`."""
        data = stream.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise TooLarge
        try:
            return super().parse(io.BytesIO(data), media_type, parser_context)
        except RecursionError:
            raise exceptions.ParseError("JSON parse error - nested too deeply") from None


class DocumentRenderer(JSONRenderer):
    """JSON in one form, whatever `Accept` says of its indent: one reader's answer is kept for the others."""

    def get_indent(self, accepted_media_type: str, renderer_context: Mapping[str, Any]) -> None:
        """None ever."""
