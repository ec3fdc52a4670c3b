"""axe-core finds nothing serious on any page that the site has."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal
from uuid import UUID

import httpx
import pytest
from playwright.sync_api import Browser, Page

import evaluator
from tests.browser import world
from tests.browser.addresses import addresses
from tests.browser.chromium import NARROW, WIDE, sign_in
from tests.browser.conftest import NewPage
from tests.journeys.production import PATIENCE_S, Site

pytestmark = pytest.mark.browser

AXE = (Path(__file__).parent / "vendored" / "axe.min.js").read_text(encoding="utf-8")
RUN = """() => axe.run(document, {resultTypes: ["violations"]}).then(found => found.violations
  .filter(violation => ["serious", "critical"].includes(violation.impact))
  .flatMap(({id, nodes}) => nodes.map(node => [id, node.target, node.failureSummary].join(": "))))"""
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
# What leads to no page, or to none that a sample is needed for.
OTHERS = {
    "guide_name": "file-format",
    "operation_id": "submit",
    "page_name": "privacy",
    "wheel_name": "none.whl",
    "chosen": "csv",
    "secret": "none",
    "handle": str(UUID(int=0)),
    "invitation_id": str(UUID(int=0)),
}
VIEWS = (
    "/board/val/?columns=mid&nerf=no",
    "/board/val/?columns=rte&q=nothing+like+it",
    "/compare/?split=val",
    "/compare/?split=val&m={method_id}&m={second_method_id}",
)
# Parts of pages, for a page that is open.
PARTS = ("/state/", "/progress/")
FAULTS = ("/nowhere/", f"/board/{world.SPLIT}/?sort=nothing", f"/board/{world.SPLIT}/?at=never")


@pytest.fixture(scope="module")
def known(site: Site, truth: evaluator.GroundTruth) -> dict[str, str]:
    """One of each kind of thing, to fill addresses with."""
    return {**OTHERS, "split": world.SPLIT, "number": "1", **world.populated(site)}


def is_page(client: httpx.Client, address: str) -> bool:
    answer = client.get(address)
    return answer.status_code == 200 and answer.headers["content-type"].startswith("text/html")


def public_pages(site: Site, known: dict[str, str]) -> list[str]:
    with httpx.Client(base_url=site.url, timeout=PATIENCE_S, trust_env=False) as visitor:
        found = [*addresses(known), *(view.format(**known) for view in VIEWS)]
        return [address for address in found if is_page(visitor, address)]


def faults_of(page: Page, pages: Iterable[str]) -> Iterator[str]:
    for address in pages:
        page.set_viewport_size(WIDE)  # type: ignore[arg-type]  # a plain dict of the right shape
        page.goto(address)
        page.evaluate(AXE)
        for viewport in (WIDE, NARROW):
            page.set_viewport_size(viewport)  # type: ignore[arg-type]  # as above
            found: list[Any] = page.evaluate(RUN)
            yield from (f"{address} at {viewport['width']} px: {fault}" for fault in found)


def test_the_list_of_public_pages_is_taken_from_the_site_itself(site: Site, known: dict[str, str]) -> None:
    found = public_pages(site, known)
    assert [view.format(**known) for view in VIEWS if view.format(**known) not in found] == []
    assert {
        "/board/val/charts/",
        "/",
        "/board/val/",
        f"/methods/{known['method_id']}/",
        "/docs/",
        "/accounts/signup/",
    } <= set(found)
    assert [address for address in found if address.startswith(("/maintain/", "/submissions/"))] == []


@pytest.mark.parametrize("scheme", SCHEMES)
def test_no_public_page_has_a_serious_fault(
    new_page: NewPage, site: Site, known: dict[str, str], scheme: str
) -> None:
    page = new_page(color_scheme=scheme)
    assert list(faults_of(page, public_pages(site, known))) == []


def test_no_page_of_the_signed_in_has_a_serious_fault(
    new_page: NewPage, site: Site, known: dict[str, str]
) -> None:
    page = new_page(color_scheme="light")
    sign_in(page, world.OWNER)
    own = [f"/submissions/{known['rejected_id']}/", f"/methods/{known['private_method_id']}/", "/board/val/"]
    with httpx.Client(
        base_url=site.url, timeout=PATIENCE_S, trust_env=False, cookies=cookies_of(page)
    ) as member:
        mine = [each for each in addresses(known) if is_page(member, each)]
    assert {"/submit/", "/submissions/", f"/submissions/{known['submission_id']}/"} <= set(mine)
    assert list(faults_of(page, [*sorted(set(mine) - set(public_pages(site, known))), *own])) == []


@pytest.mark.parametrize("scheme", SCHEMES)
def test_no_page_of_maintainers_has_a_serious_fault(
    new_page: NewPage, site: Site, known: dict[str, str], scheme: str
) -> None:
    page = new_page(color_scheme=scheme)
    sign_in(page, world.MAINTAINER)
    with httpx.Client(
        base_url=site.url, timeout=PATIENCE_S, trust_env=False, cookies=cookies_of(page)
    ) as keeper:
        asked = [each for each in addresses(known) if each.startswith("/maintain/")]
        asked = [each for each in asked if not each.endswith(PARTS)]
        desk = [each for each in asked if is_page(keeper, each)]
    team = f"/maintain/quotas/{known['team_id']}/"
    assert {"/maintain/", "/maintain/queue/", "/maintain/quotas/", team, f"{team}val/end/"} <= set(desk)
    views = [f"/maintain/queue/?state={state}" for state in ("failed", "waiting")]
    assert list(faults_of(page, [*desk, *views, "/maintain/quotas/?team=owls"])) == []


def test_no_page_that_says_what_was_wrong_has_a_serious_fault(browser: Browser, site: Site) -> None:
    # A context of its own: the browser complains, rightly, of every 404.
    with browser.new_context(base_url=site.url, color_scheme="dark") as context:
        assert list(faults_of(context.new_page(), FAULTS)) == []


def test_what_looks_for_faults_finds_one_that_is_there(page: Page, site: Site) -> None:
    page.goto("/docs/")
    page.evaluate(AXE)
    page.evaluate("document.querySelector('main').append(document.createElement('button'))")
    assert [fault.partition(":")[0] for fault in page.evaluate(RUN)] == ["button-name"]


def cookies_of(page: Page) -> dict[str, str]:
    return {cookie["name"]: cookie["value"] for cookie in page.context.cookies()}
