"""A correction from its opening to the board and back, by a maintainer in a real browser."""

import csv
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

import evaluator
from tests.browser.chromium import (
    LOW_CONTRAST,
    NARROW,
    OVERFLOW_PX,
    WIDE,
    least_shift,
    sign_in,
    timers_at_rest,
)
from tests.browser.conftest import NewPage, show, sign_up, submit
from tests.browser.inspection import in_colours
from tests.browser.site import PASSWORD, open_split, predictions, site_to_look_at, worker
from tests.journeys.production import Site, await_that, get

pytestmark = pytest.mark.browser

SPLIT = "val"
KEEPER = "keeper@example.org"
BOARD, FIRST, SECOND = (f"/board/{SPLIT}/{part}" for part in ("", "editions/1/", "editions/2/"))
DESK = f"/maintain/{SPLIT}/editions/2/"
# A tenth of what counts as good: a table's columns may settle by a hair while its rows arrive.
MAX_SHIFT = 0.01


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A site of this module's own: what it publishes would change the boards that others look at."""
    with site_to_look_at(tmp_path_factory.mktemp("corrections")) as running:
        yield running


@pytest.fixture(scope="module")
def val_truth(site: Site) -> evaluator.GroundTruth:
    """The split's ground truth, and a maintainer's account."""
    site.environment["DJANGO_SUPERUSER_PASSWORD"] = PASSWORD
    site.manage("createsuperuser", "--no-input", "--email", KEEPER)
    return open_split(site, SPLIT)


def corrected(site: Site, *, factor: float) -> Path:
    """The split's truth with twelve of its values times a factor."""
    with (site.directory / f"{SPLIT}.csv").open(newline="") as table:
        head, *rows = csv.reader(table)
    column = head.index("ttc")
    for row in rows[:12]:
        row[column] = repr(float(row[column]) * factor)
    path = site.directory / f"{SPLIT}-{factor}.csv"
    with path.open("w", newline="") as table:
        csv.writer(table).writerows([head, *rows])
    return path


def rows(page: Page) -> list[str]:
    """The board's rows, without the tag that only their own team sees."""
    page.goto(BOARD)
    return page.locator("table.board tbody tr").all_inner_texts()


def have_intervals(site: Site, *methods: str) -> bool:
    """Whether these methods' rows are complete: intervals come after the scores."""
    found = [row for row in get(site.url + BOARD).text.split("<tr") if "95 % confidence interval: " in row]
    return all(any(f">{method}</a>" in row for row in found) for method in methods)


def decide(page: Page, *, reason: str, button: str) -> None:
    """Give a reason and go through with it; the page is the board afterwards."""
    page.get_by_label("Reason").fill(reason)
    page.get_by_role("button", name=button).click()
    page.wait_for_url(f"**{BOARD}")


def test_from_opening_to_the_board_and_back(
    new_page: NewPage, site: Site, val_truth: evaluator.GroundTruth
) -> None:
    team, keeper = new_page(), new_page()
    sign_up(team, email="corrected@example.org", name="Corrected")
    for method, factor in (("Near", 1.02), ("Far", 1.3)):
        submit(team, predictions(val_truth, factor=factor), method=method, split=SPLIT)
        show(team)
    with worker(site):
        expect(team.locator("[aria-current=step] .label")).to_have_text("Scored")
        await_that(lambda: have_intervals(site, "Near", "Far"), what="both have their intervals")
    submission, before = team.url, rows(keeper)
    site.manage("open_edition", SPLIT, "--truth", str(corrected(site, factor=3.0)))

    sign_in(keeper, KEEPER)
    keeper.get_by_role("link", name="Maintain").click()
    keeper.get_by_role("link", name="Edition 2").click()
    expect(keeper.locator(".progress-words")).to_have_text("0 %: 0 of 2.")
    keeper.evaluate("window.isTheSamePage = true")
    with worker(site):
        expect(keeper.locator(".progress-words")).to_have_text("Finished: 2 of 2.")
    changed = keeper.locator("table.changes tbody tr")
    expect(changed).to_have_count(2)
    expect(changed.first.locator(".status")).to_have_text("scored")
    expect(keeper.locator(".totals")).to_contain_text("12")
    assert keeper.evaluate("window.isTheSamePage") is True
    keeper.get_by_label("All ten numbers").check()
    expect(changed.first.locator("td:visible")).to_have_count(12)
    assert rows(keeper) == before

    keeper.goto(DESK)
    keeper.get_by_role("link", name="Publish…").click()
    with timers_at_rest(keeper):
        decide(keeper, reason="Twelve boxes were wrong.", button="Publish edition 2")
        # The cross closes the message.
        expect(keeper.locator(".messages[role=status]")).to_have_text(
            f"Edition 2 is now the board of {SPLIT}.×"
        )
    expect(keeper.locator(".facts")).to_contain_text("latest change: edition 2, 12 labels corrected")
    assert rows(keeper) != before
    team.goto(submission)
    expect(team.locator("#outcome .notice")).to_contain_text("Re-scored in edition 2 on")
    expect(team.locator("#outcome .notice")).to_contain_text("Twelve boxes were wrong.")
    team.goto(FIRST)
    expect(team.locator(".notice").first).to_contain_text("Replaced by edition 2")

    keeper.goto("/maintain/")
    keeper.get_by_role("link", name="Roll back to edition 1").click()
    decide(keeper, reason="They were right.", button="Roll back to edition 1")
    assert rows(keeper) == before
    team.goto(SECOND)
    expect(team.locator(".notice").first).to_contain_text("Rolled back to")
    team.goto(f"{BOARD}editions/")
    expect(team.locator(".changelog li")).to_have_count(3)
    expect(team.locator(".changelog li").first).to_contain_text("They were right.")


def test_team_withdraws_its_entry_for_good(page: Page, site: Site, val_truth: evaluator.GroundTruth) -> None:
    sign_up(page, email="withdraws@example.org", name="Withdraws")
    submit(page, predictions(val_truth, factor=1.7), method="Regretted", split=SPLIT)
    show(page)
    with worker(site):
        expect(page.locator("[aria-current=step] .label")).to_have_text("Scored")
    page.get_by_role("link", name="Withdraw this submission…").click()
    page.get_by_role("button", name="Withdraw", exact=True).click()
    expect(page.locator("#outcome .notice")).to_contain_text("Withdrawn by its team on")
    page.goto(BOARD)
    row = page.locator("tr.withdrawn")
    expect(row).to_contain_text("Regretted")
    expect(row.locator("td.primary").first).to_have_text("–")


def test_every_page_of_editions_fits_its_screen_and_can_be_read(
    new_page: NewPage, site: Site, val_truth: evaluator.GroundTruth
) -> None:
    site.manage("open_edition", SPLIT, "--truth", str(corrected(site, factor=5.0)))
    for viewport in (WIDE, NARROW):
        page = new_page(viewport=viewport)
        look_at(page, (BOARD, f"{BOARD}editions/", FIRST, f"{BOARD}?at=2020-01-01"))
        sign_in(page, KEEPER)
        newest = page.goto("/maintain/") and page.locator(".preparing a").first.get_attribute("href")
        assert newest
        look_at(
            page, ("/maintain/", f"/maintain/{SPLIT}/open/", newest, f"{newest}publish/", f"{newest}discard/")
        )
        page.goto(newest)
        page.get_by_label("All ten numbers").check()
        assert page.evaluate(OVERFLOW_PX) <= 0


def look_at(page: Page, addresses: tuple[str, ...]) -> None:
    """Nothing moves while they load, all fits, and every text can be read in the light and in the dark."""
    for address in addresses:
        shift = least_shift(page, partial(opened, page, address), allowed=MAX_SHIFT)
        assert page.evaluate(OVERFLOW_PX) <= 0, f"{address} is wider than the screen"
        assert shift <= MAX_SHIFT, f"{address} moves while it loads"
        for scheme in ("light", "dark"):
            in_colours(page, scheme)
            assert page.evaluate(LOW_CONTRAST) == [], f"{address}, {scheme}"


def opened(page: Page, address: str) -> None:
    answer = page.goto(address)
    assert answer is not None
    assert answer.status == 200, address
