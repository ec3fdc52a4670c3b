"""What crawlers get: what to leave alone, and every public page and no other."""

import re
from xml.etree import ElementTree as ET

import pytest
from django.conf import settings
from django.contrib.staticfiles import finders
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Submission, User
from leaderboard.submissions import intake
from tests import builders

LOC = "{http://www.sitemaps.org/schemas/sitemap/0.9}loc"


def listed(client: Client) -> list[str]:
    answer = client.get("/sitemap.xml")
    assert answer["Content-Type"] == "application/xml; charset=utf-8"
    addresses = [each.text or "" for each in ET.fromstring(answer.content).iter(LOC)]
    assert all(address.startswith(settings.SITE_URL) for address in addresses)
    return [address.removeprefix(settings.SITE_URL) for address in addresses]


@pytest.mark.slow
def test_the_sitemap_names_public_pages_and_each_answers(
    client: Client, edition: Edition, owner: User
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Public")
    builders.score_all()
    addresses = listed(client)
    assert len(addresses) == len(set(addresses))
    assert {"/", "/board/test/", "/board/val/charts/", "/board/test/editions/1/", "/docs/"} <= set(addresses)
    assert f"/methods/{sent.method_id}/" in addresses
    assert [address for address in addresses if client.get(address).status_code != 200] == []


@pytest.mark.slow
def test_the_sitemap_names_no_private_anonymous_or_withdrawn_method(
    client: Client, edition: Edition, owner: User
) -> None:
    for visibility, factor in (("PRIVATE", 1.1), ("ANONYMOUS", 1.2), ("PUBLIC", 1.3)):
        data = builders.predictions(edition, factor=factor)
        sent = builders.submit(owner, data, method=f"M{factor}", visibility=visibility)
    builders.score_all()
    intake.withdraw(submission=Submission.objects.get(pk=sent.pk), actor=owner, now=timezone.now())
    assert [address for address in listed(client) if "/methods/" in address] == []


def test_robots_get_the_sitemap_and_are_kept_from_ones_own_pages(client: Client, benchmark: None) -> None:
    answer = client.get("/robots.txt")
    assert answer["Content-Type"] == "text/plain; charset=utf-8"
    lines = answer.content.decode().splitlines()
    assert f"Sitemap: {settings.SITE_URL}/sitemap.xml" in lines
    kept = [line.removeprefix("Disallow: ") for line in lines if line.startswith("Disallow: ")]
    patterns = [re.compile(re.escape(path).replace(r"\*", ".*")) for path in kept]

    def is_kept(address: str) -> bool:
        return any(pattern.match(address) for pattern in patterns)

    assert not [address for address in listed(client) if is_kept(address)]
    assert all(map(is_kept, ("/submissions/", "/accounts/login/", "/board/test/?sort=-rte", "/maintain/")))


def test_the_icon_is_where_browsers_look_for_it(client: Client, db: None) -> None:
    answer = client.get("/favicon.ico")
    assert answer.status_code == 302
    path = finders.find(answer["Location"].removeprefix("/static/"))
    assert path
