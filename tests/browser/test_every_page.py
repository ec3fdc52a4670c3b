"""What holds of every page that the site has: light and dark, wide and narrow, with scripts and without."""

import re
from uuid import UUID

import pytest
from playwright.sync_api import Browser, Page, expect

import evaluator
from tests.browser import world
from tests.browser.addresses import addresses
from tests.browser.chromium import MOVED, NARROW, OVERFLOW_PX, WIDE, sign_in, timers_at_rest
from tests.browser.conftest import NewPage
from tests.browser.inspection import AXE, axe, draw_all, inspected
from tests.browser.site import answered_with_pages
from tests.journeys.production import Site

pytestmark = pytest.mark.browser

# What leads to no page, or to none that a sample is needed for.
OTHERS = {
    "guide_name": "file-format",
    "operation_id": "submit",
    "page_name": "privacy",
    "wheel_name": "none.whl",
    "table_name": "main-results",
    "suffix": "csv",
    "slug": "none",
    "deed_name": "rename-team",
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
    "/compare/?split=val&{five}",
    "/docs/search/?q=quota",
)
FAULTS = ("/nowhere/", f"/board/{world.SPLIT}/?sort=nothing", f"/board/{world.SPLIT}/?at=never")
# What does nothing unless a script hears it.
DEAD = """() => [...document.querySelectorAll("button[type=button], .tray, .messages .close")]
  .filter(each => each.checkVisibility()).map(each => each.outerHTML.slice(0, 120))"""
# Boxes that scroll sideways.
SCROLLING = """() => [...document.querySelectorAll(".scroll")]
  .filter(box => box.scrollWidth > box.clientWidth).map(box => box.getAttribute("aria-label"))"""
MAX_LINE_PX = 40
MIN_GAP_PX = 8
CUT_OFF = """() => [...document.querySelectorAll("td, th")].filter(cell => cell.checkVisibility()
    && (cell.getBoundingClientRect().right > innerWidth + 1 || cell.scrollWidth > cell.clientWidth + 4))
  .map(cell => cell.textContent.trim())"""

# Of each error axis of the figure's charts: its title, and its numbers.
ERROR_AXES = """figure => {
  const texts = [...figure.querySelectorAll(".drawing svg text")]
    .map(text => [text.textContent, text.getBoundingClientRect()]);
  return texts.filter(([words]) => /^(MiD|RTE),/.test(words)).map(([title, head]) => [title, texts
    .filter(([words, box]) => /^[0-9.]+$/.test(words) && Math.abs(box.right - head.left - 20) < 45)
    .map(([words]) => words)]);
}"""
# How far the permalink stands below what is above it, and what sticks out of the tables of numbers.
PERMALINK_GAP_PX = """() => {
  const address = document.querySelector(".address");
  return address.getBoundingClientRect().top - address.previousElementSibling.getBoundingClientRect().bottom;
}"""
STICKING_OUT = """() => [...document.querySelectorAll("table.numbers")].flatMap(table =>
  [...table.querySelectorAll("td *")].map(part => [part.textContent, part.getBoundingClientRect().right])
    .filter(([, right]) => right > table.getBoundingClientRect().right + 0.5))"""


@pytest.fixture(scope="module")
def known(site: Site, truth: evaluator.GroundTruth) -> dict[str, str]:
    """One of each kind of thing, to fill addresses with."""
    made = world.populated(site)
    return {**OTHERS, "split": world.SPLIT, "number": "1", "subject_id": made["team_id"], **made}


@pytest.fixture(scope="module")
def public(site: Site, known: dict[str, str]) -> list[str]:
    """Every page that anybody may read."""
    asked = [*addresses(known), *(view.format(**known) for view in VIEWS)]
    return answered_with_pages(site, asked, cookies={})


def cookies_of(page: Page) -> dict[str, str]:
    return {cookie["name"]: cookie["value"] for cookie in page.context.cookies()}


def test_the_list_of_public_pages_is_taken_from_the_site_itself(
    public: list[str], known: dict[str, str]
) -> None:
    assert [view.format(**known) for view in VIEWS if view.format(**known) not in public] == []
    assert {
        "/board/val/charts/",
        "/",
        "/board/val/",
        f"/methods/{known['method_id']}/",
        "/docs/",
        "/accounts/signup/",
    } <= set(public)
    assert [address for address in public if address.startswith(("/maintain/", "/submissions/"))] == []


def test_no_public_page_has_a_fault(new_page: NewPage, public: list[str]) -> None:
    assert list(inspected(new_page(), public)) == []


def test_no_page_of_the_signed_in_has_a_fault(
    new_page: NewPage, site: Site, public: list[str], known: dict[str, str]
) -> None:
    page = new_page()
    sign_in(page, world.OWNER)
    mine = answered_with_pages(site, addresses(known), cookies=cookies_of(page))
    assert {"/submit/", "/submissions/", f"/submissions/{known['submission_id']}/"} <= set(mine)
    own = [f"/submissions/{known['rejected_id']}/", f"/methods/{known['private_method_id']}/", "/board/val/"]
    assert list(inspected(page, [*sorted(set(mine) - set(public)), *own])) == []


def test_no_page_of_maintainers_has_a_fault(new_page: NewPage, site: Site, known: dict[str, str]) -> None:
    page = new_page()
    sign_in(page, world.MAINTAINER)
    asked = [each for each in addresses(known) if each.startswith("/maintain/")]
    desk = answered_with_pages(site, asked, cookies=cookies_of(page))
    team = f"/maintain/quotas/{known['team_id']}/"
    assert {"/maintain/", "/maintain/queue/", "/maintain/quotas/", team, f"{team}val/end/"} <= set(desk)
    views = [f"/maintain/queue/?state={state}" for state in ("failed", "waiting")]
    assert list(inspected(page, [*desk, *views, "/maintain/quotas/?team=owls"])) == []


def test_on_a_phone_maintainers_have_cards_and_a_menu_of_one_line(
    new_page: NewPage, known: dict[str, str]
) -> None:
    page = new_page(viewport=NARROW)
    sign_in(page, world.MAINTAINER)
    team = f"/maintain/quotas/{known['team_id']}/"
    for address in ("/maintain/audit/", "/maintain/queue/", "/maintain/quotas/", team):
        page.goto(address)
        assert page.evaluate(SCROLLING) == [], address
        assert page.evaluate("document.querySelector('.site-account').clientHeight") < MAX_LINE_PX


def test_no_page_that_says_what_was_wrong_has_a_fault(browser: Browser, site: Site) -> None:
    # A context of its own: the browser complains, rightly, of every 404.
    with browser.new_context(base_url=site.url) as context:
        assert list(inspected(context.new_page(), FAULTS)) == []


def test_what_looks_for_faults_finds_one_that_is_there(page: Page, site: Site) -> None:
    page.goto("/docs/")
    page.evaluate(AXE)
    page.evaluate("document.querySelector('main').append(document.createElement('button'))")
    (found,) = axe(page, where="here")
    assert found.startswith("at here: button-name: critical")


def test_without_scripts_every_public_page_fits_and_nothing_on_it_is_dead(
    new_page: NewPage, public: list[str]
) -> None:
    page = new_page(java_script_enabled=False)
    found = {}
    for address in public:
        page.goto(address)
        for viewport in (NARROW, WIDE):
            page.set_viewport_size(viewport)  # type: ignore[arg-type]  # a plain dict of the right shape
            found[address, viewport["width"]] = (max(0, page.evaluate(OVERFLOW_PX)), page.evaluate(DEAD))
    assert {where: faults for where, faults in found.items() if faults != (0, [])} == {}


def test_without_scripts_a_search_is_answered(new_page: NewPage, known: dict[str, str]) -> None:
    page = new_page(java_script_enabled=False)
    page.goto("/board/val/")
    page.get_by_role("searchbox").fill("flow")
    page.get_by_role("button", name="Search").click()
    page.wait_for_url(lambda url: "q=flow" in url)
    expect(page.locator("table.board tbody tr")).to_have_count(1)


def test_a_message_moves_nothing_when_it_comes_and_when_it_goes(
    new_page: NewPage, known: dict[str, str]
) -> None:
    page = new_page()
    sign_in(page, world.OWNER)
    with timers_at_rest(page):
        page.get_by_role("button", name="Sign out").click()
        message = page.locator(".messages .message")
        message.hover()  # so it stays
    assert page.evaluate(MOVED) == []
    message.get_by_role("button", name="Close").click()
    expect(message).to_have_count(0)
    assert page.evaluate(MOVED) == []


def test_comparison_of_five_is_printed_on_one_sheet_and_nothing_is_cut_off(
    new_page: NewPage, known: dict[str, str]
) -> None:
    page = new_page()
    page.goto(f"/compare/?split=val&{known['five']}")
    draw_all(page)
    assert page.pdf(format="A4").count(b"/Type /Page\n") == 1
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 703, "height": 1000})
    assert page.evaluate(OVERFLOW_PX) <= 0
    assert page.evaluate(CUT_OFF) == []


def test_error_axes_of_a_comparison_begin_at_zero_or_say_that_they_do_not(
    page: Page, known: dict[str, str]
) -> None:
    page.goto(f"/compare/?split=val&m={known['method_id']}&m={known['second_method_id']}")
    draw_all(page)
    axes = page.locator("figure.chart").first.evaluate(ERROR_AXES)
    assert [title[:3] for title, _ in axes] == ["MiD", "RTE"]
    assert [title for title, numbers in axes if "log scale" not in title and "0" not in numbers] == []
    assert all(numbers for _, numbers in axes)


def test_permalink_stands_apart_and_no_interval_sticks_out_of_its_table(
    new_page: NewPage, known: dict[str, str]
) -> None:
    for viewport in (NARROW, WIDE):
        page = new_page(viewport=viewport)
        page.goto(f"/methods/{known['method_id']}/")
        assert page.evaluate(PERMALINK_GAP_PX) >= MIN_GAP_PX
        assert page.evaluate(STICKING_OUT) == []


def test_attempts_say_whose_they_are_without_a_pointer(new_page: NewPage, known: dict[str, str]) -> None:
    page = new_page(viewport=NARROW, has_touch=True)
    page.goto("/board/val/")
    attempts = page.locator("table.board .attempts")
    expect(attempts.first).to_have_text(re.compile("team attempts?$"))
    assert attempts.evaluate_all("all => all.filter(each => each.closest('[title]')).length") == 0
    page.locator(".legend summary").tap()
    expect(page.get_by_text("Team attempts: scored submissions of all public methods")).to_be_visible()
