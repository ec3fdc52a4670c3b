"""Every page before and after a change of templates or styles: the same documents, the same photographs.

    python -m tests.browser.photographs world FOLDER        make a site with something on each page
    python -m tests.browser.photographs read FOLDER OUT     write each page's document, as a browser reads it
    python -m tests.browser.photographs take FOLDER OUT     photograph each page
    python -m tests.browser.photographs compare OUT OTHER   list what differs between two folders of one kind

The site of FOLDER is served by the tree in which the command runs, always at the same address: run `read` and
`take` once in the tree before the change and once in the tree after it.
"""

import json
import logging
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path
from typing import Final, Literal

import django
import httpx2
import numpy as np
from PIL import Image
from playwright.sync_api import Page

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
django.setup()

# ruff: noqa: E402 - the world is made of models, which need the settings first
from tests.browser import world
from tests.browser.addresses import addresses
from tests.browser.chromium import chromium, sign_in
from tests.browser.inspection import draw_all
from tests.browser.site import PASSWORD, WEB, answered_with_pages, environment, open_split, web_alone, worker
from tests.browser.test_every_page import FAULTS, OTHERS, VIEWS
from tests.journeys.production import TIMEOUT_S, Site, web_process

PORT: Final = 8799
URL: Final = f"http://127.0.0.1:{PORT}"
SETTINGS: Final = {"TSTTC_QUOTAS": "0", "TSTTC_THROTTLES": "0", "TSTTC_MAX_PREDICTIONS_BYTES": "200000"}
KNOWN: Final = "known.json"
WIDTHS: Final = (390, 1024, 1440)
SCHEMES: Final[tuple[Literal["light", "dark"], ...]] = ("light", "dark")
VISITOR: Final = "visitor"
ROLES: Final = {VISITOR: "", "owner": world.OWNER, "maintainer": world.MAINTAINER}
# So many colour steps (of 255) are left to the smoothing of letters.
SMOOTHING: Final = 24

# Where white space between texts shows; elsewhere it does not.
INLINE: Final = frozenset(
    {
        *(
            "a",
            "abbr",
            "b",
            "bdi",
            "button",
            "code",
            "cite",
            "em",
            "i",
            "input",
            "kbd",
            "label",
            "mark",
            "output",
        ),
        *("q", "s", "select", "small", "span", "strong", "sub", "sup", "time", "u", "var", "wbr"),
        *("math", "mi", "mn", "mo", "mrow", "msub", "msup", "mfrac"),
    }
)
AS_WRITTEN: Final = frozenset({"pre", "textarea", "script", "style"})
# The token of a form, and the digest in the name of a style or script.
RANDOM: Final = re.compile(
    r'(?<=name="csrfmiddlewaretoken" value=")[^"]+|(?<=X-CSRFToken": ")[^"]+'
    r"|(?<=\.)[0-9a-f]{12}(?=\.(?:css|js)\b)"
)


def main(arguments: Sequence[str]) -> int:
    """Run one of the commands above; a last argument is a pattern of the addresses to look at."""
    logging.getLogger("httpx2").setLevel(logging.WARNING)
    match arguments:
        case ["world", folder]:
            make_world(Path(folder))
        case ["read", folder, out, *only]:
            with served(Path(folder)) as site:
                read(site, Path(out), only="|".join(only))
        case ["take", folder, out, *only]:
            with served(Path(folder)) as site:
                take(site, Path(out), only="|".join(only))
        case ["compare", one, other]:
            lines = list(compare(Path(one), Path(other)))
            sys.stdout.write("\n".join([*lines, f"{len(lines)} differ"]) + "\n")
        case _:
            sys.stdout.write(__doc__ or "")
            return 2
    return 0


def make_world(folder: Path) -> None:
    """Make a site in an empty folder, and write down one identifier of each kind of thing."""
    folder.mkdir(parents=True)
    with web_alone(folder, **SETTINGS) as site, worker(site):
        known = world.populated(site)
        open_split(site, "test")
        states = site.manage(
            "shell",
            "-v0",
            "-c",
            f"from tests.browser import states as s; print(s.make('test', {world.OWNER!r}))",
        )
    known["states"] = json.loads(states.splitlines()[-1])
    (folder / KNOWN).write_text(json.dumps(known))


@contextmanager
def served(folder: Path) -> Iterator[Site]:
    """Serve the site of a folder by this tree, without a worker."""
    site = Site(url=URL, directory=folder, environment=environment(folder, url=URL, **SETTINGS))
    site.manage("migrate", "--no-input", "-v0")
    with web_process(site, command=(*WEB, f"--listen=127.0.0.1:{PORT}", "leaderboard.wsgi:application")):
        yield site


def pages_of(site: Site, role: str, *, cookies: dict[str, str], only: str) -> list[str]:
    """Return the addresses of the pages that a person with this role looks at."""
    known = json.loads((site.directory / KNOWN).read_text())
    states = known.pop("states")
    samples = {**OTHERS, "split": world.SPLIT, "number": "1", "subject_id": known["team_id"], **known}
    asked = [*addresses(samples), *(view.format(**samples) for view in VIEWS)]
    if role == VISITOR:
        asked += FAULTS
    elif role == "owner":
        asked += [*states.values(), f"/submissions/{known['rejected_id']}/"]
        asked += [f"/methods/{known['private_method_id']}/", f"/board/{world.SPLIT}/?intervals=1"]
    else:
        asked = [each for each in asked if each.startswith("/maintain/")]
        asked += [f"/maintain/val/editions/2/{part}" for part in ("", "publish/", "discard/")]
        asked += ["/maintain/queue/?state=failed", "/maintain/teams/?team=owls"]
    asked = [each for each in dict.fromkeys(asked) if re.search(only, each)]
    return [*answered_with_pages(site, asked, cookies=cookies), *(each for each in FAULTS if each in asked)]


def cookies_of(site: Site, email: str) -> dict[str, str]:
    """Sign in without a browser, and return the cookies."""
    if not email:
        return {}
    with httpx2.Client(base_url=site.url, timeout=TIMEOUT_S, trust_env=False) as client:
        form = client.get("/accounts/login/")
        token = re.search(r'name="csrfmiddlewaretoken" value="([^"]+)"', form.text)
        assert token is not None
        data = {"login": email, "password": PASSWORD, "csrfmiddlewaretoken": token[1]}
        client.post("/accounts/login/", data=data, headers={"Referer": f"{site.url}/accounts/login/"})
        return dict(client.cookies)


def read(site: Site, out: Path, *, only: str) -> None:
    """Write the document of each page, one tag or text a line."""
    out.mkdir(parents=True, exist_ok=True)
    for role, email in ROLES.items():
        cookies = cookies_of(site, email)
        with httpx2.Client(base_url=site.url, timeout=TIMEOUT_S, trust_env=False, cookies=cookies) as client:
            for address in pages_of(site, role, cookies=cookies, only=only):
                text = RANDOM.sub("…", client.get(address).text)
                (out / f"{name_of(role, address)}.txt").write_text("\n".join(lines_of(text)) + "\n")


def take(site: Site, out: Path, *, only: str) -> None:
    """Photograph each page, whole, in all widths and both schemes."""
    out.mkdir(parents=True, exist_ok=True)
    with chromium() as browser:
        for role, email in ROLES.items():
            with browser.new_context(base_url=site.url, reduced_motion="reduce") as context:
                page = context.new_page()
                if email:
                    sign_in(page, email)
                cookies = {str(each.get("name")): str(each.get("value")) for each in context.cookies()}
                for address in pages_of(site, role, cookies=cookies, only=only):
                    _photograph(page, address, out / name_of(role, address))


def _photograph(page: Page, address: str, target: Path) -> None:
    page.goto(address)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            draw_all(page)
            page.screenshot(path=f"{target}-{width}-{scheme}.png", full_page=True, animations="disabled")


def name_of(role: str, address: str) -> str:
    return f"{role}{re.sub(r'[^A-Za-z0-9]+', '-', address)[:150]}"


def compare(one: Path, other: Path) -> Iterator[str]:
    """Yield a line for each page that differs, or that only one folder has."""
    names = [{path.name for path in folder.iterdir()} for folder in (one, other)]
    for name in sorted(names[0] ^ names[1]):
        yield f"{name}: only in {(one if name in names[0] else other).name}"
    for name in sorted(names[0] & names[1]):
        is_picture = name.endswith(".png")
        difference = (_of_pictures if is_picture else _of_documents)(one / name, other / name)
        if difference:
            yield f"{name}: {difference}"


def _of_documents(one: Path, other: Path) -> str:
    before, after = one.read_text().splitlines(), other.read_text().splitlines()
    pairs = zip([*before, ""], [*after, ""], strict=False)
    for number, (was, now) in enumerate(pairs, 1):
        if was != now:
            n_lines = sum(left != right for left, right in zip(before, after, strict=False))
            return f"line {number}: {was[:120]!r} is {now[:120]!r} (about {n_lines} lines)"
    return ""


def _of_pictures(one: Path, other: Path) -> str:
    before, after = (np.asarray(Image.open(path).convert("RGB"), dtype=np.int16) for path in (one, other))
    if before.shape != after.shape:
        return f"{before.shape[1]} × {before.shape[0]} px is {after.shape[1]} × {after.shape[0]} px"
    is_other = np.abs(before - after).max(axis=2) > SMOOTHING
    if not is_other.any():
        return ""
    rows, columns = (np.flatnonzero(is_other.any(axis=axis)) for axis in (1, 0))
    box = f"x {columns[0]} to {columns[-1]}, y {rows[0]} to {rows[-1]}"
    return f"{int(is_other.sum()):,} px differ within {box}"


class _Lines(HTMLParser):
    """Writes a document as lines, with white space only where it shows."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._open: list[str] = []
        self._has_space, self._is_begun = False, False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._boundary(tag)
        parts = []
        for name, value in sorted(attrs):
            words = (value or "").split()
            parts.append(f'{name}="{" ".join(sorted(words) if name == "class" else words)}"')
        self.lines.append(f"<{' '.join([tag, *parts])}>")
        self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        self._boundary(tag)
        while self._open and self._open.pop() != tag:
            pass
        self.lines.append(f"</{tag}>")

    def handle_data(self, data: str) -> None:
        if AS_WRITTEN.intersection(self._open):
            self.lines.append(repr(data))
            return
        # A no-break space is a letter.
        words = [word for word in re.split(r"[ \t\r\n\f]+", data) if word]
        self._has_space |= data[:1] in " \t\r\n\f"
        if words:
            space = " " if self._has_space and self._is_begun else ""
            self.lines.append(f"{space}{' '.join(words)}")
            self._has_space, self._is_begun = data[-1] in " \t\r\n\f", True

    def _boundary(self, tag: str) -> None:
        if tag not in INLINE:
            self._has_space = self._is_begun = False


def lines_of(document: str) -> list[str]:
    """Return a document as lines, one for each tag and text.

    >>> lines_of('<p class="b a">One <b>two</b>\\n three </p>')
    ['<p class="a b">', 'One', '<b>', ' two', '</b>', ' three', '</p>']
    """
    reader = _Lines()
    reader.feed(document)
    reader.close()
    return reader.lines


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
