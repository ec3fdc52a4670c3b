"""The board on every screen: it fits, its heads stay, it answers at once, and it keeps what is ticked."""

import re
from datetime import UTC, datetime, timedelta
from typing import Literal

import pytest
from playwright.sync_api import Page, expect

from tests.browser.chromium import NARROW, OVERFLOW_PX, WIDE, sign_in, timers_at_rest
from tests.browser.conftest import BOARD_OWNER, NewPage

pytestmark = pytest.mark.browser

BOARD = "/board/demo/"
WIDTHS = (320, 360, 768, 960, 1024, 1280, 1366, 1440, 1920)
N_COMPARED = 5
MAX_FIRST_ROW_PX = 330  # at 1440 × 900
# Cells whose text is wider than they are: it would lie over its neighbour. Italics lean into their padding.
SPILLED = """() => [...document.querySelectorAll("table.board :is(td, th):not(.interval, .choose)")]
  .filter(cell => cell.checkVisibility() && cell.scrollWidth > cell.clientWidth + 3)
  .map(cell => `${cell.className}: ${cell.textContent.trim().slice(0, 40)}`)"""
# The smallest room between two numbers of a row, each as wide as one of three digits.
APART_PX = """() => Math.min(...[...document.querySelectorAll("table.board tbody tr")].flatMap(row => {
  const scores = [...row.cells].filter(cell => /^[0-9]+[.][0-9]/.test(cell.textContent.trim()));
  const boxes = scores.filter(cell => !cell.matches(".interval")).map(cell => {
    const range = document.createRange();
    cell.textContent = "613.18";
    range.selectNodeContents(cell);
    return range.getBoundingClientRect();
  });
  return boxes.slice(1).map((box, i) => box.left - boxes[i].right);
}))"""
LOW_LINKS = """() => [...document.querySelectorAll("table.board thead a, .view-tools :is(a, summary), .chip")]
  .filter(each => each.checkVisibility() && each.getBoundingClientRect().height < 24)
  .map(each => each.textContent)"""
HEAD_TOP_PX = """() => {
  scrollTo(0, document.querySelector("table.board tbody tr:nth-child(40)").offsetTop);
  return document.querySelector("table.board thead").getBoundingClientRect().top;
}"""
FIRST_ROW_PX = 'document.querySelector("table.board tbody tr").getBoundingClientRect().top'
# As the errors by TTC range, which have their table there: they are below a board of fewer than three dates.
NEEDS_NO_SCRIPT = """document.querySelector(".board-progress").classList.remove("drawn-only")"""
ADD_TWO_SPLITS = """() => {
  const tabs = document.querySelector(".splits");
  for (const title of ["Winter challenge 2027", "Fog and rain"])
    tabs.append(Object.assign(tabs.lastElementChild.cloneNode(), {textContent: title}));
}"""


def faults_at_every_width(page: Page) -> list[str]:
    faults = []
    page.goto(BOARD)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 800})
        page.evaluate("scrollTo(0, 0)")
        checks = {"overflow": OVERFLOW_PX, "low": LOW_LINKS, "spilled": SPILLED, "head": HEAD_TOP_PX}
        for name, check in checks.items():
            seen = page.evaluate(check)
            if seen:
                faults.append(f"{width}: {name} {seen}")
    return faults


def test_board_fits_every_screen_with_names_of_80_letters_and_its_heads_stay(
    new_page: NewPage, board: None
) -> None:
    assert faults_at_every_width(new_page()) == []
    page = new_page()
    sign_in(page, BOARD_OWNER)
    assert faults_at_every_width(page) == []
    expect(page.get_by_text("would be")).to_have_count(1)


def test_an_open_menu_stays_in_the_window(new_page: NewPage, board: None) -> None:
    page = new_page()
    sign_in(page, BOARD_OWNER)
    faults = []
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 800})
        page.goto(BOARD)
        for name in ("History", "Export"):
            page.locator(".menu > summary", has_text=name).click()
            body = page.locator(".menu[open] > .menu-body").bounding_box()
            assert body is not None
            right, bottom = body["x"] + body["width"], body["y"] + body["height"]
            if body["x"] < 0 or right > width or bottom > 800 or page.evaluate(OVERFLOW_PX):
                faults.append(f"{width}: {name} {body}")
            page.keyboard.press("Escape")
    assert faults == []


def test_phone_shows_one_range_and_the_visitor_chooses_which(new_page: NewPage, board: None) -> None:
    page = new_page(viewport=NARROW)
    page.goto(BOARD)
    heads = page.locator("table.board thead tr").last.locator("th:visible")
    expect(heads).to_have_count(6)
    assert [re.split(r"\s", text.strip())[0] for text in heads.all_inner_texts()][-3:] == ["MiD", "RTE", "WE"]
    page.get_by_label("0–3 s", exact=True).check()
    assert [text.strip()[:5] for text in heads.all_inner_texts()][-2:] == ["0–3 s", "0–3 s"]
    page.locator("table.board tbody input").first.check()
    expect(page.get_by_role("complementary", name="Selected for comparison")).to_be_visible()


def test_board_answers_while_one_types_and_says_at_the_field_what_is_wrong(page: Page, board: None) -> None:
    page.goto(BOARD)
    rows = page.locator("table.board tbody tr")
    page.get_by_role("searchbox").press_sequentially("method 12 ")
    expect(rows).to_have_count(1)
    only_what_is_set = re.compile(re.escape(f"{BOARD}?q=method+12") + "$")
    expect(page).to_have_url(only_what_is_set)
    page.get_by_text("Filters", exact=True).click()
    page.get_by_label("Max latency (ms)").fill("fast")
    expect(page.locator("#fault-latency")).to_contain_text("expected a number of milliseconds")
    expect(page.get_by_label("Max latency (ms)")).to_have_attribute("aria-invalid", "true")
    expect(rows).to_have_count(1)
    page.get_by_label("Max latency (ms)").fill("1")
    expect(rows).to_have_count(0)
    expect(page.locator("#fault-latency")).to_be_empty()
    page.get_by_role("link", name="Remove filter Max latency (ms): 1").click()
    expect(rows).to_have_count(1)
    expect(page).to_have_url(only_what_is_set)


def test_ticks_survive_sorting_and_searching_and_end_at_five(page: Page, board: None) -> None:
    page.goto(BOARD)
    boxes = page.locator("table.board tbody input[type=checkbox]")
    tray = page.get_by_role("complementary", name="Selected for comparison")
    expect(tray).to_be_hidden()
    boxes.nth(1).check()
    boxes.nth(4).check()
    expect(tray).to_contain_text("2 of at most 5")
    page.get_by_role("link", name="RTE, overall, %").click()
    page.get_by_role("searchbox").fill("method 2")
    expect(page.get_by_text(re.compile("^[0-9]+ of [0-9]+ results"))).to_be_visible()
    expect(tray).to_contain_text("2 of at most 5")
    page.goto(BOARD)
    expect(boxes.nth(4)).to_be_checked()
    for i in (7, 8, 9):
        boxes.nth(i).check()
    expect(tray).to_contain_text("the maximum")
    expect(boxes.nth(0)).to_be_disabled()
    href = tray.get_by_role("link", name="Compare").get_attribute("href") or ""
    assert len(re.findall(r"[?&]m=", href)) == N_COMPARED
    tray.get_by_role("button", name="Clear").click()
    expect(tray).to_be_hidden()


def test_menu_and_legend_open_and_close_by_keyboard_and_an_export_is_copied(
    new_page: NewPage, board: None
) -> None:
    page = new_page(viewport=WIDE, permissions=["clipboard-read", "clipboard-write"])
    page.goto(BOARD)
    page.locator(".legend summary").press("Enter")
    expect(page.get_by_text("Ranked by overall MiD")).to_be_visible()
    menu = page.locator("details.exports")
    menu.locator("summary").press("Enter")
    with timers_at_rest(page):
        menu.get_by_role("button", name="Copy LaTeX", exact=True).click()
        expect(menu.get_by_text("Copied")).to_be_visible()
    assert r"\toprule" in page.evaluate("navigator.clipboard.readText()")
    page.keyboard.press("Escape")
    expect(menu.locator(".menu-body")).to_be_hidden()
    with page.expect_download() as download:
        menu.locator("summary").click()
        menu.get_by_role("link", name="Download Markdown", exact=True).click()
    assert download.value.suggested_filename == "tsttc-demo-edition-1.md"


def test_first_row_is_above_the_fold_and_the_tabs_of_five_splits_fit_a_phone(page: Page, board: None) -> None:
    page.goto(BOARD)
    page.evaluate(ADD_TWO_SPLITS)
    # The second is the first at 200 %, of which two screens are the most.
    for width, height, limit_px in ((1440, 900, MAX_FIRST_ROW_PX), (720, 450, 2 * 450)):
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate(FIRST_ROW_PX) < limit_px
    page.set_viewport_size(NARROW)
    assert page.evaluate(OVERFLOW_PX) == 0


def test_first_row_stays_above_the_fold_with_private_rows_filters_a_past_day_and_editions(
    page: Page, board: None
) -> None:
    sign_in(page, BOARD_OWNER)
    page.set_viewport_size({"width": 1440, "height": 900})
    yesterday = datetime.now(UTC).date() - timedelta(days=1)
    for address in ("", "?q=method+1", f"?at={yesterday}", "editions/1/", "editions/1/?q=method+1"):
        page.goto(f"{BOARD}{address}")
        assert page.evaluate(FIRST_ROW_PX) < MAX_FIRST_ROW_PX, address


def test_export_menu_ends_above_the_tray(page: Page, board: None) -> None:
    page.set_viewport_size({"width": 1024, "height": 500})
    page.goto(BOARD)
    page.locator("table.board tbody input[type=checkbox]").first.check()
    page.locator(".exports summary").click()
    menu, tray = page.locator(".exports .menu-body").bounding_box(), page.locator("#tray").bounding_box()
    assert menu is not None
    assert tray is not None
    assert menu["y"] + menu["height"] <= tray["y"]


def test_without_scripts_no_heading_stands_over_a_chart_that_is_not_there(
    new_page: NewPage, board: None
) -> None:
    page = new_page(java_script_enabled=False)
    page.goto(BOARD)
    expect(page.get_by_role("heading", name="Progress over time")).to_be_hidden()


@pytest.mark.parametrize(("has_scripts", "media"), [(False, "screen"), (True, "print")])
def test_a_chart_that_has_its_table_below_the_board_stays_without_scripts_and_on_paper(
    new_page: NewPage, board: None, has_scripts: bool, media: Literal["screen", "print"]
) -> None:
    page = new_page(java_script_enabled=has_scripts)
    page.emulate_media(media=media)
    page.goto(BOARD)
    page.evaluate(NEEDS_NO_SCRIPT)
    expect(page.get_by_role("heading", name="Progress over time")).to_be_visible()


def test_on_paper_no_number_lies_over_its_neighbour(page: Page, board: None) -> None:
    page.set_viewport_size({"width": 1045, "height": 740})
    page.goto(BOARD)
    page.emulate_media(media="print")
    assert page.evaluate(SPILLED) == []
    assert page.evaluate(APART_PX) > 3
    expect(page.get_by_role("heading", name="Progress over time")).to_be_hidden()
