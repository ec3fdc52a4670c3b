"""Every address that the leaderboard answers to, read from the URLconf and from the OpenAPI schema.

Nothing here is a list kept by hand: a new route is found, and each proof in this folder that
does not know what to expect of it fails.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from django.urls import URLPattern, URLResolver, get_resolver
from django.urls.resolvers import RegexPattern, RoutePattern
from drf_spectacular.generators import SchemaGenerator

API = "/api/v1/"


@dataclass(frozen=True)
class Route:
    """One pattern of the URLconf. `name` has its namespace; one without a name is called by its pattern."""

    name: str
    pattern: str
    parameters: frozenset[str]

    @property
    def is_api(self) -> bool:
        return self.pattern.startswith(API.lstrip("/"))

    @property
    def is_admin(self) -> bool:
        return self.pattern.startswith("admin/")

    @property
    def described_as(self) -> str:
        """Its path in the OpenAPI schema."""
        return "/" + re.sub(r"<(?:\w+:)?(\w+)>", r"{\1}", self.pattern)

    def filled(self, values: Mapping[str, object]) -> str:
        """The address with these values for its parameters. Raises `KeyError` for one that is missing."""
        path = "/" + self.pattern
        for name in self.parameters:
            value = str(values[name])
            placeholder = re.compile(rf"<(?:\w+:)?{name}>|\(\?P<{name}>(?:[^()]|\([^()]*\))*\)")
            path = placeholder.sub(value.replace("\\", r"\\"), path)
        return path.replace("^", "").removesuffix("$")


def routes() -> list[Route]:
    """All of them, in the URLconf's order."""
    return list(_walk(get_resolver().url_patterns))


def _walk(
    patterns: list[URLPattern | URLResolver],
    prefix: str = "",
    namespace: str = "",
    outer: frozenset[str] = frozenset(),
) -> Iterator[Route]:
    for each in patterns:
        pattern = prefix + str(each.pattern)
        parameters = outer | _parameters(each.pattern)
        if isinstance(each, URLPattern):
            yield Route(f"{namespace}{each.name or pattern}", pattern, parameters)
        else:
            inner = f"{namespace}{each.namespace}:" if each.namespace else namespace
            yield from _walk(each.url_patterns, pattern, inner, parameters)


def _parameters(pattern: Any) -> frozenset[str]:
    assert isinstance(pattern, RoutePattern | RegexPattern)
    return frozenset(pattern.regex.groupindex)


def operations() -> dict[str, dict[str, Any]]:
    """The OpenAPI schema's paths: for each the operations by method, in capitals."""
    schema = SchemaGenerator().get_schema(request=None, public=True)
    methods = {"get", "post", "put", "patch", "delete", "head", "options"}
    return {
        path: {method.upper(): operation for method, operation in item.items() if method in methods}
        for path, item in schema["paths"].items()
    }
