"""Bearer tokens."""

import re
from typing import Any

from drf_spectacular.extensions import OpenApiAuthenticationExtension
from knox.auth import TokenAuthentication
from knox.models import AbstractAuthToken
from rest_framework import exceptions

from leaderboard.models import User

# What `tokens.create` makes; anything else is refused before the database is asked.
TOKEN = re.compile(rb"tsttc_[0-9a-f]{64}")


class BearerAuthentication(TokenAuthentication):
    """`Authorization: Bearer tsttc_…`, hashed at rest."""

    def authenticate_credentials(self, token: bytes) -> tuple[User, AbstractAuthToken]:
        """The token's owner. Raises `AuthenticationFailed`."""
        if not TOKEN.fullmatch(token):
            raise exceptions.AuthenticationFailed(
                "The bearer token is malformed; expected tsttc_ and 64 hexadecimal digits."
            )
        return super().authenticate_credentials(token)


class BearerScheme(OpenApiAuthenticationExtension):
    """How the schema describes bearer tokens."""

    target_class = BearerAuthentication
    name = "bearer"

    def get_security_definition(self, auto_schema: Any) -> dict[str, str]:
        """The scheme as OpenAPI names it."""
        return {
            "type": "http",
            "scheme": "bearer",
            "description": "A token made by a maintainer: tsttc_ and 64 hexadecimal digits.",
        }
