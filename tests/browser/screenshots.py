"""`make screenshots`: photograph the pages of a freshly seeded demo into docs/screenshots/."""

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, Page, expect

from tests.browser.chromium import NARROW, WIDE, chromium
from tests.browser.site import web_alone, worker
from tests.journeys.production import REPOSITORY, Site, await_that

FOLDER = REPOSITORY / "docs" / "screenshots"
SCREENS = {"wide": WIDE, "narrow": NARROW}
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
PATIENCE_S = 300.0
COUNT_WAITING = """
from leaderboard.models import Evaluation
print(Evaluation.objects.filter(finished_at=None).count())
"""


@contextmanager
def demo() -> Iterator[tuple[Site, str, str]]:
    """A running site with the demo's seed, all of it scored; and the login of the demo's account."""
    with tempfile.TemporaryDirectory() as directory, web_alone(Path(directory)) as site:
        said = site.manage("seed_demo")
        login = re.search(r"Sign in as (\S+) with the password (\S+)", said)
        assert login, said
        with worker(site):
            await_that(
                lambda: site.manage("shell", "-v0", "-c", COUNT_WAITING).strip() == "0",
                what="the demo's submissions are scored",
                patience_s=PATIENCE_S,
            )
        yield site, login[1], login[2]


def photograph(page: Page, address: str, name: str) -> None:
    page.goto(address)
    page.evaluate("document.fonts.ready")
    page.screenshot(path=FOLDER / f"{name}.png", full_page=True)


def public_pages(browser: Browser, site: Site) -> None:
    for scheme in SCHEMES:
        for size, viewport in SCREENS.items():
            context = browser.new_context(
                base_url=site.url,
                viewport=viewport,  # type: ignore[arg-type]  # a plain dict of the right shape
                color_scheme=scheme,
                device_scale_factor=2 if size == "narrow" else 1,
            )
            page = context.new_page()
            photograph(page, "/board/demo/", f"board-{size}-{scheme}")
            if size == "wide":
                photograph(page, "/board/test/", f"published-{scheme}")
            context.close()


def private_pages(browser: Browser, site: Site, email: str, password: str) -> None:
    page = browser.new_context(base_url=site.url, viewport=WIDE).new_page()  # type: ignore[arg-type]  # as above
    page.goto("/accounts/login/")
    page.get_by_label("Email").fill(email)
    page.get_by_label("Password").fill(password)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url("**/submit/")
    photograph(page, "/submit/", "submit")
    for state in ("scored", "rejected"):
        page.goto("/submissions/")
        rows = page.locator(f"tr:has(.state-{state}) a")
        if rows.count():
            rows.first.click()
            expect(page.locator("[aria-current=step]")).to_contain_text(state.capitalize())
            photograph(page, page.url, f"submission-{state}")


def main() -> None:
    """Photograph."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with demo() as (site, email, password), chromium() as browser:
        public_pages(browser, site)
        private_pages(browser, site, email, password)


if __name__ == "__main__":
    main()
