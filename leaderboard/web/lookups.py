"""The split of an address, and the page that a request comes from."""

from urllib.parse import urlsplit

from django.conf import settings
from django.http import Http404, HttpRequest
from django.utils.http import url_has_allowed_host_and_scheme

from leaderboard.boards.snapshots import splits_of
from leaderboard.models import Split


def split_or_404(request: HttpRequest, name: str) -> Split:
    matching = next((split for split in splits_of(request) if split.pk == name), None)
    if matching is None:
        raise Http404(f"There is no split {name!r}.")
    return matching


def page_before(request: HttpRequest) -> str:
    """Return the address, without a host, of the page of this site that the request came from."""
    address = request.headers.get("Referer", "")
    # The settings' host, and the one that was asked for, whatever it is: a demo also answers as localhost.
    hosts = {urlsplit(settings.SITE_URL).netloc, request.headers.get("Host", "")}
    parts = urlsplit(address if url_has_allowed_host_and_scheme(address, allowed_hosts=hosts) else "")
    path = f"{parts.path}?{parts.query}" if parts.query else parts.path
    # A path that begins with two slashes would name another site where it is linked.
    return "" if path.startswith("//") else path
