"""Every page that the site has, from its own addresses: a page that is added later joins by itself."""

from collections.abc import Mapping

from tests.security.routes import routes

# What serves no pages: programs' doors, the administration (Django's own pages), and what monitoring asks.
NOT_PAGES = ("api/v1/", "admin/", "healthz", "readyz", "healthy", "metrics")


def addresses(samples: Mapping[str, str]) -> list[str]:
    """The address of each pattern, its parameters filled in from `samples`.

    Raises `KeyError` for a parameter without a sample: a new kind of page needs one thing to be shown with.
    """
    # A regular expression is one of the links that allauth sends by mail.
    pages = [each for each in routes() if not each.pattern.startswith(NOT_PAGES) and "^" not in each.pattern]
    return sorted({route.filled(samples) for route in pages})
