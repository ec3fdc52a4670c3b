"""`make screenshots`: photograph a freshly seeded demo for the README, into docs/screenshots/."""

import json
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from playwright.sync_api import Browser

from tests.browser.chromium import chromium, sign_in
from tests.browser.inspection import draw_all
from tests.browser.site import web_alone, worker
from tests.journeys.production import REPOSITORY, Site, await_that

SHOWN: Final = REPOSITORY / "docs" / "screenshots"
# What the README and the documents show: its page, how wide, and in which colours.
PICTURES: Final[dict[str, tuple[str, int, Literal["light", "dark"]]]] = {
    "landing-wide-light": ("/", 1440, "light"),
    "board-wide-light": ("/board/demo/", 1440, "light"),
    "board-narrow-dark": ("/board/demo/", 360, "dark"),
    "compare-wide-light": ("/compare/?split=demo&{two}", 1440, "light"),
    "charts-wide-dark": ("/board/demo/charts/", 1440, "dark"),
    "submit-wide-light": ("/submit/", 1440, "light"),
}
HEIGHT_PX: Final = 900
TIMEOUT_S: Final = 1200.0
COUNT_WAITING: Final = """
from leaderboard.models import Comparison, Edition, Evaluation
print(Evaluation.objects.filter(finished_at=None).count()
      + Comparison.objects.filter(computed_at=None).count()
      + Edition.objects.filter(split="demo", inferred_at=None).count())
"""
# Of anonymous methods no significance is told.
COMPARE: Final = """
import json
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone
from leaderboard.models import Method, Split
from leaderboard.boards import snapshots
from leaderboard.statistics import comparisons
demo = Split.objects.get(pk="demo")
comparisons.of_first(board=snapshots.board(split=demo, viewer=AnonymousUser()))
public = Method.objects.filter(visibility="PUBLIC", submissions__split="demo").order_by("created_at")
two = [method.pk for method in public.exclude(name__startswith="Detection")[:2]]
comparisons.compare(
    methods=two, split=demo, viewer=AnonymousUser(), now=timezone.now()
)
print(json.dumps("&".join(f"m={pk}" for pk in two)))
"""


@dataclass(frozen=True)
class Demo:
    """A running demo, the query of two of its methods, and its account."""

    site: Site
    two: str
    email: str
    password: str


@contextmanager
def demo() -> Iterator[Demo]:
    """A running site with the demo's seed, all of it scored, with intervals, and two methods compared."""
    with tempfile.TemporaryDirectory() as directory, web_alone(Path(directory), TSTTC_THROTTLES="0") as site:
        output = site.manage("seed_demo")
        login = re.search(r"Sign in as (\S+) with the password (\S+)", output)
        assert login, output
        with worker(site):
            await_that(lambda: nothing_waits(site), what="the demo is scored", timeout_s=TIMEOUT_S)
            two = json.loads(site.manage("shell", "-v0", "-c", COMPARE).splitlines()[-1])
            await_that(lambda: nothing_waits(site), what="the methods are compared", timeout_s=TIMEOUT_S)
        yield Demo(site, two, login[1], login[2])


def nothing_waits(site: Site) -> bool:
    return site.manage("shell", "-v0", "-c", COUNT_WAITING).strip() == "0"


def photograph(browser: Browser, shown: Demo) -> None:
    """Each page whole, with its charts drawn."""
    page = browser.new_page(base_url=shown.site.url)
    page.set_default_timeout(TIMEOUT_S * 1000)  # a busy machine is no fault
    for name, (address, width, scheme) in PICTURES.items():
        if address == "/submit/":
            sign_in(page, shown.email, password=shown.password)
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": HEIGHT_PX})
        page.goto(address.format(two=shown.two))
        draw_all(page)
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(full_page=True, path=SHOWN / f"{name}.png")


def main() -> None:
    """Photograph."""
    with demo() as running, chromium() as browser:
        photograph(browser, running)


if __name__ == "__main__":
    main()
