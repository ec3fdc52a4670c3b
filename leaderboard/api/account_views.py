"""One's own account over the API: what is left, and the end of a token."""

from typing import cast

from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import deadlines, teams, tokens
from leaderboard.api.authentication import split_of
from leaderboard.api.bodies import DocumentParser
from leaderboard.api.problems import problem
from leaderboard.api.serializers import (
    ErrorSerializer,
    LeakedTokenSerializer,
    QuotaSerializer,
    RevokedSerializer,
)
from leaderboard.api.throttles import RevokeThrottle
from leaderboard.models import Scope, Split, User


class QuotaView(APIView):
    """What one's own team has left."""

    # Who may only submit has to know when.
    token_scopes = (Scope.READ, Scope.SUBMIT)

    @extend_schema(operation_id="quota", responses=QuotaSerializer(many=True))
    def get(self, request: Request) -> Response:
        """For each split: how many submissions are left, and when the next slot opens."""
        now = timezone.now()
        user = cast("User", request.user)
        team = teams.present_team_of(user=user)
        only = split_of(request.auth)
        splits = Split.objects.filter(pk=only) if only is not None else Split.objects.all()
        rows = [deadlines.left(team=team, user=user, split=split, now=now) for split in splits]
        return Response(QuotaSerializer(rows, many=True).data)  # type: ignore[arg-type]  # many rows, as it says


class RevokeView(APIView):
    """The end of a token that somebody found where it should not be."""

    authentication_classes = ()
    permission_classes = [AllowAny]
    parser_classes = [DocumentParser]
    throttle_classes = [RevokeThrottle]

    @extend_schema(
        operation_id="revoke_token",
        request=LeakedTokenSerializer,
        responses={
            200: RevokedSerializer,
            (422, "application/problem+json"): ErrorSerializer,
            (429, "application/problem+json"): ErrorSerializer,
        },
    )
    def post(self, request: Request) -> Response:
        """Revoke a leaked token. Needs no account; what it says does not tell whether the token was one."""
        asked = LeakedTokenSerializer(data=request.data)
        if not asked.is_valid():
            sentence = "No token was sent; expected a JSON object with the text 'token'."
            return problem(status=422, code="missing-field", detail=sentence, where="token")
        tokens.revoke_leaked(secret=asked.validated_data["token"], now=timezone.now())
        return Response(RevokedSerializer({}).data)
