"""Editions: history for everybody, progress and preview for maintainers."""

from django.shortcuts import get_object_or_404
from drf_spectacular.utils import extend_schema
from rest_framework.permissions import AllowAny, IsAdminUser
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api import pagination
from leaderboard.api.edition_serializers import (
    EditionSerializer,
    PreviewSerializer,
    PublicationSerializer,
    RescoringSerializer,
)
from leaderboard.api.schema import errors
from leaderboard.editions import corrections, preview
from leaderboard.models import Edition, Publication, Split

EDITIONS = Edition.objects.select_related("split__published_edition", "ground_truth")


class EditionsView(APIView):
    """All editions that were ever published."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="list_editions",
        parameters=pagination.PARAMETERS,
        responses={200: EditionSerializer(many=True), **errors(404)},
    )
    def get(self, request: Request, split: str) -> Response:
        """Published editions, newest first, in pages; `Link` names the next page."""
        get_object_or_404(Split.objects.shown(), pk=split)
        rows = EDITIONS.filter(split=split).exclude(published_at=None)
        page = pagination.page_of(rows, request, order="-number")
        data = EditionSerializer(page.rows, many=True).data  # type: ignore[arg-type]  # many rows, as it says
        return Response(data, headers=page.headers)


class ChangelogView(APIView):
    """The public changelog of a split."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="changelog",
        parameters=pagination.PARAMETERS,
        responses={200: PublicationSerializer(many=True), **errors(404)},
    )
    def get(self, request: Request, split: str) -> Response:
        """Which edition was published when and why; newest first, in pages."""
        get_object_or_404(Split.objects.shown(), pk=split)
        rows = Publication.objects.filter(split=split).select_related("edition", "replaced")
        page = pagination.page_of(rows, request, order="-at")
        data = PublicationSerializer(page.rows, many=True).data  # type: ignore[arg-type]  # many rows, as it says
        return Response(data, headers=page.headers)


class ProgressView(APIView):
    """Progress of the re-scoring of an edition; for maintainers."""

    permission_classes = [IsAdminUser]

    @extend_schema(operation_id="edition_progress", responses={200: RescoringSerializer, **errors(404)})
    def get(self, request: Request, split: str, number: int) -> Response:
        """Counts, rate and remaining time. For maintainers."""
        edition = get_object_or_404(EDITIONS, split=split, number=number)
        return Response(RescoringSerializer(corrections.progress(edition)).data)


class PreviewView(APIView):
    """What publishing an edition would change; for maintainers."""

    permission_classes = [IsAdminUser]

    @extend_schema(operation_id="edition_preview", responses={200: PreviewSerializer, **errors(404)})
    def get(self, request: Request, split: str, number: int) -> Response:
        """Totals, and one row for each submission. For maintainers."""
        edition = get_object_or_404(EDITIONS, split=split, number=number)
        return Response(PreviewSerializer(preview.preview(edition)).data)
