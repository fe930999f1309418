# SPDX-License-Identifier: BSD-3-Clause
"""The built documentation site, without a network: links, pictures, search, and how it looks.

`./run docs` builds it and runs this.
"""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from chromium import open_browser
from playwright.sync_api import Browser, Page, expect
from website.contents import SEARCHED

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build/docs/html"
PICTURES = ROOT / "build/docs/screenshots"

pytestmark = pytest.mark.skipif(
    not (SITE / "index.html").exists(), reason="the site is not built: ./run docs"
)


class References(HTMLParser):
    """What a page has: anchors, links, and files that it shows or runs."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if name == "id" and value:
                self.anchors.add(value)
            elif name in ("href", "src") and value:
                self.links.add(value)


@pytest.fixture(scope="module")
def pages() -> dict[Path, References]:
    return {path: References(path) for path in sorted(SITE.rglob("*.html"))}


def test_every_link_leads_somewhere(pages: dict[Path, References]) -> None:
    wrong = []
    for page, references in pages.items():
        for link in references.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            anchors = {"", *pages[target].anchors} if target in pages else {parts.fragment}
            if not target.exists() or unquote(parts.fragment) not in anchors:
                wrong.append(f"{page.relative_to(SITE)}: {link}")
    assert wrong == []


def test_needs_no_network(pages: dict[Path, References]) -> None:
    for path in pages:
        text = path.read_text()
        for tag in ('<script src="http', '<link rel="stylesheet" type="text/css" href="http'):
            assert tag not in text, path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def search_page(browser: Browser) -> Iterator[Page]:
    """The page of the search, from a file, without a server."""
    context = browser.new_context()
    context.set_default_timeout(60_000)
    page = context.new_page()
    page.goto(f"file://{SITE}/search.html?q=robot")
    page.locator("ul.search > li > a").first.wait_for()
    yield page
    context.close()


SEARCH = """words => {
    history.replaceState(null, "", `?q=${encodeURIComponent(words)}`);
    document.querySelector("#search-results").replaceChildren();
    Search.performSearch(words);
}"""


def found(search_page: Page, words: str) -> list[str]:
    """The paths of the first pages that a search finds."""
    search_page.evaluate(SEARCH, words)
    search_page.wait_for_function(
        "document.querySelector('p.search-summary')?.innerText.match(/found|match/i)"
    )
    links = search_page.locator("ul.search > li > a")
    targets = [str(links.nth(i).get_attribute("href")) for i in range(min(5, links.count()))]
    return [target.partition("?")[0].partition("#")[0] for target in targets]


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        ("recover", "reference/programs/recover.html"),
        ("fingers.height", "reference/configuration/trifinger.html"),
        ("append_desired_action", "reference/python/trifinger.html"),
    ],
)
def test_a_search_finds_the_page_that_answers(search_page: Page, words: str, answer: str) -> None:
    assert answer in found(search_page, words)


@pytest.mark.parametrize(("page", "words"), SEARCHED.items(), ids=SEARCHED)
def test_what_readers_search_for_comes_first(
    search_page: Page, page: str, words: list[str]
) -> None:
    assert {each: found(search_page, each)[:1] for each in words} == {
        each: [f"{page}.html"] for each in words
    }


USERS_WORDS = {
    "parallel environments": "environments",
    "gym.make": "environments",
    "domain randomization": "simulation",
    "no robot": "simulation",
    "CAN bitrate": "hardware",
    "homing": "hardware",
    "emergency stop": "hardware",
    "gpu": "gpu",
    "onnx": "policies",
    "install": "installing",
    "Docker": "howto/container",
    "real time kernel": "real_time",
    "cameras calibration": "cameras",
    "record": "logs",
    "replay": "logs",
    "log to csv": "logs",
    "rosbag": "logs",
    "ROS 2": "bridges",
    "URDF": "any_robot",
    "torque limit": "safety",
    "position control": "tutorials/first_loop",
    "behaviour cloning": "data_sets",
    "LeRobot": "data_sets",
    "Slurm": "shared_robot",
    "version": "stability",
}
"""What users type, and the page that they look for."""


@pytest.mark.parametrize(("words", "page"), USERS_WORDS.items(), ids=USERS_WORDS)
def test_the_page_that_users_look_for_is_among_the_first_three(
    search_page: Page, words: str, page: str
) -> None:
    assert f"{page}.html" in found(search_page, words)[:3]


SHOWN = ["index", "tutorials/first_loop", "faults", "reference/python/trifinger", "configuration"]


def overflow(page: Page) -> int:
    """By how many pixels a page is wider than its window."""
    return int(page.evaluate("document.documentElement.scrollWidth - window.innerWidth"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1400])
def test_fits_its_window(browser: Browser, width: int, scheme: str) -> None:
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        color_scheme="dark" if scheme == "dark" else "light",
    )
    context.set_default_timeout(60_000)
    page = context.new_page()
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in SHOWN:
        page.goto(f"file://{SITE}/{name}.html")
        assert overflow(page) <= 0, name
        page.screenshot(path=PICTURES / f"{name.replace('/', '-')}-{width}-{scheme}.png")
        background = page.evaluate("getComputedStyle(document.body).backgroundColor")
        levels = [int(level) for level in background.strip("rgba()").split(",")[:3]]
        assert (sum(levels) < 3 * 80) == (scheme == "dark")
    context.close()


def test_no_page_is_wider_than_a_telephone(browser: Browser, pages: dict[Path, References]) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 900})
    context.set_default_timeout(60_000)
    page = context.new_page()
    wide = []
    for path in pages:
        if "source" not in path.relative_to(SITE).parts and "cpp" not in path.parts:
            page.goto(f"file://{path}")
            if overflow(page) > 0:
                wide.append(str(path.relative_to(SITE)))
    context.close()
    assert wide == []


def test_all_films_play_beside_a_log_that_moves(browser: Browser) -> None:
    context = browser.new_context(viewport={"width": 1400, "height": 3000})
    context.set_default_timeout(60_000)
    page = context.new_page()
    shown = set()
    for name in ("skills", "training", "index"):
        page.goto(f"file://{SITE}/{name}.html")
        films = page.locator("video").all()
        played = {Path(film.get_attribute("src") or "").stem for film in films}
        pictures = re.findall(r"images/films/(\w+)\.jpg", (ROOT / f"docs/{name}.md").read_text())
        assert played == set(pictures) - {"log"}
        shown |= played
        for film in films:  # A browser plays what is in sight.
            film.scroll_into_view_if_needed()
            page.wait_for_function("film => film.currentTime > 0", arg=film.element_handle())
    assert shown == {path.stem for path in (ROOT / "docs/images/films").glob("*.webm")}
    log = page.frame_locator("iframe")
    before = log.locator("#clock").inner_text()
    log.locator("#later").click()
    expect(log.locator("#clock")).not_to_have_text(before)
    context.close()
