"""One site for all tests in a browser, and a browser for each module of them."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page, expect

import evaluator
from tests import services
from tests.browser.chromium import WIDE, Complaints, chromium
from tests.browser.site import PASSWORD, open_split, web_alone
from tests.journeys.production import Site

TIMEOUT_MS = 120_000
MAX_PREDICTIONS_BYTES = 200_000

NewPage = Callable[..., Page]

BOARD_OWNER = "board-owner@example.org"
N_SHOWN = 65  # to visitors, of a board with one private row more
FILL = f"""
from datetime import timedelta
from allauth.account.models import EmailAddress
from django.db import transaction
from django.utils import timezone
from leaderboard import board_versions
from leaderboard.models import Evaluation, Method, Publication, Split, Submission, User
from leaderboard.people import teams
from tests import board_rows
user = User.objects.create_user({BOARD_OWNER!r}, {PASSWORD!r}, name="Owners")
EmailAddress.objects.create(user=user, email=user.email, verified=True, primary=True)
methods = board_rows.fill(Split.objects.get(pk="demo").current_edition, n={N_SHOWN + 1}, user=user)
Method.objects.filter(pk=methods[0].pk).update(name="A" * 80)
own = Method.objects.filter(pk=methods[1].pk)
own.update(name="B" * 80, visibility="PRIVATE", team=teams.team_of(user=user))
for rest, days in ((0, 40), (1, 20)):
    earlier = Submission.objects.filter(method__in=methods[rest::3])
    earlier.update(submitted_at=timezone.now() - timedelta(days=days))
# There was a board yesterday.
Publication.objects.filter(edition__split="demo").update(at=timezone.now() - timedelta(days=50))
scored = Evaluation.objects.filter(submission__method__in=methods)
scored.update(finished_at=timezone.now() - timedelta(days=2))
with transaction.atomic():
    board_versions.bump("demo")
"""


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A site without a worker; nothing is started where there is no browser to look at it."""
    limits = {"TSTTC_MAX_PREDICTIONS_BYTES": str(MAX_PREDICTIONS_BYTES), "TSTTC_QUOTAS": "0"}
    limits |= {"TSTTC_THROTTLES": "0"}
    try:
        services.chromium()
    except services.ServiceMissing as missing:
        services.skip_or_fail(missing)
    with web_alone(tmp_path_factory.mktemp("site"), **limits) as running:
        yield running


@pytest.fixture(scope="session")
def truth(site: Site) -> evaluator.GroundTruth:
    """Ground truth of the split `test`, which is open from here on."""
    return open_split(site, "test")


@pytest.fixture(scope="session")
def board(site: Site) -> None:
    """Rows of `demo` on three dates, two with names of 80 letters and no break, one of these private."""
    open_split(site, "demo")
    site.manage("shell", "-v0", "-c", FILL)


@pytest.fixture(scope="module")
def browser(site: Site) -> Iterator[Browser]:
    """A Chromium; closed after each module, because its event loop would be in others' way."""
    expect.set_options(timeout=TIMEOUT_MS)
    with chromium() as running:
        yield running


@pytest.fixture
def new_page(browser: Browser, site: Site) -> Iterator[NewPage]:
    """Opens pages in contexts of their own; at the end none of them may have complained."""
    complaints = Complaints(host=urlsplit(site.url).netloc)
    with ExitStack() as contexts:

        def arrive(**options: object) -> Page:
            context = browser.new_context(**{"base_url": site.url, "viewport": WIDE, **options})  # type: ignore[arg-type]
            context.set_default_timeout(TIMEOUT_MS)
            contexts.callback(context.close)
            complaints.watch(context)
            return context.new_page()

        yield arrive
    assert complaints.messages == []


@pytest.fixture
def page(new_page: NewPage) -> Page:
    """A page on a wide screen, in the light."""
    return new_page()


def sign_up(page: Page, *, email: str, name: str) -> None:
    """Make an account; the site signs it in at once."""
    page.goto("/accounts/signup/")
    page.get_by_label("Email").fill(email)
    page.get_by_label("Name on the board").fill(name)
    page.get_by_label("Password", exact=True).fill(PASSWORD)
    page.get_by_label("Password (again)").fill(PASSWORD)
    page.get_by_role("button", name="Sign up").click()
    page.wait_for_url("**/submit/")


def submit(page: Page, data: bytes, *, method: str, split: str = "test") -> None:
    """Send a file through the form; the page is the submission's afterwards."""
    page.goto("/submit/")
    page.locator(f"input[name=split][value={split}]").check()
    page.get_by_label("Method", exact=True).fill(method)
    page.get_by_label("Prediction file").set_input_files(
        {"name": "predictions.json", "mimeType": "application/json", "buffer": data}
    )
    # With a script the file is checked first, and one with problems is sent once that is asked for.
    expect(page.get_by_text("Checking the file…")).to_have_count(0)
    page.get_by_role("button", name="Submit").click()
    page.wait_for_url("**/submissions/*/")
