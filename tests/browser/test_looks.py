"""What holds of every page on every screen: no complaint, no overflow, no shift, enough contrast."""

from functools import partial

import pytest
from playwright.sync_api import Page, expect

import evaluator
from tests.browser.chromium import LOW_CONTRAST, NARROW, OVERFLOW_PX, WIDE, least_shift, tab_to
from tests.browser.conftest import NewPage, sign_up

pytestmark = pytest.mark.browser

PUBLIC = (
    "/",
    "/board/test/",
    "/board/test/?sort=-rte_negative",
    "/board/test/?columns=mid&q=deep",
    "/board/test/charts/",
    "/board/val/",
    "/compare/",
    "/docs/",
    "/docs/api/",
    "/docs/api/submit/",
    "/docs/cli/",
    "/docs/baselines/",
    "/docs/search/?q=quota",
    "/privacy/",
    "/accounts/login/",
    "/accounts/signup/",
    "/accounts/password/reset/",
)
PRIVATE = ("/submit/", "/submissions/", "/accounts/email/", "/accounts/password/change/")
# A tenth of what counts as good: a table's columns may settle by a hair while its rows arrive.
MAX_SHIFT = 0.01
SCREENS = [(size, scheme) for size in ("wide", "narrow") for scheme in ("light", "dark")]


@pytest.mark.parametrize(("size", "scheme"), SCREENS)
def test_every_page_fits_its_screen_and_can_be_read(
    new_page: NewPage, truth: evaluator.GroundTruth, size: str, scheme: str
) -> None:
    page = new_page(viewport=WIDE if size == "wide" else NARROW, color_scheme=scheme)
    look_at(page, PUBLIC)
    sign_up(page, email=f"{size}-{scheme}@example.org", name="A team with quite a long name, of Somewhere")
    look_at(page, PRIVATE)


def opened(page: Page, address: str) -> None:
    answer = page.goto(address)
    assert answer is not None
    assert answer.status == 200, address


def look_at(page: Page, addresses: tuple[str, ...]) -> None:
    for address in addresses:
        shift = least_shift(page, partial(opened, page, address), allowed=MAX_SHIFT)
        assert page.evaluate(OVERFLOW_PX) <= 0, f"{address} is wider than the screen"
        assert shift <= MAX_SHIFT, f"{address} moves while it loads"
        assert page.evaluate(LOW_CONTRAST) == [], address


def test_decimal_points_stand_in_one_line(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/board/test/")
    points = page.evaluate(
        """() => [...document.querySelectorAll("td.primary")].map(cell => {
          const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
          while (walker.nextNode()) { const at = walker.currentNode.textContent.indexOf(".");
            if (at >= 0) { const range = document.createRange(); range.setStart(walker.currentNode, at);
              range.setEnd(walker.currentNode, at + 1); return range.getBoundingClientRect().left; } }
        })"""
    )
    regular = points[1:]
    assert len(regular) >= 4
    assert max(regular) - min(regular) < 0.5
    # The best is bold: its own figures may be a trifle wider, in fonts whose bold is.
    assert abs(points[0] - regular[0]) < 4


def test_first_tab_offers_to_skip_to_the_content(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/")
    tab_to(page, "Skip to the content")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"


def test_what_has_the_focus_can_be_seen(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/")
    for _ in range(30):
        page.keyboard.press("Tab")
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"


@pytest.mark.parametrize("viewport", [WIDE, {"width": 703, "height": 1000}, NARROW])
def test_print_has_the_whole_table_and_no_navigation(
    new_page: NewPage, truth: evaluator.GroundTruth, viewport: dict[str, int]
) -> None:
    # A sheet of A4 is 703 px wide between its margins: as narrow as a small tablet.
    page = new_page(viewport=viewport)
    page.emulate_media(media="print")
    page.goto("/board/test/")
    expect(page.locator(".site-nav")).to_be_hidden()
    expect(page.locator("table.board thead tr").last.locator("th:visible")).to_have_count(12)


def test_site_has_an_icon_of_its_own(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/")
    icon = page.locator("link[rel=icon]").get_attribute("href")
    assert icon is not None
    answer = page.request.get(icon)
    assert (answer.status, answer.headers["content-type"]) == (200, "image/svg+xml")
