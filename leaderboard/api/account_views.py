"""Whose token it is, the user's quota, and the revocation of leaked tokens."""

from typing import cast

from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api.authentication import split_of
from leaderboard.api.exceptions import problem
from leaderboard.api.parsers import LimitedJSONParser
from leaderboard.api.schema import errors
from leaderboard.api.serializers import (
    AccountSerializer,
    LeakedTokenSerializer,
    QuotaSerializer,
    RevokedSerializer,
)
from leaderboard.api.throttling import RevokeThrottle
from leaderboard.models import Scope, Split, User
from leaderboard.people import teams, tokens
from leaderboard.quotas import admissions


class AccountView(APIView):
    token_scopes = tuple(Scope)

    @extend_schema(operation_id="account", responses=AccountSerializer)
    def get(self, request: Request) -> Response:
        """Whose token this is and what it may do. It names no person."""
        team = teams.current_team_of(user=cast("User", request.user))
        return Response(AccountSerializer({"team": team, "token": request.auth}).data)


class QuotaView(APIView):
    # A token that can only submit needs to know when it may.
    token_scopes = tuple(Scope)

    @extend_schema(operation_id="quota", responses=QuotaSerializer(many=True))
    def get(self, request: Request) -> Response:
        """For each split: remaining submissions, and when the next slot opens."""
        now = timezone.now()
        user = cast("User", request.user)
        team = teams.current_team_of(user=user)
        only = split_of(request.auth)
        splits = Split.objects.shown()
        splits = splits.filter(pk=only) if only is not None else splits
        rows = [admissions.left(team=team, user=user, split=split, now=now) for split in splits]
        return Response(QuotaSerializer(rows, many=True).data)  # type: ignore[arg-type]  # many rows, as it says


class RevokeView(APIView):
    authentication_classes = ()
    permission_classes = [AllowAny]
    parser_classes = [LimitedJSONParser]
    throttle_classes = [RevokeThrottle]

    @extend_schema(
        operation_id="revoke_token",
        request=LeakedTokenSerializer,
        responses={
            200: RevokedSerializer,
            **errors(422, 429),
        },
    )
    def post(self, request: Request) -> Response:
        """Revoke a leaked token. Needs no account; the response does not reveal whether it was a token."""
        asked = LeakedTokenSerializer(data=request.data)
        if not asked.is_valid():
            sentence = "No token was sent; expected a JSON object with the text 'token'."
            return problem(status=422, code="missing-field", detail=sentence, where="token")
        tokens.revoke_leaked(secret=asked.validated_data["token"], now=timezone.now())
        return Response(RevokedSerializer({}).data)
