"""What pages look like: points in one line, a focus that is seen, on paper, in the visitor's own colours."""

import pytest
from playwright.sync_api import Page, expect

import evaluator
from tests.browser.chromium import NARROW, WIDE, tab_to
from tests.browser.conftest import NewPage
from tests.browser.inspection import draw_all

pytestmark = pytest.mark.browser


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


def test_print_has_the_whole_table_and_no_navigation(page: Page, truth: evaluator.GroundTruth) -> None:
    page.emulate_media(media="print")
    page.goto("/board/test/")
    # A sheet of A4 is 703 px wide between its margins: as narrow as a small tablet.
    for width in (WIDE["width"], 703, NARROW["width"]):
        page.set_viewport_size({"width": width, "height": 1000})
        expect(page.locator(".site-nav")).to_be_hidden()
        heads = page.locator("table.board thead tr").last.locator("th:not(.choose)")
        # The rank, the method, ten scores, and the intervals once some are computed.
        assert heads.count() >= 12
        expect(heads.filter(visible=True)).to_have_count(heads.count())


# The inks that show something: drawings, and lines in the place of tints.
INKS = """() => {
  const look = (selector, name) => [...document.querySelectorAll(selector)]
    .filter(each => each.checkVisibility())
    .map(each => [`${selector} ${name}`, getComputedStyle(each)[name]]);
  return [
    ...look(".whisker .span, .whisker .ring, .axis line", "stroke"),
    ...look(".whisker .dot", "fill"),
    ...look("[aria-current]", "outlineColor"),
    ...look("a.button, .chip, form button:not(.as-link)", "borderTopColor"),
  ];
}"""
OUTLINE = """() => {
  const style = getComputedStyle(document.activeElement);
  return [style.outlineStyle, style.outlineColor];
}"""
GROUND = "() => getComputedStyle(document.body).backgroundColor"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_in_colours_that_the_visitor_chose_marks_buttons_and_the_focus_are_seen(
    new_page: NewPage, truth: evaluator.GroundTruth, scheme: str
) -> None:
    page = new_page(forced_colors="active", color_scheme=scheme)
    for address in ("/board/test/", "/board/test/charts/", "/accounts/login/"):
        page.goto(address)
        draw_all(page)
        ground = page.evaluate(GROUND)
        inks = page.evaluate(INKS)
        assert inks
        assert [what for what, ink in inks if ink == ground] == []
        for _ in range(8):
            page.keyboard.press("Tab")
            style, colour = page.evaluate(OUTLINE)
            assert style == "solid"
            assert colour != ground
    page.goto("/board/test/")
    styles = page.locator(".splits a").evaluate_all(
        "all => all.map(e => [e.matches('[aria-current]'), getComputedStyle(e).outlineStyle])"
    )
    assert {(is_current, style) for is_current, style in styles} == {(True, "solid"), (False, "none")}
