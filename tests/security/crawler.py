"""Follows every link that a reader is shown."""

import html
import re
from collections.abc import Callable
from urllib.parse import urljoin, urlsplit

LINK = re.compile(rb'(?:href|src|action|hx-get)="([^"]+)"')
# What would end the crawl, or leads nowhere new.
NOT_FOLLOWED = re.compile(r"/logout/|/static/|/delete/|[?&](?:o|sort|next|_to_field|_changelist_filters)=")


def crawl(get: Callable[[str], bytes], *, start: list[str], limit: int) -> dict[str, bytes]:
    """What is answered at these addresses, and at those that they name: at most `limit` of them."""
    waiting = list(start)
    bodies: dict[str, bytes] = {}
    known = set(waiting)
    while waiting and len(bodies) < limit:
        path = waiting.pop(0)
        bodies[path] = body = get(path)
        for raw in LINK.findall(body):
            target = urlsplit(urljoin(path, html.unescape(raw.decode("utf-8", "replace"))))
            if target.netloc and target.netloc != "testserver":
                continue
            address = target.path + (f"?{target.query}" if target.query else "")
            if address.startswith("/") and address not in known and not NOT_FOLLOWED.search(address):
                known.add(address)
                waiting.append(address)
    return bodies
