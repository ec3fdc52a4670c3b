"""One's own account over the API."""

from typing import cast

from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import quotas, teams
from leaderboard.api.serializers import QuotaSerializer
from leaderboard.models import Split, User


class QuotaView(APIView):
    """What one's own team has left."""

    @extend_schema(operation_id="quota", responses=QuotaSerializer(many=True))
    def get(self, request: Request) -> Response:
        """For each split: how many submissions are left, and when the next slot opens."""
        now = timezone.now()
        team = teams.present_team_of(user=cast("User", request.user))
        rows = [quotas.state(team=team, split=split, now=now) for split in Split.objects.all()]
        return Response(QuotaSerializer(rows, many=True).data)  # type: ignore[arg-type]  # many rows, as it says
