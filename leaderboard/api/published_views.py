"""The tables of the paper."""

from typing import Any

from django.conf import settings
from django.http import Http404
from drf_spectacular.utils import extend_schema, extend_schema_field
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from evaluator.papers.tables import published_tables
from evaluator.tables import published
from leaderboard.api.schema import errors

_ANY: Any = {"allow_null": True}


@extend_schema_field({"type": ["boolean", "number", "string", "null"]})
class _SettingField(serializers.JSONField):
    pass


class PublishedTableRowSerializer(serializers.Serializer[dict[str, Any]]):
    """One row of a table."""

    key = serializers.CharField(help_text="What the paper prints at the left of the row.")
    split = serializers.CharField(help_text="Split of the results; null in a table without results.", **_ANY)
    method = serializers.CharField(help_text="Short name of the method; null: not of a method.", **_ANY)
    setting = _SettingField(help_text="Setting of an ablation; null in other tables.")
    is_default = serializers.BooleanField(help_text="Whether it is the paper's default.")
    values = serializers.ListField(
        child=serializers.JSONField(), help_text="A value for each of `columns`: in results a number."
    )


class PublishedTableSerializer(serializers.Serializer[dict[str, Any]]):
    """One table of the paper."""

    name = serializers.CharField(help_text="Name of the table.")
    title = serializers.CharField(help_text="Title on the page.")
    section = serializers.CharField(help_text="Section of the paper.")
    caption = serializers.CharField(help_text="Caption in the paper.")
    is_result = serializers.BooleanField(help_text="Whether it has measured numbers.")
    parameter = serializers.CharField(help_text="What an ablation varies; null in other tables.", **_ANY)
    columns = serializers.ListField(child=serializers.CharField(), help_text="Names of the columns.")
    units = serializers.DictField(
        child=serializers.CharField(), help_text="Unit of each column of a table of results."
    )
    rows = PublishedTableRowSerializer(many=True, help_text="Rows, in the paper's order.")
    notes = serializers.ListField(
        child=serializers.CharField(),
        help_text="Where the paper contradicts itself, and what it leaves open.",
    )
    paper_url = serializers.URLField(help_text="URL of the paper.")


class PublishedTablesView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(operation_id="list_published_tables", responses=PublishedTableSerializer(many=True))
    def get(self, request: Request) -> Response:
        """Main results, ablations, cameras and scripts, with the values as printed in the paper."""
        tables = published.printed_tables() if settings.BENCHMARK.has_paper_tables else ()
        documents = [published.document(shown) for shown in tables]
        return Response(PublishedTableSerializer(documents, many=True).data)  # type: ignore[arg-type]  # many rows, as it says


class PublishedTableView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(operation_id="published_table", responses={200: PublishedTableSerializer, **errors(404)})
    def get(self, request: Request, name: str) -> Response:
        """A table by its name, such as `ablation-frame-gap`."""
        tables = published_tables().tables if settings.BENCHMARK.has_paper_tables else ()
        match = next((table for table in tables if table.name == name), None)
        if match is None:
            raise Http404
        return Response(PublishedTableSerializer(published.document(published.printed(match))).data)
