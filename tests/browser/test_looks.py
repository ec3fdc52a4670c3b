"""What pages look like: points in one line, a focus that is seen, on paper, in the visitor's own colours."""

import pytest
from playwright.sync_api import Page, expect

import evaluator
from tests.browser.chromium import NARROW, WIDE, tab_to
from tests.browser.conftest import NewPage
from tests.browser.inspection import draw_all
from tests.journeys.production import Site

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


FIVE_SPLITS = """
from leaderboard.models import Split
for name, title in (("late-1", "Winter challenge 2027, night drives"), ("late-2", "Summer challenge 2027")):
    Split.objects.get_or_create(name=name, defaults={"title": title})
"""
NO_MORE = "from leaderboard.models import Split; Split.objects.filter(name__startswith='late-').delete()"


def test_five_splits_fit_a_phone(new_page: NewPage, site: Site, truth: evaluator.GroundTruth) -> None:
    site.manage("shell", "-v0", "-c", FIVE_SPLITS)
    try:
        page = new_page(viewport={"width": 390, "height": 800})
        for address in ("/board/late-1/", "/board/late-1/charts/"):
            page.goto(address)
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, address
            for link in page.locator("nav.splits a").all():
                box = link.bounding_box()
                assert box is not None
                assert box["x"] + box["width"] <= 390
    finally:
        site.manage("shell", "-v0", "-c", NO_MORE)


def test_meanings_of_codes_take_the_width_of_the_page(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/docs/")
    meaning = page.locator("dl.codes dd").first.bounding_box()
    assert meaning is not None
    assert meaning["width"] > 400


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


def test_site_has_an_icon_of_its_own(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/")
    icon = page.locator("link[rel=icon]").get_attribute("href")
    assert icon is not None
    answer = page.request.get(icon)
    assert (answer.status, answer.headers["content-type"]) == (200, "image/svg+xml")


# A board of 18 columns, which a protocol may have: eight of this one's are shown twice.
WIDER = """() => {
  document.querySelector(".board-scroll").classList.add("scrolls");
  const numbers = row => [...row.children].filter(cell => /\\bat[0-9]/.test(cell.className)
    && !cell.matches(".interval"));
  for (const row of document.querySelectorAll("table.board :is(colgroup, thead tr:last-child, tbody tr)"))
    for (const cell of numbers(row).slice(0, 8)) row.append(cell.cloneNode(true));
  document.querySelector(".board .groups th:last-child").colSpan += 8;
}"""
OUTSIDE = """() => [...document.querySelectorAll("table.board :is(td, th)")]
  .filter(cell => cell.checkVisibility() && cell.getBoundingClientRect().right > innerWidth)
  .map(cell => cell.textContent.trim())"""


def test_board_with_more_columns_than_fit_is_printed_whole(page: Page, truth: evaluator.GroundTruth) -> None:
    page.goto("/board/test/")
    page.evaluate(WIDER)
    first = page.locator("table.board tbody tr").first
    expect(first.locator("td:not(.choose, .interval, .rank)")).to_have_count(18)
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 1047, "height": 700})  # A4 on its side
    assert page.evaluate(OUTSIDE) == []
    assert page.evaluate("getComputedStyle(document.querySelector('.board-scroll')).overflow") == "visible"


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


LEFT_PX = """() => ["h1", ".site-name", ".site-footer p"]
  .map(name => Math.round(document.querySelector(name).getBoundingClientRect().left))"""


def test_head_content_and_foot_of_every_kind_of_page_begin_at_one_edge(
    page: Page, truth: evaluator.GroundTruth
) -> None:
    edges: dict[int, set[int]] = {1280: set(), 1440: set(), 1920: set()}
    boards = ("/board/test/", "/board/test/charts/", "/board/test/editions/", "/compare/")
    for address in (*boards, "/privacy/", "/accounts/login/"):
        page.goto(address)
        for width_px, seen in edges.items():
            page.set_viewport_size({"width": width_px, "height": 900})
            seen.update(page.evaluate(LEFT_PX))
    assert [len(seen) for seen in edges.values()] == [1, 1, 1]
