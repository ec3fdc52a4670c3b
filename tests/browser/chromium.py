"""A headless Chromium, and what a page may not do in it."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from urllib.parse import urlsplit

from playwright.sync_api import Browser, BrowserContext, Page, Request, sync_playwright

from tests import services
from tests.browser.site import PASSWORD

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
WIDE = {"width": 1440, "height": 900}
NARROW = {"width": 360, "height": 740}
N_LOADS = 6


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser. Raises `ServiceMissing` where there is none."""
    path = services.chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@dataclass
class Complaints:
    """What a page wrote to its console, what failed in its scripts, and which foreign hosts it asked."""

    host: str
    messages: list[str] = field(default_factory=list)

    def watch(self, context: BrowserContext) -> None:
        """Listen to every page of a context."""
        context.on("console", lambda message: self._note(message.type, message.text))
        context.on("weberror", lambda error: self.messages.append(f"script: {error.error}"))
        context.on("request", self._request)

    def _note(self, kind: str, text: str) -> None:
        if kind in {"error", "warning"}:
            self.messages.append(f"{kind}: {text}")

    def _request(self, request: Request) -> None:
        parts = urlsplit(request.url)
        if parts.scheme != "data" and parts.netloc != self.host:
            self.messages.append(f"request: {request.url}")


@contextmanager
def timers_at_rest(page: Page) -> Iterator[None]:
    """The page's timers stand still: what goes away by itself after some seconds can be looked at."""
    page.clock.install()
    page.clock.pause_at(datetime.now(UTC) + timedelta(hours=1))
    yield
    page.clock.resume()


def tab_to(page: Page, name: str, *, backwards: bool = False) -> None:
    """Press Tab until the element with this name has the focus, as a person without a mouse does."""
    key = "Shift+Tab" if backwards else "Tab"
    passed = []
    for _ in range(80):
        page.keyboard.press(key)
        passed.append(page.evaluate(FOCUSED_NAME))
        if passed[-1] == name:
            return
    raise AssertionError(f"{name!r} is not reached with {key}; passed {passed}")


def sign_in(page: Page, email: str, *, password: str = PASSWORD) -> None:
    """Enter with an account that there is."""
    page.goto("/accounts/login/")
    page.get_by_label("Email").fill(email)
    page.get_by_label("Password", exact=True).fill(password)
    page.get_by_role("button", name="Sign in").click()
    # What people have sent, and where maintainers see what waits for them.
    page.wait_for_url(re.compile("/(submissions|maintain)/$"))


FOCUSED_NAME = """() => {
  const e = document.activeElement;
  const label = e.labels && e.labels[0] ? e.labels[0].innerText : e.innerText;
  return (e.getAttribute("aria-label") || label || "").trim().split("\\n")[0];
}"""

OVERFLOW_PX = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"


# What moved, from where to where: x, y, width, height.
MOVED = """() => new Promise(resolve => {
  const found = [];
  const box = ({x, y, width, height}) => [x, y, width, height].map(Math.round).join(" ");
  const name = node => (node?.outerHTML ?? node?.textContent ?? "gone").trim().slice(0, 80);
  new PerformanceObserver(list => {
    for (const {hadRecentInput, sources} of list.getEntries()) if (!hadRecentInput) {
      for (const {node, previousRect, currentRect} of sources) {
        found.push(`${name(node)}: ${box(previousRect)} to ${box(currentRect)}`);
      }
    }
  }).observe({type: "layout-shift", buffered: true});
  requestAnimationFrame(() => requestAnimationFrame(() => resolve(found)));
})"""

# Every text against the ground it stands on, by WCAG's formula; what is hidden or disabled does not count.
LOW_CONTRAST = """() => {
  const parse = text => {
    const m = text.match(/[\\d.]+/g).map(Number);
    const scale = text.startsWith("color(srgb") ? 255 : 1;
    return [m[0] * scale, m[1] * scale, m[2] * scale, m[3] ?? 1];
  };
  const linear = v => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  // In a drawing a text stands on the last shape that was filled below its middle.
  const below = e => {
    const {x, y, width, height} = e.getBoundingClientRect(), [cx, cy] = [x + width / 2, y + height / 2];
    const shapes = [...e.ownerSVGElement.querySelectorAll("path, rect, circle")].reverse();
    const shape = shapes.find(each => {
      const box = each.getBoundingClientRect(), {fill, fillOpacity} = getComputedStyle(each);
      const isBefore = each.compareDocumentPosition(e) & Node.DOCUMENT_POSITION_FOLLOWING;
      const holds = box.left <= cx && cx <= box.right && box.top <= cy && cy <= box.bottom;
      return isBefore && holds && fill !== "none" && fillOpacity === "1";
    });
    return shape && parse(getComputedStyle(shape).fill);
  };
  const ground = e => {
    if (e instanceof SVGElement && e.ownerSVGElement && below(e)) return below(e);
    for (; e; e = e.parentElement) {
      const c = parse(getComputedStyle(e).backgroundColor);
      if (c[3] === 1) return c;
    }
    return [255, 255, 255, 1];
  };
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const e = walker.currentNode.parentElement, text = walker.currentNode.textContent.trim();
    if (!text || !e.checkVisibility() || e.closest(".spoken, noscript, :disabled")) continue;
    const style = getComputedStyle(e);
    // Text in a drawing is filled; without a fill it is not there.
    const ink = e instanceof SVGElement ? style.fill.replace("none", "rgb(255, 255, 255)") : style.color;
    const [a, b] = [light(parse(ink)), light(ground(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const name = `${e.tagName}.${e.getAttribute("class")}`;
    if (ratio < 4.5) found.push(`${ratio.toFixed(2)} ${name}: ${text.slice(0, 40)}`);
  }
  return found;
}"""
