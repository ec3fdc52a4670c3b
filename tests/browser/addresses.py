"""Every page that the site has, from its own addresses: a page that is added later joins by itself."""

from collections.abc import Iterator, Mapping
from typing import Any

from django.urls import URLPattern, URLResolver, get_resolver

# What serves no pages: programs' doors, the administration (Django's own pages), and what monitoring asks.
NOT_PAGES = ("/api/v1/", "/admin/", "/healthz", "/readyz", "/metrics")


def addresses(samples: Mapping[str, str]) -> list[str]:
    """The address of each pattern, its parameters filled in from `samples`.

    Raises `KeyError` for a parameter without a sample: a new kind of page needs one thing to be shown with.
    """
    return sorted(
        {
            _filled(route, names, samples)
            for route, names in _routes(get_resolver().url_patterns, "/", ())
            # A regular expression is one of the links that allauth sends by mail.
            if not route.startswith(NOT_PAGES) and "^" not in route
        }
    )


def _filled(route: str, names: tuple[str, ...], samples: Mapping[str, str]) -> str:
    for name in names:
        before, _, rest = route.partition("<")
        route = before + samples[name] + rest.partition(">")[2]
    return route


def _routes(
    patterns: list[Any], before: str, names: tuple[str, ...]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    for pattern in patterns:
        route = before + str(pattern.pattern)
        known = (*names, *pattern.pattern.converters)
        if isinstance(pattern, URLResolver):
            yield from _routes(pattern.url_patterns, route, known)
        elif isinstance(pattern, URLPattern):
            yield route, known
