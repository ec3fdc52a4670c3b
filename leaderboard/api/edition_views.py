"""Editions: history for everybody, progress and preview for maintainers. A field once here stays."""

from typing import Any

from django.shortcuts import get_object_or_404
from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api import pagination
from leaderboard.api.authentication import IsMaintainer
from leaderboard.api.schema import errors
from leaderboard.api.serializers import (
    DECIMALS,
    EDITION,
    GROUND_TRUTH,
    N_RECORDINGS,
    N_SEQUENCES,
    N_UNITS,
    NULLABLE,
    PROTOCOL,
    SPLIT,
    UNIT,
    absolute,
)
from leaderboard.editions import corrections, preview
from leaderboard.models import Edition, Publication, Split


class EditionSerializer(serializers.Serializer[Edition]):
    """A published edition: a ranking that can be cited permanently."""

    split = serializers.CharField(source="split_id", help_text=SPLIT)
    edition = serializers.IntegerField(source="number", help_text=EDITION)
    protocol = serializers.CharField(help_text=PROTOCOL)
    decimals = serializers.IntegerField(help_text=DECIMALS)
    ground_truth = serializers.CharField(source="ground_truth_id", help_text=GROUND_TRUTH)
    manifest = serializers.CharField(
        source="ground_truth.manifest_digest", help_text="Digest of the public manifest."
    )
    n_sequences = serializers.IntegerField(source="ground_truth.n_sequences", help_text=N_SEQUENCES)
    n_recordings = serializers.IntegerField(source="ground_truth.n_recordings", help_text=N_RECORDINGS)
    unit = serializers.CharField(help_text=UNIT)
    n_units = serializers.IntegerField(source="unit_count", help_text=N_UNITS)
    published_at = serializers.DateTimeField(help_text="When it was first published.")
    is_board = serializers.SerializerMethodField(help_text="Whether it is the split's current edition.")
    url = serializers.SerializerMethodField(help_text="URL of its permanent page.")

    def get_is_board(self, edition: Edition) -> bool:
        return edition.split.current_edition_id == edition.pk

    def get_url(self, edition: Edition) -> str:
        return absolute("edition", edition.split_id, edition.number)


class PublicationSerializer(serializers.Serializer[Publication]):
    """One entry of a split's public changelog."""

    at = serializers.DateTimeField(help_text="When the edition was published.")
    kind = serializers.CharField(help_text="PUBLISHED: a new edition; ROLLED_BACK: an earlier one.")
    edition = serializers.IntegerField(source="edition.number", help_text=EDITION)
    replaced = serializers.IntegerField(
        source="replaced.number", help_text="Number of the edition it replaced; null: the first.", **NULLABLE
    )
    reason = serializers.CharField(help_text="Reason given by the maintainer.")
    n_left_out = serializers.SerializerMethodField(
        help_text="Submissions knowingly left out: unfinished, or rejected now and scored before."
    )

    def get_n_left_out(self, publication: Publication) -> int:
        return len(publication.left_out)


class RescoringSerializer(serializers.Serializer[corrections.RescoringProgress]):
    """Progress of the re-scoring of an edition."""

    n_total = serializers.IntegerField(help_text="Submissions to score.")
    n_done = serializers.IntegerField(help_text="Submissions that are final.")
    n_waiting = serializers.IntegerField(help_text="Submissions that are queued or running.")
    n_scored = serializers.IntegerField(help_text="Submissions scored.")
    n_rejected = serializers.IntegerField(help_text="Submissions that this ground truth cannot score.")
    n_failed = serializers.IntegerField(help_text="Submissions that failed through our fault.")
    n_cancelled = serializers.IntegerField(help_text="Submissions cancelled by their team.")
    percent = serializers.IntegerField(help_text="Percentage that is final, rounded down.")
    rate_per_s = serializers.FloatField(allow_null=True, help_text="Recent rate per second; null: unknown.")
    left_s = serializers.FloatField(allow_null=True, help_text="Seconds remaining; null: unknown.")


class PreviewSerializer(serializers.Serializer[preview.Preview]):
    """What publishing an edition would change."""

    edition = serializers.IntegerField(source="edition.number", help_text=EDITION)
    replaces = serializers.IntegerField(help_text="Number of the edition that it would replace.")
    n_added = serializers.IntegerField(
        source="truth.n_added",
        help_text="Sequences added to the ground truth; null: not compared.",
        **NULLABLE,
    )
    n_removed = serializers.IntegerField(
        source="truth.n_removed", help_text="Sequences removed; null: not compared.", **NULLABLE
    )
    n_changed_sequences = serializers.IntegerField(
        source="truth.n_changed",
        help_text="Sequences whose true value changes; null: not compared.",
        **NULLABLE,
    )
    n_renumbered = serializers.IntegerField(
        source="truth.n_renumbered",
        help_text="Sequences whose anno_id changes; null: not compared.",
        **NULLABLE,
    )
    n_changed = serializers.IntegerField(help_text="Submissions whose status, scores or rank change.")
    n_moved = serializers.IntegerField(help_text="Submissions whose rank changes.")
    n_newly_rejected = serializers.IntegerField(help_text="Submissions that it cannot score.")
    progress = RescoringSerializer(help_text="Progress of its scoring.")
    changes = serializers.SerializerMethodField(help_text="One flat row for each submission.")

    def get_changes(self, edition_preview: preview.Preview) -> list[dict[str, Any]]:
        return preview.rows(edition_preview)


EDITIONS = Edition.objects.select_related("split__current_edition", "ground_truth")


class EditionsView(APIView):
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
    permission_classes = [IsMaintainer]

    @extend_schema(operation_id="edition_progress", responses={200: RescoringSerializer, **errors(404)})
    def get(self, request: Request, split: str, number: int) -> Response:
        """Counts, rate and remaining time. For maintainers."""
        edition = get_object_or_404(EDITIONS, split=split, number=number)
        return Response(RescoringSerializer(corrections.progress(edition)).data)


class PreviewView(APIView):
    permission_classes = [IsMaintainer]

    @extend_schema(operation_id="edition_preview", responses={200: PreviewSerializer, **errors(404)})
    def get(self, request: Request, split: str, number: int) -> Response:
        """Totals, and one row for each submission. For maintainers."""
        edition = get_object_or_404(EDITIONS, split=split, number=number)
        return Response(PreviewSerializer(preview.preview(edition)).data)
