"""The documentation in a browser: search and navigation by keyboard, without a script, and on a phone."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser.chromium import NARROW, OVERFLOW_PX
from tests.browser.conftest import NewPage

pytestmark = pytest.mark.browser

BOXES = "all => all.map(each => each.getBoundingClientRect()).map(({width, height}) => [width, height])"
MIN_TYPE_PX = 80


def test_a_search_by_keyboard_leads_to_the_part_that_was_looked_for(page: Page) -> None:
    page.goto("/docs/")
    field = page.get_by_role("searchbox", name="Search the documentation")
    field.fill("natural keys")
    field.press("Enter")
    page.wait_for_url("**/docs/search/?q=natural+keys")
    first = page.locator("ol.hits a").first
    expect(page.locator("ol.hits mark").first).to_have_text(re.compile("natural", re.IGNORECASE))
    first.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/docs/file-format/#keys")
    expect(page.locator("#keys")).to_be_in_viewport()


@pytest.mark.parametrize("has_scripts", [True, False])
def test_the_navigation_stands_open_on_a_wide_screen_and_leads_from_page_to_page(
    new_page: NewPage, *, has_scripts: bool
) -> None:
    page = new_page(java_script_enabled=has_scripts)
    page.goto("/docs/researchers/")
    side = page.get_by_role("navigation", name="Documentation")
    expect(side.get_by_role("link", name="Scoring")).to_be_visible()
    side.get_by_role("link", name="Scoring").click()
    page.wait_for_url("**/docs/scoring/")
    expect(side.locator("[aria-current=page]")).to_have_text("Scoring")


def test_on_a_phone_the_navigation_is_folded_above_the_text_and_opens_by_keyboard(new_page: NewPage) -> None:
    page = new_page(viewport=NARROW)
    page.goto("/docs/researchers/")
    link = page.get_by_role("link", name="Command line", exact=True)
    expect(link).to_be_hidden()
    page.get_by_text("All pages").focus()
    page.keyboard.press("Enter")
    expect(link).to_be_visible()


def test_on_a_phone_no_name_of_a_field_breaks(new_page: NewPage) -> None:
    page = new_page(viewport=NARROW)
    page.goto("/docs/api/submit/")
    names, types = (
        page.locator(f".fields-of td{part}").evaluate_all(BOXES)
        for part in (":nth-child(1) code", ":nth-child(2)")
    )
    heights = [height for _, height in names]
    assert len(heights) > 1
    assert max(heights) < 2 * min(heights)
    assert min(width for width, _ in types) > MIN_TYPE_PX
    assert page.evaluate(OVERFLOW_PX) <= 0


def test_without_a_script_the_search_finds_as_well(new_page: NewPage) -> None:
    page = new_page(java_script_enabled=False)
    page.goto("/docs/")
    page.get_by_role("searchbox", name="Search the documentation").fill("quota")
    page.get_by_role("button", name="Search").click()
    page.wait_for_url("**/docs/search/?q=quota")
    expect(page.locator("ol.hits a").first).to_have_text("Who may do what: Quotas")
