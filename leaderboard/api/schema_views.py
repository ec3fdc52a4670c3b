"""The API's schema, made once by each process: describing every operation takes a fifth of a second."""

from functools import cache
from typing import Any

from django.http import HttpResponse
from drf_spectacular.generators import SchemaGenerator
from drf_spectacular.utils import extend_schema
from drf_spectacular.views import SpectacularAPIView
from rest_framework.permissions import AllowAny
from rest_framework.renderers import BaseRenderer
from rest_framework.request import Request
from rest_framework.response import Response

from leaderboard.api.parsers import UniformJSONRenderer


class SchemaView(SpectacularAPIView):
    """The schema as OpenAPI 3.1, as YAML or as JSON. It is the same for everybody."""

    permission_classes = [AllowAny]

    @extend_schema(exclude=True)
    def get(self, request: Request, *args: Any, **kwargs: Any) -> HttpResponse:
        """The whole of it, in the form that the request accepts."""
        renderer: BaseRenderer = request.accepted_renderer
        return HttpResponse(
            _written(renderer.media_type),
            content_type=f"{renderer.media_type}; charset=utf-8",
            headers={"Content-Disposition": f'inline; filename="tsttc-openapi.{renderer.format}"'},
        )

    def handle_exception(self, exc: Exception) -> Response:
        """A problem document is JSON whatever form of the schema the request accepts."""
        self.request.accepted_renderer = UniformJSONRenderer()
        return super().handle_exception(exc)


@cache
def _written(media_type: str) -> bytes:
    renderer = next(kind for kind in SchemaView.renderer_classes if kind.media_type == media_type)
    text = renderer().render(SchemaGenerator().get_schema(request=None, public=True), renderer_context={})
    return text.encode() if isinstance(text, str) else text
