"""Editions over the API: history for everybody, progress and preview for maintainers."""

from django.shortcuts import get_object_or_404
from drf_spectacular.utils import extend_schema
from rest_framework.permissions import AllowAny, IsAdminUser
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import preview, rescoring
from leaderboard.api import listing
from leaderboard.api.serializers import (
    EditionSerializer,
    ErrorSerializer,
    PreviewSerializer,
    PublicationSerializer,
    RescoringSerializer,
)
from leaderboard.models import Edition, Publication, Split

NOT_FOUND = {(404, "application/problem+json"): ErrorSerializer}
EDITIONS = Edition.objects.select_related("split__published_edition", "ground_truth")


class EditionsView(APIView):
    """Every edition that was ever published."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="list_editions",
        parameters=listing.PARAMETERS,
        responses={200: EditionSerializer(many=True), **NOT_FOUND},
    )
    def get(self, request: Request, split: str) -> Response:
        """The newest first, a page at a time; `Link` names the next page."""
        get_object_or_404(Split, pk=split)
        rows = EDITIONS.filter(split=split).exclude(published_at=None)
        page = listing.page_of(rows, request, order="-number")
        data = EditionSerializer(page.rows, many=True).data  # type: ignore[arg-type]  # many rows, as it says
        return Response(data, headers=page.headers)


class ChangelogView(APIView):
    """The public changelog of a split."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="changelog",
        parameters=listing.PARAMETERS,
        responses={200: PublicationSerializer(many=True), **NOT_FOUND},
    )
    def get(self, request: Request, split: str) -> Response:
        """Which edition became the board, when and why; the newest first, a page at a time."""
        get_object_or_404(Split, pk=split)
        rows = Publication.objects.filter(split=split).select_related("edition", "replaced")
        page = listing.page_of(rows, request, order="-at")
        data = PublicationSerializer(page.rows, many=True).data  # type: ignore[arg-type]  # many rows, as it says
        return Response(data, headers=page.headers)


class ProgressView(APIView):
    """How far the re-scoring of an edition is; for maintainers."""

    permission_classes = [IsAdminUser]

    @extend_schema(operation_id="edition_progress", responses={200: RescoringSerializer, **NOT_FOUND})
    def get(self, request: Request, split: str, number: int) -> Response:
        """Counts, rate and time left."""
        edition = get_object_or_404(EDITIONS, split=split, number=number)
        return Response(RescoringSerializer(rescoring.progress(edition)).data)


class PreviewView(APIView):
    """What publishing an edition would change; for maintainers."""

    permission_classes = [IsAdminUser]

    @extend_schema(operation_id="edition_preview", responses={200: PreviewSerializer, **NOT_FOUND})
    def get(self, request: Request, split: str, number: int) -> Response:
        """Totals, and one row for each submission."""
        edition = get_object_or_404(EDITIONS, split=split, number=number)
        return Response(PreviewSerializer(preview.preview(edition)).data)
