"""Charts in a browser: every mark of a large board can be read, nothing moves, and pictures can be kept."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.chromium import LAYOUT_SHIFT, NARROW, OVERFLOW_PX, WIDE
from tests.browser.conftest import NewPage
from tests.browser.inspection import AXE, TRANSFERRED, axe, in_colours
from tests.journeys.production import Site

pytestmark = pytest.mark.browser

SPLIT, N_ROWS = "demo", 66
CHARTS = f"/board/{SPLIT}/charts/"
MAX_FIRST_BYTES, MAX_BYTES = 100_000, 350_000
FILL = f"""
import tempfile
from datetime import timedelta
from pathlib import Path
import numpy as np
from django.db import transaction
from django.utils import timezone
from leaderboard import versions
from leaderboard.demo.runs import simulate
from leaderboard.editions import ground_truth
from leaderboard.models import Edition, Submission, User
from tests import board_rows
truth = simulate(rng=np.random.default_rng({N_ROWS}), n_sequences=200, n_recordings=20)
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "truth.csv"
    path.write_bytes(truth.to_csv())
    ground_truth.import_truth(split_name="{SPLIT}", path=path, now=timezone.now())
user = User.objects.create_user("charts@example.org", name="Charts")
board_rows.fill(Edition.objects.get(split="{SPLIT}"), n={N_ROWS}, user=user)
for i, each in enumerate(Submission.objects.filter(split="{SPLIT}").order_by("pk")):
    Submission.objects.filter(pk=each.pk).update(submitted_at=timezone.now() - timedelta(days=40 * (i % 2)))
with transaction.atomic():
    versions.changed("{SPLIT}")
"""
# The middles of what is drawn as a mark: small, and as wide as high.
MIDDLES = """figure => [...figure.querySelectorAll(".drawing svg path")]
  .map(path => path.getBoundingClientRect())
  .filter(box => box.width > 4 && box.width < 20 && Math.abs(box.width - box.height) < 4)
  .map(box => [box.x + box.width / 2, box.y + box.height / 2])"""
NAMES = """figure => [...figure.querySelectorAll(".drawing svg text[stroke]")].map(text => {
  const {x, y, width, height} = text.getBoundingClientRect(); return [x, y, x + width, y + height];
}).filter(box => box[2] > 0)"""

# The labels below a level axis: what is written in one line above the axis' title, and from where to where.
TIMES = """figure => {
  const texts = [...figure.querySelectorAll(".drawing svg text")]
    .map(text => [text.textContent, text.getBoundingClientRect()]);
  const title = texts.find(([words]) => words.startsWith("Date"))[1];
  return texts.filter(([, box]) => box.top > title.top - 30 && box.bottom < title.top + 4)
    .map(([words, box]) => [words, box.left, box.right]);
}"""


@pytest.fixture(scope="module")
def board(site: Site) -> None:
    """A board of many rows, on two dates."""
    site.manage("shell", "-v0", "-c", FILL)


def drawn(page: Page, kind: str) -> Locator:
    """A chart of the page, in view and drawn."""
    figure = page.locator(f"figure[data-chart={kind}]")
    figure.locator(".plot").scroll_into_view_if_needed()
    expect(figure.locator(".plot.is-drawn svg")).to_be_visible()
    return figure


def read_all(page: Page, figure: Locator) -> set[tuple[str, str]]:
    """Name and first number of every mark, with the pointer on each in turn."""
    return set(_readings(page, figure))


def _readings(page: Page, figure: Locator) -> Iterator[tuple[str, str]]:
    card = figure.locator(".card")
    for x, y in figure.evaluate(MIDDLES):
        page.mouse.move(x, y)
        for name, *lines in card.locator(".entry").evaluate_all(
            "entries => entries.map(entry => [...entry.children].map(part => part.textContent))"
        ):
            found = re.search(r"MiD ([\d.]+)", " ".join(lines))
            assert found is not None, lines
            yield name, found[1]


def rows(figure: Locator, name: int, value: int) -> set[tuple[str, str]]:
    """The same from the table beside it."""
    texts = figure.locator("tbody tr").evaluate_all(
        "rows => rows.map(row => [...row.cells].map(cell => cell.textContent.trim()))"
    )
    return {(row[name], row[value]) for row in texts}


@pytest.mark.parametrize(("viewport", "scheme"), [(WIDE, "light"), (NARROW, "dark")])
def test_every_mark_of_a_large_board_is_read_where_it_stands(
    new_page: NewPage, board: None, viewport: dict[str, int], scheme: str
) -> None:
    page = new_page(viewport=viewport, color_scheme=scheme)
    page.goto(CHARTS)
    for kind, name, value in (("progress", 1, 3), ("latency", 0, 4)):
        figure = drawn(page, kind)
        expected = rows(figure, name, value)
        assert len(expected) == N_ROWS
        assert read_all(page, figure) == expected
    assert page.evaluate(OVERFLOW_PX) <= 0


def test_pointer_far_from_every_mark_reads_nothing(page: Page, board: None) -> None:
    page.goto(CHARTS)
    figure = drawn(page, "latency")
    middles = figure.evaluate(MIDDLES)
    box = figure.locator(".drawing").bounding_box()
    assert box is not None
    lowest = max(y for _, y in middles)
    page.mouse.move(box["x"] + box["width"] / 2, lowest + 45)
    expect(figure.locator(".card")).to_be_hidden()


def test_arrow_keys_read_every_mark_and_enter_opens_its_method(page: Page, board: None) -> None:
    page.goto(CHARTS)
    figure = drawn(page, "progress")
    figure.locator(".drawing").focus()
    names = set()
    for _ in range(N_ROWS):
        page.keyboard.press("ArrowRight")
        names.add(figure.locator(".card .entry a").first.inner_text())
    assert names == {name for name, _ in rows(figure, 1, 3)}
    page.keyboard.press("Home")
    name = figure.locator(".card .entry a").first.inner_text()
    page.keyboard.press("Enter")
    page.wait_for_url("**/methods/*/")
    expect(page.locator("h1")).to_have_text(name)


def test_click_near_a_mark_opens_its_method(page: Page, board: None) -> None:
    page.goto(CHARTS)
    figure = drawn(page, "latency")
    x, y = figure.evaluate(MIDDLES)[-1]
    page.mouse.move(x + 3, y - 3)
    name = figure.locator(".card .entry a").first.inner_text()
    page.mouse.click(x + 3, y - 3)
    page.wait_for_url("**/methods/*/")
    expect(page.locator("h1")).to_have_text(name)


def test_names_at_the_front_do_not_overlap(new_page: NewPage, board: None) -> None:
    for viewport in (WIDE, NARROW):
        page = new_page(viewport=viewport)
        page.goto(CHARTS)
        for kind in ("progress", "latency"):
            figure = drawn(page, kind)
            boxes = figure.evaluate(NAMES)
            assert boxes
            frame = figure.locator(".drawing").bounding_box()
            assert frame is not None
            assert all(frame["x"] <= box[0] and box[2] <= frame["x"] + frame["width"] for box in boxes)
            assert [1 for i, a in enumerate(boxes) for b in boxes[:i] if overlaps(a, b)] == []


def overlaps(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("address", [CHARTS, "/board/test/charts/"])
def test_no_two_labels_of_a_time_axis_are_equal_and_none_is_cut(
    page: Page, board: None, address: str
) -> None:
    page.goto(address)
    figure = drawn(page, "progress")
    labels = figure.evaluate(TIMES)
    words = [each[0] for each in labels]
    assert len(words) > 1
    assert len(set(words)) == len(words)
    frame = figure.locator(".drawing").bounding_box()
    assert frame is not None
    assert all(frame["x"] <= left and right <= frame["x"] + frame["width"] for _, left, right in labels)


def test_a_method_of_another_board_leads_back_to_that_board(page: Page, board: None) -> None:
    page.goto(f"/board/{SPLIT}/")
    page.locator("table.board .name a").first.click()
    page.wait_for_url("**/methods/*/")
    assert page.locator(".trail a").get_attribute("href") == f"/board/{SPLIT}/"
    page.get_by_role("navigation", name="Main").get_by_role("link", name="Board").click()
    page.wait_for_url(f"**/board/{SPLIT}/")


def test_library_comes_with_the_first_chart_in_view_and_nothing_moves(page: Page, board: None) -> None:
    page.goto(f"/board/{SPLIT}/")
    before = dict(page.evaluate(TRANSFERRED))
    assert not [name for name in before if "echarts" in name]
    assert 0 < sum(before.values()) <= MAX_FIRST_BYTES, before
    shift = page.evaluate(LAYOUT_SHIFT)
    drawn(page, "progress")
    after = dict(page.evaluate(TRANSFERRED))
    assert [name for name in after if "echarts" in name]
    assert sum(after.values()) <= MAX_BYTES, after
    assert page.evaluate(LAYOUT_SHIFT) == shift


def test_chart_follows_light_and_dark(page: Page, board: None) -> None:
    page.goto(CHARTS)
    legend = drawn(page, "progress").locator("svg text", has_text="Best so far")
    light = legend.get_attribute("fill")
    page.emulate_media(color_scheme="dark")
    expect(legend).not_to_have_attribute("fill", light or "")


def test_without_a_script_the_table_stands_in_the_place_of_the_chart(new_page: NewPage, board: None) -> None:
    page = new_page(java_script_enabled=False)
    page.goto(CHARTS)
    for kind in ("progress", "latency", "profile"):
        figure = page.locator(f"figure[data-chart={kind}]")
        expect(figure.locator(".plot")).to_be_hidden()
        expect(figure.locator("tbody tr").first).to_be_visible()


def test_paper_has_the_drawing_and_the_whole_table(page: Page, board: None) -> None:
    page.goto(CHARTS)
    figure = drawn(page, "profile")
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 703, "height": 1000})
    expect(figure.locator("svg").first).to_be_visible()
    expect(figure.locator("tbody tr").last).to_be_visible()
    expect(page.locator("figure[data-chart=progress] tbody tr").first).to_be_visible()
    assert page.evaluate(OVERFLOW_PX) <= 0


def test_chart_is_kept_as_svg_and_png(page: Page, board: None, tmp_path: Path) -> None:
    page.emulate_media(color_scheme="dark")
    page.goto(CHARTS)
    figure = drawn(page, "progress")
    svg = kept(page, figure, "svg", tmp_path).decode()
    assert svg.startswith("<svg")
    assert "Best so far" in svg
    assert "#ffffff" in svg  # for paper, whatever the screen
    png = kept(page, figure, "png", tmp_path)
    assert png.startswith(b"\x89PNG")
    assert int.from_bytes(png[16:20]) == 2280


def kept(page: Page, figure: Locator, kind: str, folder: Path) -> bytes:
    with page.expect_download() as download:
        figure.locator(f"[data-download={kind}]").click()
    assert download.value.suggested_filename == f"tsttc-{SPLIT}-progress.{kind}"
    download.value.save_as(folder / kind)
    return (folder / kind).read_bytes()


def test_what_a_mark_says_can_be_read_in_the_light_and_in_the_dark(page: Page, board: None) -> None:
    page.goto(CHARTS)
    figure = drawn(page, "latency")
    page.evaluate(AXE)
    for scheme in ("light", "dark"):
        in_colours(page, scheme)
        page.mouse.move(0, 0)  # a chart that is drawn anew shows no card until the pointer moves
        page.mouse.move(*figure.evaluate(MIDDLES)[-1])
        expect(figure.locator(".card")).to_be_visible()
        assert list(axe(page, where=scheme)) == []
