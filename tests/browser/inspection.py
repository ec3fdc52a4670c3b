"""What may be wrong with any page: what it costs, what moves, what does not fit, what axe finds."""

import gzip
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from playwright.sync_api import Page, expect

from tests.browser.chromium import LOW_CONTRAST, MOVED, N_LOADS, NARROW, OVERFLOW_PX, WIDE

AXE: Final = (Path(__file__).parent / "vendored" / "axe.min.js").read_text(encoding="utf-8")
RUN: Final = """() => axe.run(document, {resultTypes: ["violations"]})
  .then(found => found.violations.flatMap(({id, impact, nodes}) => nodes.map(node =>
    [id, impact, node.target, node.failureSummary].join(": "))))"""
# A chart hears of other colours in one frame, and is drawn anew in the next.
SETTLED: Final = """() => new Promise(resolve => {
  const after = n => n ? requestAnimationFrame(() => after(n - 1)) : resolve();
  after(3);
})"""
MAX_FIRST_BYTES, MAX_BYTES = 100_000, 350_000
LIBRARY: Final = "echarts"
# Bytes as they came over the line, headers included.
TRANSFERRED: Final = """() => ["navigation", "resource"].flatMap(kind => performance.getEntriesByType(kind))
  .map(entry => [entry.name, entry.transferSize])"""
# Intervals in tables and verdicts that go on in the next line, those of closed tables, too.
BROKEN_INTERVALS: Final = r"""() => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), broken = [];
  for (let text; text = texts.nextNode();) {
    if (!text.parentElement.closest("td:not(.guide td), .verdict, .sentence, .score-card")) continue;
    for (const {0: interval, index} of text.data.matchAll(/[+−]?[0-9.]+(?:\sto\s|–)[+−]?[0-9.]+/g)) {
      const range = document.createRange();
      range.setStart(text, index);
      range.setEnd(text, index + interval.length);
      const tops = [...range.getClientRects()].map(line => line.top);
      if (Math.max(...tops) - Math.min(...tops) > 4) broken.push(interval);
    }
  }
  return broken;
}"""
# Sentences in a narrow column of many lines although the screen is wide.
SQUEEZED: Final = """() => [...document.querySelectorAll("main :is(p, dd, li, td)")].filter(each => {
  const {width, height} = each.getBoundingClientRect();
  const nLines = height / parseFloat(getComputedStyle(each).lineHeight);
  return width && width < 144 && nLines > 5 && each.textContent.trim().length > 40;
}).map(each => each.textContent.trim().slice(0, 40))"""
# Half of 1440 and of 1280 px: what is left of them at 200 %.
ZOOMED_PX: Final = (720, 640)
# Chromium's own size of letters is 16.
LARGE_LETTERS: Final = {"standard": 32, "fixed": 26}


def inspected(page: Page, addresses: Iterable[str]) -> Iterator[str]:
    """Everything that is wrong with each of these pages, a sentence each."""
    session = page.context.new_cdp_session(page)
    session.send("Network.enable")
    session.send("Network.setCacheDisabled", {"cacheDisabled": True})  # each is somebody's first visit
    for address in addresses:
        for fault in _faults(page, address):
            yield f"{address}: {fault}"


def _faults(page: Page, address: str) -> Iterator[str]:
    _show(page, WIDE, scheme="light")
    answer = page.goto(address)
    assert answer is not None
    # The proxy compresses whatever is answered (deploy/Caddyfile).
    document_bytes = len(gzip.compress(answer.body()))
    draw_all(page)
    moved = _moved(page)
    page.evaluate(AXE)
    yield from _cost(page, document_bytes)
    yield from (f"moves while it loads: {each}" for each in moved)
    yield from (f"is squeezed at 1440 px: {each}" for each in page.evaluate(SQUEEZED))
    # Every text in both colours at both widths; axe, which takes ten times as long, once.
    yield from axe(page, where="1440 px, light")
    _show(page, WIDE, scheme="dark")
    yield from _pale(page, where="1440 px, dark")
    yield from _large_letters(page)
    for width in ZOOMED_PX:
        page.set_viewport_size({"width": width, "height": 450})
        yield from _overflow(page, f"{width} px")
    _show(page, NARROW, scheme="dark")
    yield from _overflow(page, "360 px")
    yield from _pale(page, where="360 px, dark")
    _show(page, NARROW, scheme="light")
    yield from _pale(page, where="360 px, light")
    yield from (f"the interval {each} breaks at 360 px" for each in page.evaluate(BROKEN_INTERVALS))


def _show(page: Page, viewport: dict[str, int], *, scheme: Any) -> None:
    page.set_viewport_size(viewport)  # type: ignore[arg-type]  # a plain dict of the right shape
    in_colours(page, scheme)


def in_colours(page: Page, scheme: Any) -> None:
    """Show the page in the light or in the dark, its charts as well."""
    page.emulate_media(color_scheme=scheme)
    page.evaluate(SETTLED)


def draw_all(page: Page) -> None:
    """Bring every chart of the page into view, and return once all are drawn."""
    for plot in page.locator("figure.chart .plot").all():
        if plot.is_visible():
            plot.scroll_into_view_if_needed()
            expect(plot.and_(page.locator(".is-drawn"))).to_have_count(1)


def _moved(page: Page) -> list[str]:
    """What moved until the last chart was drawn, however often the page was loaded.

    A busy browser draws a long table in pieces, and its columns settle as they come.
    """
    moves: list[str] = page.evaluate(MOVED)
    for _ in range(N_LOADS - 1):
        if not moves:
            break
        page.reload()
        draw_all(page)
        moves = page.evaluate(MOVED)
    return moves


def _cost(page: Page, document_bytes: int) -> Iterator[str]:
    """Its bytes, the library of charts apart."""
    loaded = dict(page.evaluate(TRANSFERRED)) | {page.url: document_bytes}
    first = sum(size for name, size in loaded.items() if LIBRARY not in name)
    if not 0 < first <= MAX_FIRST_BYTES:
        yield f"{first:,} bytes before a chart comes into view: {loaded}"
    if sum(loaded.values()) > MAX_BYTES:
        yield f"{sum(loaded.values()):,} bytes with its charts: {loaded}"


def axe(page: Page, *, where: str) -> Iterator[str]:
    """What axe finds in a page that has it, of whatever weight, and texts that are too pale."""
    yield from (f"at {where}: {fault}" for fault in page.evaluate(RUN))
    yield from _pale(page, where=where)


def _pale(page: Page, *, where: str) -> Iterator[str]:
    yield from (f"at {where}: {fault}" for fault in page.evaluate(LOW_CONTRAST))


def _overflow(page: Page, where: str) -> Iterator[str]:
    overflow_px = page.evaluate(OVERFLOW_PX)
    if overflow_px > 0:
        yield f"is {overflow_px} px wider than the screen at {where}"


def _large_letters(page: Page) -> Iterator[str]:
    """Check with letters of twice the size, as a person sets them in the browser, and no other zoom."""
    session = page.context.new_cdp_session(page)
    session.send("Page.enable")
    session.send("Page.setFontSizes", {"fontSizes": LARGE_LETTERS})
    yield from _overflow(page, "1440 px with letters of 200 %")
    session.send("Page.setFontSizes", {"fontSizes": {"standard": 16, "fixed": 13}})
    session.detach()
