"""Authentication by bearer token, and the limits of tokens."""

from collections.abc import Collection
from typing import Any

from django.utils import timezone
from drf_spectacular.extensions import OpenApiAuthenticationExtension
from knox.auth import TokenAuthentication
from rest_framework import exceptions
from rest_framework.permissions import SAFE_METHODS, BasePermission
from rest_framework.request import Request

from leaderboard.api import request_faults
from leaderboard.models import ApiToken, Scope, User
from leaderboard.people import second_factor, tokens


class BearerAuthentication(TokenAuthentication):
    """`Authorization: Bearer tsttc_…` alone. Checks the token's limits before any view.

    Safe methods need the scope `read` and all others `submit`, or the view's `writing_scope`; a view with
    `token_scopes` accepts any of them.
    """

    def authenticate(self, request: Request) -> tuple[User, ApiToken] | None:
        """Return user and token. Raises `AuthenticationFailed`, or `PermissionDenied` beyond its limits."""
        words = request.META.get("HTTP_AUTHORIZATION", "").split()
        if words and words[0].lower() == "bearer" and len(words) != 2:
            raise exceptions.AuthenticationFailed(request_faults.of_token(request))
        user_and_token: tuple[User, ApiToken] | None = super().authenticate(request)
        if user_and_token is not None:
            view = request.parser_context["view"]
            usual = (
                Scope.READ if request.method in SAFE_METHODS else getattr(view, "writing_scope", Scope.SUBMIT)
            )
            _require_scope(user_and_token[1], getattr(view, "token_scopes", (usual,)))
            if "split" in view.kwargs:
                require_split(user_and_token[1], view.kwargs["split"])
        return user_and_token

    def authenticate_credentials(self, token: bytes) -> tuple[User, ApiToken]:
        try:
            row = tokens.use(secret=token.decode("latin-1"), now=timezone.now())
        except tokens.UnusableToken as fault:
            raise exceptions.AuthenticationFailed(str(fault), code=fault.code) from None
        row.user.owes_a_code = second_factor.is_required(row.user)
        return row.user, row


class IsMaintainer(BasePermission):
    """Lets maintainers in, after two-factor authentication where it is required."""

    def has_permission(self, request: Request, view: Any) -> bool:
        return isinstance(request.user, User) and request.user.acts_as_maintainer


def _require_scope(token: ApiToken, wanted: Collection[Scope]) -> None:
    if not set(wanted) & set(token.scopes):
        names = " or ".join(wanted)
        raise exceptions.PermissionDenied(
            f"The token has the scope {' '.join(token.scopes)!r}; expected {names!r} for this.",
            code="token-scope",
        )


def require_split(token: object, split_name: str) -> None:
    """Raise `PermissionDenied` for a token that is limited to another split."""
    only = split_of(token)
    if only is not None and only != split_name:
        raise exceptions.PermissionDenied(
            f"The token is valid for the split {only!r} only; expected that, found {split_name[:80]!r}.",
            code="token-split",
        )


def split_of(token: object) -> str | None:
    """Return the only split that a request's token is valid for, if limited."""
    return token.split_id if isinstance(token, ApiToken) else None


class BearerScheme(OpenApiAuthenticationExtension):
    target_class = BearerAuthentication
    name = "bearer"

    def get_security_definition(self, auto_schema: Any) -> dict[str, str]:
        return {
            "type": "http",
            "scheme": "bearer",
            "description": "A token made at /tokens/: tsttc_ and 64 hexadecimal digits.",
        }
