"""JSON that programs send and get: read so that no document makes the reader fail, written in one form."""

from collections.abc import Mapping
from typing import IO, Any

from rest_framework import exceptions
from rest_framework.parsers import JSONParser
from rest_framework.renderers import JSONRenderer


class DocumentParser(JSONParser):
    """JSON as the framework reads it; one that is nested too deeply is malformed like any other."""

    def parse(
        self,
        stream: IO[Any],
        media_type: str | None = None,
        parser_context: Mapping[str, Any] | None = None,
    ) -> Any:
        """The document. Raises `ParseError`."""
        try:
            return super().parse(stream, media_type, parser_context)
        except RecursionError:
            raise exceptions.ParseError("JSON parse error - nested too deeply") from None


class DocumentRenderer(JSONRenderer):
    """JSON in one form, whatever `Accept` says of its indent: one reader's answer is kept for the others."""

    def get_indent(self, accepted_media_type: str, renderer_context: Mapping[str, Any]) -> None:
        """None ever."""
