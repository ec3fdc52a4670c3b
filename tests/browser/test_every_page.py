"""What holds of every page, light and dark, wide and narrow, with scripts or not; where methods differ."""

import json
import re
from uuid import UUID

import pytest
from playwright.sync_api import Browser, Page, Route, expect

import evaluator
from tests.browser import world
from tests.browser.addresses import addresses
from tests.browser.chromium import NARROW, OVERFLOW_PX, WIDE, sign_in
from tests.browser.conftest import NewPage
from tests.browser.inspection import AXE, axe, inspected
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
    "action_name": "rename-team",
    "chosen": "csv",
    "secret": "none",
    "handle": str(UUID(int=0)),
    "invitation_id": str(UUID(int=0)),
}
PAIR = "/compare/?split=val&m={method_id}&m={second_method_id}"
VIEWS = (
    "/board/val/?columns=mid&nerf=no",
    "/board/val/?columns=rte&q=nothing+like+it",
    "/compare/?split=val",
    PAIR,
    "/compare/?split=val&{five}",
    "/docs/search/?q=quota",
)
# Answered with a code that says what is wrong, of which a browser rightly complains.
WRONG = {"invitation-over", "board-wrong-filter"}
FAULTS = ("/nowhere/", f"/board/{world.SPLIT}/?sort=nothing", f"/board/{world.SPLIT}/?at=never")
# A difference with its sign and interval, and p with its class.
CARD = re.compile(r"MiD [−+]\d+\.\d\d \([−+].+ to [−+].+\)\s*p .+: (p < 0\.\d+|not significant)$")
# What does nothing unless a script hears it.
DEAD = """() => [...document.querySelectorAll("button[type=button], .tray, .messages .close")]
  .filter(each => each.checkVisibility()).map(each => each.outerHTML.slice(0, 120))"""


@pytest.fixture(scope="module")
def known(site: Site, truth: evaluator.GroundTruth) -> dict[str, str]:
    """One of each kind of thing, to fill addresses with."""
    made = world.populated(site)
    return {**OTHERS, "split": world.SPLIT, "number": "1", "subject_id": made["team_id"], **made}


@pytest.fixture(scope="module")
def states(site: Site, known: dict[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """The addresses of a submission in each of its states, and the pages of failures, by name."""
    code = (
        f"from tests.browser import states as s; print(s.make('test', {world.OWNER!r})); print(s.failures())"
    )
    addresses, failures = site.manage("shell", "-v0", "-c", code).splitlines()[-2:]
    return json.loads(addresses), json.loads(failures)


@pytest.fixture(scope="module")
def public(site: Site, known: dict[str, str]) -> list[str]:
    """Every page that anybody may read."""
    asked = [*addresses(known), *(view.format(**known) for view in VIEWS)]
    return answered_with_pages(site, asked, cookies={})


def cookies_of(page: Page) -> dict[str, str]:
    return {cookie["name"]: cookie["value"] for cookie in page.context.cookies()}


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
    draft = [f"/maintain/val/editions/2/{part}" for part in ("", "publish/", "discard/")]
    views = [f"/maintain/queue/?state={state}" for state in ("failed", "waiting")]
    assert list(inspected(page, [*desk, *draft, *views, "/maintain/teams/?team=owls"])) == []


def test_no_page_that_says_what_was_wrong_has_a_fault(browser: Browser, site: Site) -> None:
    # A context of its own: the browser complains, rightly, of every 404.
    with browser.new_context(base_url=site.url) as context:
        assert list(inspected(context.new_page(), FAULTS)) == []


def test_no_state_of_a_submission_has_a_fault(
    new_page: NewPage, states: tuple[dict[str, str], dict[str, str]]
) -> None:
    page = new_page()
    sign_in(page, world.OWNER)
    shown = {name: address for name, address in states[0].items() if name not in WRONG}
    assert sum(name.startswith("submission-") for name in shown) == 9
    assert list(inspected(page, shown.values())) == []


def test_no_page_of_a_failure_has_a_fault(
    browser: Browser, site: Site, states: tuple[dict[str, str], dict[str, str]]
) -> None:
    addresses, failures = states
    with browser.new_context(base_url=site.url) as context:

        def answer(route: Route) -> None:
            name = route.request.url.rpartition("/")[2]
            route.fulfill(body=failures[name], content_type="text/html")

        context.route("**/failures/*", answer)
        shown = [*(f"/failures/{name}" for name in failures), *(addresses[name] for name in sorted(WRONG))]
        assert list(inspected(context.new_page(), shown)) == []


def test_what_looks_for_faults_finds_one_that_is_there(page: Page, site: Site) -> None:
    page.goto("/docs/")
    page.evaluate(AXE)
    page.evaluate("document.querySelector('main').append(document.createElement('button'))")
    (fault,) = axe(page, where="here")
    assert fault.startswith("at here: button-name: critical")


def test_without_scripts_every_public_page_fits_and_nothing_on_it_is_dead(
    new_page: NewPage, public: list[str]
) -> None:
    page = new_page(java_script_enabled=False)
    faults_at = {}
    for address in public:
        page.goto(address)
        for viewport in (NARROW, WIDE):
            page.set_viewport_size(viewport)  # type: ignore[arg-type]  # a plain dict of the right shape
            faults_at[address, viewport["width"]] = (max(0, page.evaluate(OVERFLOW_PX)), page.evaluate(DEAD))
    assert {where: faults for where, faults in faults_at.items() if faults != (0, [])} == {}


def test_without_scripts_the_landing_page_has_no_heading_over_a_chart_that_is_not_there(
    new_page: NewPage, known: dict[str, str]
) -> None:
    page = new_page(java_script_enabled=False)
    page.goto("/")
    expect(page.locator("h2", has_text="Progress over time")).to_have_count(1)
    expect(page.locator("h2", has_text="Progress over time")).to_be_hidden()


# --- where methods differ ----------------------------------------------------------------------------------


def test_contact_lens_moves_by_keyboard_and_its_numbers_with_it(page: Page, known: dict[str, str]) -> None:
    page.goto(PAIR.format(**known))
    slider, time, numbers = (page.locator(f"#lens{part}") for part in ("-slider", "-time", " dd span"))
    vehicle = page.locator("#lens-vehicle")
    slider.press("Home")
    expect(time).to_have_text("20.0 s")
    far, errors = vehicle.get_attribute("transform") or "", numbers.all_inner_texts()
    for _ in range(3):  # beyond the middle of the last range errors stay
        slider.press("PageUp")
    expect(time).not_to_have_text("20.0 s")
    expect(slider).to_have_attribute("aria-valuetext", time.inner_text().replace(" s", " seconds"))
    expect(vehicle).not_to_have_attribute("transform", far)
    assert not set(errors) & set(numbers.all_inner_texts())
    slider.press("End")
    expect(numbers).to_have_text(["0.00 s, 0.0 m"] * 2)


def test_without_a_script_the_table_replaces_the_contact_lens(
    new_page: NewPage, known: dict[str, str]
) -> None:
    page = new_page(java_script_enabled=False)
    page.goto(PAIR.format(**known))
    expect(page.locator("#lens-slider")).to_be_hidden()
    expect(page.locator("#lens-table tbody tr").first).to_be_visible()


def test_cell_of_the_significance_chart_says_sign_size_and_significance(
    page: Page, known: dict[str, str]
) -> None:
    page.goto(f"/board/{world.SPLIT}/charts/")
    figure = page.locator("figure[data-chart=significance]")
    figure.locator(".plot").scroll_into_view_if_needed()
    difference = figure.locator("tbody tr").first.locator("td").nth(2).text_content() or ""
    expect(figure.locator(".drawing svg text", has_text=difference).first).to_be_visible()
    figure.locator(".drawing").press("Home")
    expect(figure.locator(".card")).to_contain_text(CARD)
    expect(figure.locator(".card")).to_contain_text(difference)
