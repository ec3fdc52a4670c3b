"""Charts in a browser: every mark of a large board can be read, nothing moves, and pictures can be kept."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.chromium import MOVED, NARROW, OVERFLOW_PX, WIDE
from tests.browser.conftest import N_SHOWN, NewPage
from tests.browser.inspection import AXE, SETTLED, TRANSFERRED, axe, in_colours

pytestmark = pytest.mark.browser

SPLIT = "demo"
CHARTS = f"/board/{SPLIT}/charts/"
MAX_FIRST_BYTES, MAX_BYTES = 100_000, 350_000
# The middles of what is drawn as a mark: small, and as wide as high.
MIDDLES = """figure => [...figure.querySelectorAll(".drawing svg path")]
  .map(path => path.getBoundingClientRect())
  .filter(box => box.width > 4 && box.width < 20 && Math.abs(box.width - box.height) < 4)
  .map(box => [box.x + box.width / 2, box.y + box.height / 2])"""
NAMES = """figure => [...figure.querySelectorAll(".drawing svg text[stroke]")].map(text => {
  const {x, y, width, height} = text.getBoundingClientRect(); return [x, y, x + width, y + height];
}).filter(box => box[2] > 0)"""


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
            match = re.search(r"MiD ([\d.]+)", " ".join(lines))
            assert match is not None, lines
            yield name, match[1]


def rows(figure: Locator, name: int, value: int) -> set[tuple[str, str]]:
    """The same from the table next to it."""
    texts = figure.locator("tbody tr").evaluate_all(
        "rows => rows.map(row => [...row.cells].map(cell => cell.textContent.trim()))"
    )
    return {(row[name], row[value]) for row in texts}


def show_last(page: Page, figure: Locator) -> None:
    """Show the card of the last mark, again where a busy browser has resized the chart meanwhile."""
    card = figure.locator(".card")
    figure.locator(".drawing").focus()
    for _ in range(5):
        page.keyboard.press("End")
        page.evaluate(SETTLED)
        if card.is_visible():
            break
    expect(card).to_be_visible()


@pytest.mark.parametrize(("viewport", "scheme"), [(WIDE, "light"), (NARROW, "dark")])
def test_every_mark_of_a_large_board_is_read_where_it_stands(
    new_page: NewPage, board: None, viewport: dict[str, int], scheme: str
) -> None:
    page = new_page(viewport=viewport, color_scheme=scheme)
    page.goto(CHARTS)
    for kind, name, value in (("progress", 1, 3), ("latency", 0, 4)):
        figure = drawn(page, kind)
        expected = rows(figure, name, value)
        assert len(expected) == N_SHOWN
        assert read_all(page, figure) == expected
    assert page.evaluate(OVERFLOW_PX) <= 0


def test_arrow_keys_read_every_mark_and_enter_opens_its_method(page: Page, board: None) -> None:
    page.goto(CHARTS)
    figure = drawn(page, "progress")
    figure.locator(".drawing").focus()
    names = set()
    for _ in range(N_SHOWN):
        page.keyboard.press("ArrowRight")
        names.add(figure.locator(".card .entry a").first.inner_text())
    assert names == {name for name, _ in rows(figure, 1, 3)}
    page.keyboard.press("Home")
    name = figure.locator(".card .entry a").first.inner_text()
    page.keyboard.press("Enter")
    page.wait_for_url("**/methods/*/")
    expect(page.locator("h1")).to_have_text(name)


def test_names_at_the_front_do_not_overlap(new_page: NewPage, board: None) -> None:
    for viewport in (WIDE, NARROW):
        page = new_page(viewport=viewport)
        page.goto(CHARTS)
        for kind in ("progress", "latency"):
            figure = drawn(page, kind)
            frame = figure.locator(".drawing").bounding_box()
            assert frame is not None
            # A name without room is put aside, to the left of the drawing: on a phone maybe each of them.
            boxes = [box for box in figure.evaluate(NAMES) if box[2] > frame["x"]]
            assert boxes or viewport is NARROW
            assert all(frame["x"] <= box[0] and box[2] <= frame["x"] + frame["width"] for box in boxes)
            assert [1 for i, a in enumerate(boxes) for b in boxes[:i] if overlaps(a, b)] == []


def overlaps(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def test_library_comes_with_the_first_chart_in_view_and_nothing_moves(page: Page, board: None) -> None:
    page.goto(f"/board/{SPLIT}/")
    before = dict(page.evaluate(TRANSFERRED))
    assert not [name for name in before if "echarts" in name]
    assert 0 < sum(before.values()) <= MAX_FIRST_BYTES, before
    moved = page.evaluate(MOVED)  # a busy browser draws a long table in pieces
    drawn(page, "progress")
    after = dict(page.evaluate(TRANSFERRED))
    assert [name for name in after if "echarts" in name]
    assert sum(after.values()) <= MAX_BYTES, after
    assert page.evaluate(MOVED) == moved


def test_chart_follows_light_and_dark(page: Page, board: None) -> None:
    page.goto(CHARTS)
    legend = drawn(page, "progress").locator("svg text", has_text="Best so far")
    light = legend.get_attribute("fill")
    page.emulate_media(color_scheme="dark")
    expect(legend).not_to_have_attribute("fill", light or "")


def test_a_page_has_one_hint_how_to_read_its_charts(page: Page, board: None) -> None:
    page.goto(CHARTS)
    assert page.locator(".plot-foot").count() > 1
    expect(page.locator(".hint:visible")).to_have_count(1)


def test_without_a_script_the_table_replaces_the_chart(new_page: NewPage, board: None) -> None:
    page = new_page(java_script_enabled=False)
    page.goto(CHARTS)
    for kind in ("progress", "latency", "profile"):
        figure = page.locator(f"figure[data-chart={kind}]")
        expect(figure.locator(".plot")).to_be_hidden()
        expect(figure.locator("tbody tr").first).to_be_visible()


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
        show_last(page, figure)
        assert list(axe(page, where=scheme)) == []
