# SPDX-License-Identifier: BSD-3-Clause
"""The page of many robots, in a real browser."""

import contextlib
import io
from collections.abc import Iterator

import numpy as np
import pytest
import trifinger
from chromium import open_browser
from conftest import PATIENT, StartChild, StartProgram
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect
from trifinger_view.authentication import Authentication
from trifinger_view.fleet import Card, fleet_document
from trifinger_view.page_server import PageServer
from trifinger_view.to_browser import Numbers, message
from viewing import StartView, Viewing

pytestmark = pytest.mark.slow

NEVER = 280_000.0  # tests have watchdogs of their own [ms]
OWN = ("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as browser:
        yield browser


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    context = browser.new_context(viewport={"width": 390, "height": 700})
    context.set_default_timeout(NEVER)
    yield context
    context.close()


@pytest.fixture
def page(context: BrowserContext) -> Iterator[Page]:
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda asked: asked.url.startswith(OWN) or errors.append(asked.url))
    yield page
    assert errors == []  # nothing failed, and nothing was loaded from elsewhere


def card_of(page: Page, name: str) -> Locator:
    return page.locator("article").filter(has=page.locator("h2", has_text=name))


def says(card: Locator, *texts: str) -> None:
    """Waits until a card has these texts."""
    for text in texts:
        expect(card).to_contain_text(text, timeout=NEVER)


def has_class(card: Locator, name: str) -> None:
    expect(card).to_have_class(name, timeout=NEVER)


def picture_of(card: Locator) -> Image.Image:
    """What a card shows of its robot, when there is a picture."""
    figure = card.locator("figure")
    expect(figure).to_be_visible(timeout=NEVER)
    return Image.open(io.BytesIO(figure.screenshot(timeout=NEVER))).convert("RGB")


@contextlib.contextmanager
def cards(count: int) -> Iterator[tuple[str, list[Card]]]:
    """A page with so many robots that a test speaks for, and its address."""
    with contextlib.closing(Authentication(port=0)) as authentication:
        server = PageServer(authentication, fleet_document("test", is_plain=True))
        server.kinds = ()
        models = set[str]()
        shown = [Card(server, number, f"host-{number}", models) for number in range(count)]
        for card in shown:
            card.tell("")
        yield authentication.url, shown
        server.stop()


def glance(name: str, *lines: tuple[str, str, str], **more: object) -> bytes:
    told = [{"label": label, "text": text, "level": level} for label, text, level in lines]
    known = {"facts": "", "age": 0, "isAgeKnown": True, "rate": None, "lastFault": ""}
    return message("glance", title=name, lines=told, **{**known, "faultAge": 0, **more})


def test_cards_show_states_faults_and_robots_that_cannot_be_reached(
    page: Page,
    context: BrowserContext,
    start_view: StartView,
    start_fake: StartChild,
    start_program: StartProgram,
) -> None:
    start_program("run", "sim", "--non-real-time", *PATIENT).wait_for("waits for a user")
    start_fake("bot", observation_fault_after=20)
    views = [start_view(name) for name in ("sim", "bot", "left")]
    page.goto(start_view("--fleet", *(one.url for one in views)).url)
    assert "token" not in page.url
    sim, bot, left = (card_of(page, name) for name in ("sim", "bot", "left"))
    says(sim, "holds its pose", f"127.0.0.1:{views[0].port}", "trifinger · 1 kHz")
    says(left, "no robot 'left' runs", "trifinger run left")
    says(page.locator("header"), "3 robots · no fault")
    assert len(set(picture_of(sim).getdata())) > 50  # a robot, and no empty picture
    expect(bot.locator("figure")).to_be_hidden()  # it has no model
    robot = trifinger.connect("bot")
    with pytest.raises(trifinger.RobotStopped):
        robot.append_desired_actions(np.repeat(robot.new_action(), 100_000))
    says(bot, "has ended", "the driver", "trifinger recover bot")
    has_class(bot, "bad")
    says(page.locator("header"), "1 with a fault")
    expect(page).to_have_title("1 with a fault · Robots", timeout=NEVER)
    trifinger.recover("bot")
    says(bot, "holds its pose", "last fault")
    says(page.locator("header"), "no fault")
    views[0].process.kill()
    says(sim, "cannot be reached", "nothing listens at this port", "last seen")
    has_class(sim, "lost")
    says(page.locator("header"), "1 cannot be reached")
    again = Viewing("sim", "--port", str(views[0].port), "--token", views[0].token)
    with again.process:
        says(sim, "holds its pose")
        link = sim.locator("a")
        assert link.get_attribute("href") == f"http://127.0.0.1:{views[0].port}/"
        with context.expect_page() as opened:  # it needs the token of that page
            link.click()
        says(opened.value.locator("body"), "needs the whole address")
        again.process.kill()


def test_a_robot_that_moves_is_drawn_where_it_is(
    page: Page, start_view: StartView, start_program: StartProgram
) -> None:
    start_program("run", "sim", "--non-real-time", *PATIENT).wait_for("waits for a user")
    page.goto(start_view("--fleet").url)
    card = card_of(page, "sim")
    before = picture_of(card).tobytes()
    with trifinger.connect("sim") as robot:
        away = robot.new_action(position=np.array([0.3, 1.2, -2.0] * 3))
        robot.append_desired_actions(np.repeat(away, 1000))
        while picture_of(card).tobytes() == before:
            pass
        says(card, "runs")


def test_fault_68_what_robots_say_is_shown_as_text(page: Page) -> None:
    evil = "<img src=x onerror=alert(1)>"
    with cards(1) as (url, (card,)):
        card.take(glance(evil, ("state", evil, "bad"), ("fault", evil, "bad"), facts=evil))
        page.goto(url)
        for part in ("h2", ".state b", ".facts", ".says-fault"):
            expect(page.locator(part)).to_have_text(evil, timeout=NEVER)


def test_a_message_that_no_page_understands_costs_its_own_card_alone(
    browser: Browser,
) -> None:
    page = browser.new_page()  # its errors are meant
    with cards(2) as (url, (strange, plain)):
        strange.take(message("glance", lines=3))
        strange.take(message("frame", poses="none"))
        plain.take(glance("plain", ("state", "runs", "good")))
        page.goto(url)
        says(card_of(page, "plain"), "runs")
    page.close()


def test_durations_and_the_last_fault_are_said_in_words(page: Page) -> None:
    with cards(1) as (url, (card,)):
        past = {"lastFault": "a fault was injected", "faultAge": 3 * 86400 + 7200}
        known = {"age": 3720.0, "isAgeKnown": False, "rate": 999.6}
        card.take(glance("bot", ("state", "runs", "good"), **past, **known))
        page.goto(url)
        says(page.locator("article"), "for at least 1 h 2 min", "1000 Hz")
        says(page.locator("article"), "a fault was injected (over for 3 d 2 h)")
        has_class(page.locator("article"), "good")


def test_a_level_is_told_by_a_sign_and_not_by_colour_alone(page: Page) -> None:
    levels = {"": "○", "good": "●", "warning": "▲", "bad": "✖"}
    with cards(5) as (url, shown):
        for card, level in zip(shown, levels, strict=False):
            line = ("timing", "3 steps were late", "warning" * (level == "warning"))
            state = ("state", "a state", "" if level == "warning" else level)
            card.take(glance("bot", state, line))
        shown[4].tell("it is not there")
        page.goto(url)
        for number, sign in enumerate([*levels.values(), "?"]):
            state = page.locator("article").nth(number).locator(".state b")
            expect(state).to_be_visible(timeout=NEVER)
            content = "one => getComputedStyle(one, '::before').content"
            assert state.evaluate(content) == f'"{sign}"'


def test_what_a_camera_sees_takes_the_place_of_the_drawing(page: Page) -> None:
    file, numbers = io.BytesIO(), Numbers()
    Image.new("RGB", (32, 18), (200, 30, 40)).save(file, "jpeg")
    with cards(1) as (url, (card,)):
        card.take(glance("eyes", ("state", "runs", "good")))
        images = [("camera60", numbers.add_file(file.getvalue()))]
        card.take(message("images", numbers, images=images))
        page.goto(url)
        says(card_of(page, "eyes"), "runs")
        page.evaluate(
            "() => new Promise((done) => { const look = () => document.images[0].naturalWidth"
            " ? done() : setTimeout(look, 10); look(); })"
        )
        red, green, _ = picture_of(card_of(page, "eyes")).getpixel((60, 30))  # type: ignore[misc]
        assert red > 150 > 100 > green


def test_many_robots_fit_a_phone_and_stay_in_their_order(page: Page) -> None:
    with cards(20) as (url, shown):
        for number, card in reversed([*enumerate(shown)]):
            name = f"a-robot-with-a-very-long-name-{number}"
            card.take(glance(name, ("state", "holds its pose and waits for a controller", "")))
        for reason in ("it was away", ""):  # so a browser hears of it after the others
            shown[3].tell(reason)
        page.goto(url)
        says(page.locator("header"), "20 robots")
        names = page.locator("h2").all_text_contents()
        assert [int(name.rpartition("-")[2]) for name in names] == [*range(20)]
        for size in (390, 1280):
            page.set_viewport_size({"width": size, "height": 800})
            assert page.evaluate("document.documentElement.scrollWidth") <= size


def test_a_page_whose_program_has_ended_says_that_all_is_old(
    page: Page, start_view: StartView, start_fake: StartChild
) -> None:
    start_fake("bot")
    fleet = start_view("--fleet")
    page.goto(fleet.url)
    says(card_of(page, "bot"), "holds its pose")
    assert fleet.end() == (130, "")
    says(page.locator("#error"), "all of this is old")
    has_class(card_of(page, "bot"), "lost")
    start_view("--fleet", "--port", str(fleet.port), "--token", fleet.token)
    has_class(card_of(page, "bot"), "")
