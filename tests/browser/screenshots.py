"""`make screenshots`: photograph every page of a freshly seeded demo, light and dark, wide and narrow.

All of them go to build/screenshots/, to be looked at; those that the README and the documents show are kept
in docs/screenshots/ as well.
"""

import itertools
import json
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from playwright.sync_api import Browser, Page

from tests.browser.chromium import NARROW, WIDE, chromium, sign_in
from tests.browser.pictures import smaller
from tests.browser.site import web_alone, worker
from tests.journeys.production import REPOSITORY, Site, await_that

EVERYTHING: Final = REPOSITORY / "build" / "screenshots"
SHOWN: Final = REPOSITORY / "docs" / "screenshots"
# What the README and the documents show.
KEPT: Final = (
    "landing-wide-light",
    "board-wide-light",
    "board-narrow-dark",
    "compare-wide-light",
    "charts-wide-dark",
    "submit-wide-light",
)
SCREENS: Final = {"wide": WIDE, "narrow": NARROW}
SCHEMES: Final[tuple[Literal["light", "dark"], ...]] = ("light", "dark")
PATIENCE_S: Final = 300.0
COUNT_WAITING: Final = """
from leaderboard.models import Comparison, Edition, Evaluation
print(Evaluation.objects.filter(finished_at=None).count()
      + Comparison.objects.filter(computed_at=None).count()
      + Edition.objects.filter(split="demo", inferred_at=None).count())
"""
ASK: Final = """
import json
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone
from leaderboard.models import Method, Split, Submission
from leaderboard.scoring import comparisons
shown = Method.objects.exclude(visibility="PRIVATE").filter(submissions__split="demo").order_by("created_at")
pair = [method.pk for method in shown[:2]]
comparisons.of(methods=pair, split=Split.objects.get(pk="demo"), viewer=AnonymousUser(), now=timezone.now())
own = Submission.objects.filter(submitted_by__email="demo@example.org")
print(json.dumps({
    "a": str(pair[0]), "b": str(pair[1]),
    "scored": str(own.get(method__name="Detection, box height").pk),
    "rejected": str(own.get(method__name="First try").pk),
    "own": str(own.get(method__name="Detection, box height").method_id),
}))
"""
PUBLIC: Final = {
    "landing": "/",
    "board": "/board/demo/",
    "board-mid": "/board/demo/?columns=mid&nerf=no",
    "published": "/board/test/",
    "charts": "/board/demo/charts/",
    "compare": "/compare/?split=demo&m={a}&m={b}",
    "choose": "/compare/?split=demo",
    "method": "/methods/{a}/",
    "editions": "/board/demo/editions/",
    "edition": "/board/demo/editions/1/",
    "docs": "/docs/",
    "api": "/docs/api/",
    "api-operation": "/docs/api/submit/",
    "guide": "/docs/researchers/",
    "docs-search": "/docs/search/?q=quota",
    "install": "/dist/",
    "rules": "/rules/",
    "privacy": "/privacy/",
    "sign-in": "/accounts/login/",
    "sign-up": "/accounts/signup/",
    "nothing": "/nowhere/",
}
PRIVATE: Final = {
    "submit": "/submit/",
    "submissions": "/submissions/",
    "submission-scored": "/submissions/{scored}/",
    "submission-rejected": "/submissions/{rejected}/",
    "analysis": "/submissions/{scored}/analysis/",
    "method-edit": "/methods/{own}/edit/",
    "team": "/team/",
    "tokens": "/tokens/",
}


@dataclass(frozen=True)
class Demo:
    """A running demo, what can be looked at there, and its account."""

    site: Site
    known: dict[str, str]
    email: str
    password: str


@contextmanager
def demo() -> Iterator[Demo]:
    """A running site with the demo's seed, all of it scored, with intervals, and one comparison."""
    with tempfile.TemporaryDirectory() as directory, web_alone(Path(directory)) as site:
        said = site.manage("seed_demo")
        login = re.search(r"Sign in as (\S+) with the password (\S+)", said)
        assert login, said
        with worker(site):
            await_that(lambda: nothing_waits(site), what="the demo is scored", patience_s=PATIENCE_S)
            known = json.loads(site.manage("shell", "-v0", "-c", ASK).splitlines()[-1])
            await_that(lambda: nothing_waits(site), what="the methods are compared", patience_s=PATIENCE_S)
        yield Demo(site, known, login[1], login[2])


def nothing_waits(site: Site) -> bool:
    return site.manage("shell", "-v0", "-c", COUNT_WAITING).strip() == "0"


def photograph(page: Page, address: str, name: str, *, darkroom: Page) -> None:
    """One page, whole; kept for the documents if they show it."""
    page.goto(address)
    page.evaluate("document.fonts.ready")
    picture = page.screenshot(full_page=True)
    (EVERYTHING / f"{name}.png").write_bytes(picture)
    if name in KEPT:
        (SHOWN / f"{name}.png").write_bytes(smaller(picture, page=darkroom))


def photograph_all(browser: Browser, demo: Demo) -> None:
    """Every page on every screen."""
    darkroom = browser.new_page()
    for scheme, (size, viewport) in itertools.product(SCHEMES, SCREENS.items()):
        page = browser.new_context(
            base_url=demo.site.url,
            viewport=viewport,  # type: ignore[arg-type]  # a plain dict of the right shape
            color_scheme=scheme,
        ).new_page()
        for name, address in PUBLIC.items():
            photograph(page, address.format(**demo.known), f"{name}-{size}-{scheme}", darkroom=darkroom)
        sign_in(page, demo.email, password=demo.password)
        for name, address in PRIVATE.items():
            photograph(page, address.format(**demo.known), f"{name}-{size}-{scheme}", darkroom=darkroom)
        page.context.close()


def main() -> None:
    """Photograph."""
    for folder in (EVERYTHING, SHOWN):
        folder.mkdir(parents=True, exist_ok=True)
    with demo() as running, chromium() as browser:
        photograph_all(browser, running)


if __name__ == "__main__":
    main()
