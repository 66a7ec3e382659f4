"""The system's own Chromium, what it complains of on a page, and what axe-core finds there."""

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.support.console_workspace import TOKEN

playwright = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed: pip install 'aerodb[test]'"
)
axe = pytest.importorskip(
    "axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed"
)

CHROMIUM = next(
    (
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    None,
)

#: Most clicks from the overview to what is looked for.
MOST_CLICKS = 3
#: Widths of a window at which pages are looked at.
WIDTHS = (1400, 400)
#: Options of axe-core: all that it checks, and what the colour scheme of a page changes.
_ALL = {"resultTypes": ["violations"]}
_COLOURS = {**_ALL, "runOnly": ["color-contrast", "link-in-text-block"]}
#: What axe-core finds, without the thousands of elements in which it finds nothing.
_BARRIERS = """(options) => axe.run(options).then((found) => found.violations.map(
  (each) => [each.id, each.help, each.nodes.slice(0, 3).map((node) => node.html.slice(0, 160))]))"""
#: For what is waited for at most [ms].
_PATIENCE = 300_000

#: Elements whose text does not fit, and that nobody can scroll; fields hold more than they show by
#: their nature.
CUT = """() => [...document.querySelectorAll('main *, header *, footer *')].filter((e) => {
  const style = getComputedStyle(e);
  if (e.closest('.scroll, .plot, svg, details:not([open])') || e.matches('input, select, textarea, option')) return false;
  return e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1 && style.display !== 'inline' && !e.matches('figcaption');
}).map((e) => `${e.tagName}.${e.className}: ${e.textContent.trim().slice(0, 80)}`)"""
#: Names of rows that are broken within a word, but for words that are longer than any of ours, and
#: captions of which a part is out of sight.
SQUEEZED = """() => {
  const text = (e) => { const whole = document.createRange(); whole.selectNodeContents(e); return whole; };
  const lines = (e) => new Set([...text(e).getClientRects()].map((box) => Math.round(box.bottom / 8))).size;
  const broken = (e) => {
    const words = e.textContent.trim().split(/[^\\p{L}\\p{N}.]+/u);
    return words.every((word) => word.length <= 24) && lines(e) > words.length + 1;
  };
  const hidden = (e) => text(e).getBoundingClientRect().right > e.closest('.scroll').getBoundingClientRect().right + 1;
  const seen = (what) => [...document.querySelectorAll(what)].filter((e) => e.offsetParent);
  return [...seen('main tbody th').filter(broken), ...seen('main .scroll caption, main .scroll figcaption').filter(hidden)]
    .map((e) => `${e.tagName}: ${e.textContent.trim().slice(0, 80)}`);
}"""
#: Pairs of controls that lie on one another.
OVERLAPS = """() => {
  const seen = [...document.querySelectorAll('main a, main button, main input:not([type=hidden]), main select, main h2, nav a')]
    .filter((e) => e.offsetParent && !e.closest('.scroll') && (e.closest('summary') || !e.closest('details:not([open])')))
    .map((e) => [e, e.getBoundingClientRect()]);
  const found = [];
  for (let i = 0; i < seen.length; i++) for (let j = i + 1; j < seen.length; j++) {
    const [[a, p], [b, q]] = [seen[i], seen[j]];
    const across = Math.min(p.right, q.right) - Math.max(p.left, q.left);
    const down = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
    const apart = across <= 2 || down <= 6 || a.contains(b) || b.contains(a);
    if (!apart) found.push(`${a.textContent.trim()} / ${b.textContent.trim()}`);
  }
  return found;
}"""


@contextmanager
def opened() -> Iterator[Any]:
    """Chromium without a window; skips where there is none."""
    if CHROMIUM is None:
        pytest.skip("no Chromium on this system: apt-get install chromium")
    with playwright.sync_playwright() as started:
        options = {"args": ["--no-sandbox"]} if os.geteuid() == 0 else {}
        chromium = started.chromium.launch(executable_path=CHROMIUM, timeout=_PATIENCE, **options)
        yield chromium
        chromium.close()


@contextmanager
def watched(
    browser: Any,
    address: str,
    width: int = 1280,
    token: str = TOKEN,
    answers: Collection[int] = (),
) -> Iterator[Any]:
    """A page of a fresh session of who has the token; fails on any complaint of the browser, but
    those about pages that the console answers with one of these statuses, and on any request to
    another host."""
    expected = tuple(f"responded with a status of {status} " for status in answers)
    complaints: list[str] = []
    elsewhere: list[str] = []
    with browser.new_context(
        viewport={"width": width, "height": 900},
        http_credentials={"username": "anyone", "password": token},
    ) as context:
        context.set_default_timeout(_PATIENCE)
        page = context.new_page()
        page.on(
            "console",
            lambda said: (
                complaints.append(said.text)
                if said.type in ("error", "warning")
                and not any(words in said.text for words in expected)
                else None
            ),
        )
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("dialog", lambda dialog: complaints.append(f"dialog: {dialog.message}"))
        page.on(
            "request",
            lambda asked: elsewhere.append(asked.url) if not _own(asked.url, address) else None,
        )
        yield page
    assert complaints == [], complaints
    assert elsewhere == [], elsewhere


def _own(url: str, address: str) -> bool:
    return url.startswith(("data:", "blob:")) or urlsplit(url).netloc == urlsplit(address).netloc


def visit(page: Any, address: str, path: str) -> None:
    page.goto(f"{address}{path}")
    page.wait_for_load_state("networkidle")


class Clicks:
    """Clicks on a page, counted."""

    def __init__(self, page: Any) -> None:
        self.page, self.made = page, 0

    def on(self, what: str) -> None:
        self.made += 1
        self.page.click(what)
        self.page.wait_for_load_state("networkidle")


def counted(clicks: Clicks) -> None:
    """Few clicks led to what was looked for."""
    print(f"clicks: {clicks.made}")
    assert clicks.made <= MOST_CLICKS


def barriers(page: Any, options: dict[str, Any] = _ALL) -> list[list[Any]]:
    """What axe-core finds with these options of its: rule, help, elements."""
    if page.evaluate("typeof axe === 'undefined'"):  # once for each page that is opened
        page.evaluate(axe.Axe().axe_script)
    found: list[list[Any]] = page.evaluate(_BARRIERS, options)
    return found


def look_everywhere(page: Any, path: str) -> None:
    """Look at a page at `WIDTHS` in both colour schemes."""
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            page.wait_for_load_state("networkidle")  # plots are drawn again
            look(page, f"{path} {scheme}", width, _ALL if scheme == "light" else _COLOURS)


def look(page: Any, path: str, width: int, options: dict[str, Any] = _ALL) -> None:
    """What a picture of a page would show: nothing runs out of it, is cut off, or lies on something
    else, and axe-core with these options finds no barrier."""
    if folder := os.environ.get("AERODB_TEST_PICTURES"):
        page.screenshot(path=f"{folder}/{width}{path.replace('/', '_')[:60]}.png", full_page=True)
    wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(wide) <= 0, path
    for each in (CUT, SQUEEZED, OVERLAPS):
        found = page.evaluate(each)
        assert found == [], (path, width, found)
    found = barriers(page, options)
    assert found == [], (path, width, found)
