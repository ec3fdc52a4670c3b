"""`make screenshots`: photograph every page of a freshly seeded demo, on five screens, light and dark.

They go to build/screenshots/, or where `--into` says, to be looked at: a sheet for each page with all of its
photographs, and these one by one. `--keep` renews those that the README and the documents show, in
docs/screenshots/. `--only` names pages, by a part of their name.
"""

import argparse
import json
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from playwright.sync_api import Browser, BrowserContext, Page

from tests.browser.chromium import chromium, sign_in
from tests.browser.inspection import draw_all
from tests.browser.pictures import smaller
from tests.browser.site import PASSWORD, answered_with_pages, web_alone, worker
from tests.journeys.production import REPOSITORY, Site, await_that

SHOWN: Final = REPOSITORY / "docs" / "screenshots"
# What the README and the documents show: its page, how wide, and in which colours.
KEPT: Final = {
    "landing-wide-light": ("home", 1440, "light"),
    "board-wide-light": ("board", 1440, "light"),
    "board-narrow-dark": ("board", 360, "dark"),
    "compare-wide-light": ("compare-two", 1440, "light"),
    "charts-wide-dark": ("charts", 1440, "dark"),
    "submit-wide-light": ("submit", 1440, "light"),
}
WIDTHS_PX: Final = (360, 768, 1280, 1440, 1920)
HEIGHT_PX: Final = 900
SCHEMES: Final[tuple[Literal["light", "dark"], ...]] = ("light", "dark")
# A sheet shows this much of a page.
SHEET_PX, MAX_SHOWN_PX = 2000, 2400
PATIENCE_S: Final = 1200.0
KEEPER: Final = "keeper@example.org"
COUNT_WAITING: Final = """
from leaderboard.models import Comparison, Edition, Evaluation
print(Evaluation.objects.filter(finished_at=None).count()
      + Comparison.objects.filter(computed_at=None).count()
      + Edition.objects.filter(split="demo", inferred_at=None).count())
"""
NO_ID: Final = "00000000-0000-4000-8000-000000000000"
SAMPLES: Final = {
    "split": "demo",
    "number": "1",
    "guide_name": "uncertainty",
    "operation_id": "submit",
    "page_name": "rules",
    "wheel_name": "none.whl",
    "table_name": "main-results",
    "suffix": "csv",
    "slug": "none",
    "deed_name": "rename-team",
    "chosen": "csv",
    "secret": "none",
    "handle": NO_ID,
    "invitation_id": NO_ID,
}
ASK: Final = f"""
import json
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone
from leaderboard.models import Method, Split, Submission
from leaderboard.scoring import comparisons
from tests.browser.addresses import named_addresses
shown = Method.objects.exclude(visibility="PRIVATE").filter(submissions__split="demo").order_by("created_at")
five = [method.pk for method in shown[:5]]
# Of anonymous methods no significance is told.
two = [method.pk for method in shown.filter(visibility="PUBLIC").exclude(name__startswith="Detection")[:2]]
split, viewer, now = Split.objects.get(pk="demo"), AnonymousUser(), timezone.now()
for chosen in (two, five):
    comparisons.of(methods=chosen, split=split, viewer=viewer, now=now)
own = Submission.objects.filter(submitted_by__email="demo@example.org")
scored = own.get(method__name="Detection, box height")
known = {SAMPLES!r} | {{
    "two": "&".join(f"m={{pk}}" for pk in two),
    "five": "&".join(f"m={{pk}}" for pk in five),
    "public_id": str(five[0]),
    "rejected_id": str(own.get(method__name="First try").pk),
    "submission_id": str(scored.pk),
    "method_id": str(scored.method_id),
    "team_id": str(scored.method.team_id),
    "subject_id": str(scored.method.team_id),
}}
print(json.dumps([known, named_addresses(known)]))
"""
# Kinds of pages that are not seen at a pattern with the samples alone.
VIEWS: Final = {
    "board-mid": "/board/demo/?columns=mid&nerf=no",
    "board-nothing-found": "/board/demo/?q=nothing+like+it",
    "board-published": "/board/test/",
    "compare-two": "/compare/?split=demo&{two}",
    "compare-five": "/compare/?split=demo&{five}",
    "method-public": "/methods/{public_id}/",
    "submission-rejected": "/submissions/{rejected_id}/",
    "publish": "/methods/{method_id}/visibility/?visibility=PUBLIC",
    "docs-found": "/docs/search/?q=quota",
    "docs-not-found": "/docs/search/?q=nothing+like+it",
    "nothing": "/nowhere/",
}
# What no address shows unless something fails; they are shown there in the place of an answer.
FAILURES: Final = "/failures/"


@dataclass(frozen=True)
class Demo:
    """A running demo, what can be looked at there, and its account."""

    site: Site
    known: dict[str, str]
    named: dict[str, str]  # addresses by the names of their patterns
    email: str
    password: str
    failures: dict[str, str]  # pages by their names


@contextmanager
def demo() -> Iterator[Demo]:
    """A running site with the demo's seed, all of it scored, with intervals, and two comparisons."""
    with tempfile.TemporaryDirectory() as directory, web_alone(Path(directory), TSTTC_THROTTLES="0") as site:
        said = site.manage("seed_demo")
        login = re.search(r"Sign in as (\S+) with the password (\S+)", said)
        assert login, said
        site.environment["DJANGO_SUPERUSER_PASSWORD"] = PASSWORD
        site.manage("createsuperuser", "--no-input", "--email", KEEPER)
        with worker(site):
            await_that(lambda: nothing_waits(site), what="the demo is scored", patience_s=PATIENCE_S)
            known, named = json.loads(site.manage("shell", "-v0", "-c", ASK).splitlines()[-1])
            await_that(lambda: nothing_waits(site), what="the methods are compared", patience_s=PATIENCE_S)
        named |= asked(site, f"states.make('demo', {login[1]!r})")
        yield Demo(site, known, named, login[1], login[2], asked(site, "states.failures()"))


def asked(site: Site, call: str) -> dict[str, str]:
    """What a function of `tests.browser.states` answers in a process of the site."""
    said = site.manage("shell", "-v0", "-c", f"from tests.browser import states; print({call})")
    return dict(json.loads(said.splitlines()[-1]))


def nothing_waits(site: Site) -> bool:
    return site.manage("shell", "-v0", "-c", COUNT_WAITING).strip() == "0"


def signed_in(browser: Browser, demo: Demo, *, email: str, password: str) -> BrowserContext:
    """A context in which somebody is."""
    context = browser.new_context(base_url=demo.site.url)
    context.set_default_timeout(PATIENCE_S * 1000)  # a busy machine is no fault
    page = context.new_page()
    sign_in(page, email, password=password)
    page.close()
    return context


def sights(browser: Browser, demo: Demo) -> Iterator[tuple[BrowserContext, dict[str, str]]]:
    """Everybody that there is with the pages that nobody before could see, by name."""
    views = {name: view.format(**demo.known) for name, view in VIEWS.items()}
    left = demo.named | views
    # These are answered with a code that says what is wrong, so they are not among the pages that are there.
    wrong = {name: left.pop(name) for name in ("nothing", "board-wrong-filter", "invitation-over")}
    yield browser.new_context(base_url=demo.site.url), wrong
    failing = browser.new_context(base_url=demo.site.url)
    for name, page in demo.failures.items():
        failing.route(
            f"**{FAILURES}{name}",
            lambda route, _, page=page: route.fulfill(body=page, content_type="text/html"),
        )
    yield failing, {name: FAILURES + name for name in demo.failures}
    for context in (
        browser.new_context(base_url=demo.site.url),
        signed_in(browser, demo, email=demo.email, password=demo.password),
        signed_in(browser, demo, email=KEEPER, password=PASSWORD),
    ):
        cookies = {cookie["name"]: cookie["value"] for cookie in context.cookies()}
        seen = set(answered_with_pages(demo.site, set(left.values()), cookies=cookies))
        yield context, {name: address for name, address in left.items() if address in seen}
        left = {name: address for name, address in left.items() if address not in seen}


@dataclass(frozen=True)
class Studio:
    """Where photographs are made, where they go, and which of them are kept."""

    darkroom: Page
    folder: Path
    keeps: bool

    def photograph(self, page: Page, name: str, address: str) -> None:
        """One page on every screen, whole, with its charts drawn; and a sheet of all."""
        made = []
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            for width in WIDTHS_PX:
                page.set_viewport_size({"width": width, "height": HEIGHT_PX})
                page.goto(address)
                draw_all(page)
                page.evaluate("scrollTo(0, 0)")
                picture = page.screenshot(full_page=True)
                made.append(self.folder / f"{name}-{width}-{scheme}.png")
                made[-1].write_bytes(picture)
                for kept, wanted in KEPT.items():
                    if self.keeps and wanted == (name, width, scheme):
                        (SHOWN / f"{kept}.png").write_bytes(smaller(picture, page=self.darkroom))
        self._sheet(name, made)

    def _sheet(self, name: str, made: list[Path]) -> None:
        """All photographs of a page in two rows, each as wide as its screen is of all together."""
        scale = SHEET_PX / sum(WIDTHS_PX)
        images = [
            f'<img src="{path.name}" style="width:{scale * width}px;max-height:{scale * MAX_SHOWN_PX}px;'
            'object-fit:cover;object-position:top;outline:1px solid #888;margin:2px">'
            for path, width in zip(made, 2 * WIDTHS_PX, strict=True)
        ]
        rows = "<br>".join("".join(images[i : i + len(WIDTHS_PX)]) for i in (0, len(WIDTHS_PX)))
        sheet = self.folder / "sheet.html"
        sheet.write_text(f'<body style="margin:8px;white-space:nowrap">{rows}')
        self.darkroom.set_viewport_size({"width": SHEET_PX + 60, "height": HEIGHT_PX})
        self.darkroom.goto(sheet.as_uri())
        self.darkroom.screenshot(path=self.folder / f"sheet-{name}.png", full_page=True)
        sheet.unlink()


def main() -> None:
    """Photograph."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--into", type=Path, default=REPOSITORY / "build" / "screenshots")
    asked.add_argument("--only", nargs="*", default=[""])
    asked.add_argument("--keep", action="store_true")
    wanted = asked.parse_args()
    for folder in (wanted.into, SHOWN):
        folder.mkdir(parents=True, exist_ok=True)
    with demo() as running, chromium() as browser:
        studio = Studio(browser.new_page(), wanted.into.resolve(), keeps=wanted.keep)
        for context, pages in sights(browser, running):
            page = context.new_page()
            for name, address in pages.items():
                if any(part in name for part in wanted.only):
                    studio.photograph(page, name, address)
            context.close()


if __name__ == "__main__":
    main()
