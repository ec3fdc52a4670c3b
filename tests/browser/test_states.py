"""What is seen for seconds or never: a submission in each of its states, and the pages of failures."""

import json
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Route, expect

from tests.browser.chromium import NARROW, OVERFLOW_PX, sign_in
from tests.browser.conftest import NewPage
from tests.browser.inspection import inspected
from tests.browser.site import PASSWORD, open_split, site_to_look_at
from tests.journeys.production import Site

pytestmark = pytest.mark.browser

SPLIT, OWNER = "val", "states@example.org"
MAKE = f"""
from allauth.account.models import EmailAddress
from leaderboard.models import User
from tests.browser import states
user = User.objects.create_user({OWNER!r}, {PASSWORD!r}, name="Owners")
EmailAddress.objects.create(user=user, email=user.email, verified=True, primary=True)
print(states.make({SPLIT!r}, user.email))
print(states.failures())
"""
# Answered with a code that says what is wrong, of which a browser rightly complains.
WRONG = {"invitation-over", "board-wrong-filter"}
LATE = "Taking longer than usual; nothing is lost."
SPILLED = """() => [...document.querySelectorAll("table.numbers :is(td, th)")]
  .filter(cell => cell.scrollWidth > cell.clientWidth + 1).map(cell => cell.textContent)"""

Made = tuple[dict[str, str], dict[str, str]]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A site of this module's own: no other test's worker may end what stands still."""
    with site_to_look_at(tmp_path_factory.mktemp("states"), TSTTC_THROTTLES="0") as running:
        yield running


@pytest.fixture(scope="module")
def made(site: Site) -> Made:
    """The addresses of the states, and the pages of failures, by name."""
    open_split(site, SPLIT)
    addresses, failures = site.manage("shell", "-v0", "-c", MAKE).splitlines()[-2:]
    return json.loads(addresses), json.loads(failures)


def test_no_state_of_a_submission_has_a_fault(new_page: NewPage, made: Made) -> None:
    page = new_page()
    sign_in(page, OWNER)
    shown = {name: address for name, address in made[0].items() if name not in WRONG}
    assert sum(name.startswith("submission-") for name in shown) == 9
    assert list(inspected(page, shown.values())) == []


def test_no_page_of_a_failure_has_a_fault(browser: Browser, site: Site, made: Made) -> None:
    addresses, failures = made
    with browser.new_context(base_url=site.url) as context:

        def answer(route: Route) -> None:
            name = route.request.url.rpartition("/")[2]
            route.fulfill(body=failures[name], content_type="text/html")

        context.route("**/failures/*", answer)
        shown = [*(f"/failures/{name}" for name in failures), *(addresses[name] for name in sorted(WRONG))]
        assert list(inspected(context.new_page(), shown)) == []


def test_only_what_takes_longer_than_usual_says_so(new_page: NewPage, made: Made) -> None:
    page = new_page()
    sign_in(page, OWNER)
    for name in ("queued", "queued-late", "running", "running-late"):
        page.goto(made[0][f"submission-{name}"])
        expect(page.get_by_text(LATE)).to_have_count(int(name.endswith("-late")))


def test_on_a_phone_no_number_stands_on_the_next(new_page: NewPage, made: Made) -> None:
    page = new_page(viewport=NARROW)
    sign_in(page, OWNER)
    page.goto(made[0]["submission-warned"])
    expect(page.locator("table.numbers")).to_have_count(2)
    assert max(map(len, page.locator("table.numbers tbody tr:first-child td").all_inner_texts())) >= 7
    assert page.evaluate(SPILLED) == []
    assert page.evaluate(OVERFLOW_PX) <= 0
