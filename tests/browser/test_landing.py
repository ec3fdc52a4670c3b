"""The landing page in a browser: without a script, on paper, in the dark, on a phone."""

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.chromium import NARROW, OVERFLOW_PX, WIDE
from tests.browser.conftest import NewPage
from tests.journeys.production import Site

pytestmark = pytest.mark.browser

LIBRARY = "performance.getEntriesByType('resource').filter(each => each.name.includes('echarts')).length"


@pytest.mark.parametrize(
    ("viewport", "scheme", "figure"),
    [(WIDE, "light", "wide-light"), (WIDE, "dark", "wide-dark"), (NARROW, "dark", "narrow-dark")],
)
def test_the_figure_suits_the_screen_and_keeps_its_room(
    new_page: NewPage, viewport: dict[str, int], scheme: str, figure: str
) -> None:
    page = new_page(viewport=viewport, color_scheme=scheme)
    page.goto("/")
    image = page.locator(".task img")
    assert f"/{figure}." in image.evaluate("image => image.currentSrc")
    drawn = image.evaluate("image => image.naturalWidth / image.naturalHeight")
    kept = image.evaluate("image => image.clientWidth / image.clientHeight")
    assert kept == pytest.approx(drawn, rel=0.01)


def test_the_chart_is_fetched_once_it_comes_into_view(new_page: NewPage) -> None:
    page = new_page(viewport=NARROW)
    page.goto("/")
    assert page.evaluate(LIBRARY) == 0
    plot = page.locator("figure[data-chart=progress] .plot")
    plot.scroll_into_view_if_needed()
    expect(page.locator(".plot.is-drawn svg")).to_be_visible()
    assert page.evaluate(LIBRARY) == 1


def test_without_a_script_the_best_so_far_stand_in_a_table(browser: Browser, site: Site) -> None:
    with browser.new_context(base_url=site.url, viewport=NARROW, java_script_enabled=False) as context:  # type: ignore[arg-type]  # a plain dict of the right shape
        page = context.new_page()
        page.goto("/")
        expect(page.locator(".fronts tbody tr").first).to_be_visible()
        expect(page.locator(".plot")).to_be_hidden()
        expect(page.get_by_role("link", name="Get the data")).to_be_visible()


def test_paper_has_the_table_where_the_chart_was_not_drawn(new_page: NewPage) -> None:
    page = new_page(viewport=NARROW)
    page.goto("/")
    expect(page.locator(".fronts")).to_be_hidden()
    page.emulate_media(media="print")
    expect(page.locator(".fronts")).to_be_visible()
    assert page.evaluate(OVERFLOW_PX) <= 0


def test_by_keyboard_from_the_landing_page_to_the_board(page: Page, site: Site) -> None:
    page.goto("/")
    link = page.get_by_role("link", name="Full board")
    link.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/board/test/")
