"""The API's frame, and how it is described to programs: settings that no variable changes."""

from typing import Any, Final

REST_FRAMEWORK: Final[dict[str, Any]] = {
    "DEFAULT_AUTHENTICATION_CLASSES": [
        "leaderboard.api.authentication.BearerAuthentication",
        "rest_framework.authentication.SessionAuthentication",
    ],
    "DEFAULT_PERMISSION_CLASSES": ["rest_framework.permissions.IsAuthenticated"],
    "DEFAULT_RENDERER_CLASSES": ["leaderboard.api.parsers.UniformJSONRenderer"],
    "DEFAULT_PARSER_CLASSES": [
        "leaderboard.api.parsers.SingleMultiPartParser",
        "leaderboard.api.parsers.LimitedJSONParser",
    ],
    "DEFAULT_SCHEMA_CLASS": "drf_spectacular.openapi.AutoSchema",
    "EXCEPTION_HANDLER": "leaderboard.api.exceptions.exception_handler",
    "DEFAULT_THROTTLE_CLASSES": [
        "leaderboard.api.throttling.SignedInThrottle",
        "leaderboard.api.throttling.VisitorThrottle",
    ],
}
SPECTACULAR_SETTINGS: Final[dict[str, Any]] = {
    "DESCRIPTION": "Submit prediction files, follow their evaluation, read the boards. Errors are problem "
    "details (RFC 9457) with stable codes.",
    "VERSION": "1",
    "OAS_VERSION": "3.1.0",
    "SERVE_INCLUDE_SCHEMA": False,
    # What a request may hold differs from what an answer holds; a file is bytes in the one alone.
    "COMPONENT_SPLIT_REQUEST": True,
    "SCHEMA_PATH_PREFIX": "/api/v1",
    # One set of choices that several answers have is one thing, under one name.
    "ENUM_NAME_OVERRIDES": {
        "MethodVisibilityEnum": "leaderboard.models.methods.Visibility",
        "NewVisibilityEnum": ["ANONYMOUS", "PUBLIC"],
    },
    "POSTPROCESSING_HOOKS": [
        "drf_spectacular.hooks.postprocess_schema_enums",
        "leaderboard.api.schema.complete",
    ],
}
