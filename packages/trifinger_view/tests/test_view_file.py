# SPDX-License-Identifier: BSD-3-Clause
"""The page of a log that needs no server, in a real browser without a network."""

import gc
import re
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import trifinger
from chromium import open_browser
from conftest import BUILD, PROGRAM
from playwright.sync_api import Browser, Page
from trifinger.errors import InvalidArgument
from trifinger.look import INK_RADIUS
from trifinger_view import logged, page as viewed
from trifinger_view.commands import view
from trifinger_view.html_file import write_html
from trifinger_view.log_page import LogPage
from trifinger_view.logged import LoggedRun
from trifinger_view.playing import FASTEST, SLOWEST, TimeLine
from trifinger_view.scene import Scene
from trifinger_view.to_browser import GHOST_ANGLE, smaller

pytestmark = [
    pytest.mark.slow,
    # An exception in a check is shown by Python, and is meant here.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

HOME = np.array([0.0, 0.9, -1.7] * 3)
STEPS = 2000
HOSTILE = "</script><script>document.title = 'taken'</script><img src=x onerror=alert(1)>"
GRAIN = 2e-5  # poses in a page are rounded


def record(folder: Path, *, fails: bool, steps: int = STEPS) -> LoggedRun:
    """A log of random poses; the session ends with a fault of a hostile text if it `fails`."""
    generator = np.random.default_rng(3)

    def check(_: trifinger.Element, action: trifinger.Element) -> None:
        if action["torque"][0] > 0.1:
            raise ValueError(HOSTILE)

    try:
        with trifinger.simulate(checks=[check], record=folder) as robot:
            for start in range(0, steps, 250):
                actions = np.repeat(robot.new_action(), 250)
                actions["position"] = HOME + generator.uniform(-0.25, 0.25, 9)
                if fails and start + 250 >= steps:
                    actions["torque"][-1, 0] = 0.2
                robot.append_desired_actions(actions)
                robot.wait_until_time_index(start + 249)
            robot.finish()
    except trifinger.RobotStopped:
        assert fails
    gc.collect()  # the simulation, and its recorder with it, so that the log is finished
    return LoggedRun(folder)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> LoggedRun:
    return record(tmp_path_factory.mktemp("log"), fails=True)


@pytest.fixture(scope="module")
def file(run: LoggedRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "run.html"
    write_html(run, path)
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as browser:
        yield browser


class Complaints:
    """What goes wrong in a page, and what it asks the network for."""

    def __init__(self, page: Page) -> None:
        self.errors: list[str] = []
        self.requests: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on(
            "console",
            lambda line: self.errors.append(line.text) if line.type == "error" else None,
        )
        page.on("request", lambda request: self.requests.append(request.url))


@dataclass
class Opened:
    page: Page
    complaints: Complaints

    def ask(self, expression: str, argument: Any = None) -> Any:
        return self.page.evaluate(expression, argument)

    def wait_for(self, condition: str) -> None:
        # The page allows no strings to be run as scripts, which wait_for_function() needs.
        self.ask(
            "() => new Promise((done) => { const look = () => "
            f"({condition}) ? done() : setTimeout(look, 10); look(); }})"
        )

    def go_to(self, time: float) -> None:
        self.ask("time => trifingerPage.line.moveTo(time)", time)

    @property
    def state(self) -> str:
        return " ".join(self.page.inner_text("#state").split())


Open = Callable[[Path], Opened]
INFORMED, WARNED = 0.3, 1.0  # when the steps of a log begin that have marks [s]
COLOURS = """time => {
  const word = getComputedStyle(find("state").firstChild).color.match(/[0-9.]+/g).map(Number);
  const {line} = trifingerPage.controls, canvas = find("marks"), margin = 8;
  const at = margin + time / (line.end - line.begin) * (canvas.width - 2 * margin);
  const {data} = canvas.getContext("2d").getImageData(at - 5, 3, 11, 1);
  const pixels = Array.from({length: 11}, (_, i) => [...data.slice(4 * i, 4 * i + 4)]);
  return [word.slice(0, 3), pixels.reduce((a, b) => b[3] > a[3] ? b : a)];
}"""


class Nobody:
    """A server that no browser uses."""

    browsers = ()

    def put(self, kind: str, message: bytes) -> None:
        """Forgets it."""


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Open]:
    """Opens a file in a browser that has no network; complaints of the page fail the test."""
    context = browser.new_context(offline=True, viewport={"width": 780, "height": 420})
    opened: list[Opened] = []

    def open_file(path: Path) -> Opened:
        page = context.new_page()
        page.set_default_timeout(90_000)
        one = Opened(page, Complaints(page))
        page.goto(path.as_uri())
        page.wait_for_selector("body[data-is-ready]")
        assert page.inner_text("#error") == ""
        opened.append(one)
        return one

    yield open_file
    for one in opened:
        assert one.complaints.errors == []
        others = [url for url in one.complaints.requests[1:] if not url.startswith("blob:")]
        assert others == []
    context.close()


def test_the_file_opens_from_the_disk_and_asks_for_nothing_else(
    file: Path, open_page: Open
) -> None:
    opened = open_page(file)
    assert opened.complaints.requests == [file.as_uri()]
    assert opened.state == "running step 0"
    assert not re.search(r"https?://", file.read_text().replace("http-equiv", ""))


def test_bodies_are_where_the_log_and_the_kinematics_have_them(
    run: LoggedRun, file: Path, open_page: Open
) -> None:
    opened = open_page(file)
    assert run.scene is not None
    course = run.course(30.0)
    for row in np.random.default_rng(0).choice(len(course), 12, replace=False):
        time = float(course.times[row])
        frame = run.frame_at(time)
        places, turns = run.scene.poses(frame.position, frame.objects)
        opened.go_to(time)
        shown = opened.ask(
            "() => Object.fromEntries(trifingerPage.bodies.flatMap(({name, parts, ghosts}) =>"
            " [[name, [...parts[0].pose]],"
            " [`${name} desired`, [...(ghosts[0] ?? parts[0]).pose]]]))"
        )
        for body, place, turn in zip(run.scene.bodies, places, turns, strict=True):
            np.testing.assert_allclose(shown[body.name][:3], place, atol=GRAIN)
            sign = np.sign(np.dot(shown[body.name][3:], turn))
            np.testing.assert_allclose(sign * np.array(shown[body.name][3:]), turn, atol=GRAIN)
        is_apart = (
            frame.desired is not None and np.abs(frame.desired - frame.position).max() > GHOST_ANGLE
        )
        assert opened.ask("Boolean(trifingerPage.ghostIsThere[trifingerPage.frame])") == is_apart
        if is_apart:
            ghosts, _ = run.scene.poses(frame.desired, frame.objects)
            for body, place in zip(run.scene.bodies, ghosts, strict=True):
                if body.is_moving and not body.object:
                    np.testing.assert_allclose(shown[f"{body.name} desired"][:3], place, atol=GRAIN)


def test_between_two_frames_bodies_are_between_their_poses(
    run: LoggedRun, file: Path, open_page: Open
) -> None:
    opened = open_page(file)
    times = run.course(30.0).times
    for row in range(5, len(times) - 1, 7):
        for share in (0.25, 0.7):
            time = times[row] + share * (times[row + 1] - times[row])
            poses = opened.ask(
                "times => times.map(time => trifingerPage.courses"
                ".map(course => [...trifingerPage.poseAt(course, time)].slice(0, 3)))",
                [times[row], time, times[row + 1]],
            )
            before, found, after = map(np.array, poses)
            np.testing.assert_allclose(found, before + share * (after - before), atol=1e-6)


def test_the_picture_is_of_the_time_that_was_scrubbed_to(file: Path, open_page: Open) -> None:
    opened = open_page(file)

    def picture(time: float) -> bytes:
        opened.go_to(time)
        opened.wait_for("!trifingerPage.scene.isAsked")
        return opened.page.locator("#view").screenshot()

    early, late = picture(0.2), picture(1.4)
    assert early != late
    assert picture(0.2) == early


def test_the_slider_and_a_click_into_a_plot_scrub(
    run: LoggedRun, file: Path, open_page: Open
) -> None:
    opened = open_page(file)
    opened.page.locator("#time").fill("0.75")
    assert opened.ask("trifingerPage.line.position") == pytest.approx(0.75)
    assert run.step_at(0.75) - 40 < int(opened.state.split()[-1]) <= run.step_at(0.75)
    plot = opened.page.locator(".plot canvas").first
    box = plot.bounding_box()
    assert box is not None
    plot.click(position={"x": box["width"] / 2, "y": 20})
    assert opened.ask("trifingerPage.line.position") == pytest.approx(run.end / 2, rel=0.02)


def test_play_pause_and_speed_do_what_they_say(file: Path, open_page: Open) -> None:
    opened = open_page(file)
    opened.page.select_option("#speed", "0.25")
    opened.page.click("#play")
    opened.wait_for("trifingerPage.line.position > 0.1")
    assert opened.ask("trifingerPage.line.isPlaying")
    opened.page.click("#play")
    paused = opened.ask("trifingerPage.line.position")
    opened.ask("() => new Promise((done) => setTimeout(done, 300))")
    assert opened.ask("trifingerPage.line.position") == paused
    opened.page.select_option("#speed", "10")
    opened.page.keyboard.press("Escape")
    opened.page.locator("h1").click()
    opened.page.keyboard.press(" ")
    opened.wait_for("!trifingerPage.line.isPlaying && trifingerPage.line.position > 1.5")
    assert opened.ask("trifingerPage.line.position === trifingerPage.line.end")
    opened.page.click("#loop")
    opened.page.keyboard.press(" ")
    opened.wait_for("trifingerPage.line.isPlaying")
    opened.ask("() => { window.high = 0; }")
    # It has begun again as soon as it is not where it was at most.
    opened.wait_for("(high = Math.max(high, trifingerPage.line.at)) > trifingerPage.line.at")
    assert opened.ask("trifingerPage.line.isPlaying")


def test_buttons_step_by_frames_and_stand_still(
    run: LoggedRun, file: Path, open_page: Open
) -> None:
    opened = open_page(file)
    course = run.course(30.0)
    opened.go_to(float(course.times[10]))
    opened.page.click("#play")
    opened.go_to(float(course.times[10]))
    opened.page.click("#forth")
    assert not opened.ask("trifingerPage.line.isPlaying")
    opened.go_to(float(course.times[20]))
    opened.page.click("#forth")
    assert opened.state.split()[-1] == str(course.time_index[21])
    opened.page.click("#back")
    opened.page.click("#back")
    assert opened.state.split()[-1] == str(course.time_index[19])


def test_the_fault_is_one_click_away_and_its_text_is_only_text(
    run: LoggedRun, file: Path, open_page: Open
) -> None:
    opened = open_page(file)
    assert run.fault is not None
    opened.page.click("#play")
    opened.page.click("#fault")
    assert not opened.ask("trifingerPage.line.isPlaying")
    assert opened.ask("trifingerPage.line.position") == pytest.approx(run.fault.time)
    assert HOSTILE in opened.state
    assert f"step {run.fault.time_index}" in opened.state
    assert opened.page.title() == "sim · trifinger"
    assert opened.page.locator("img").count() == 0
    opened.go_to(run.fault.time - 0.1)
    assert opened.state.startswith("running")


def test_a_session_without_a_fault_says_at_its_end_how_it_ended(
    tmp_path: Path, open_page: Open
) -> None:
    run = record(tmp_path / "log", fails=False, steps=500)
    write_html(run, tmp_path / "run.html")
    opened = open_page(tmp_path / "run.html")
    assert not opened.page.locator("#fault").is_visible()
    opened.page.keyboard.press("End")
    assert opened.state.startswith("the controller finished at step 500")


def test_plots_show_the_numbers_of_the_log(run: LoggedRun, file: Path, open_page: Open) -> None:
    opened = open_page(file)
    found = opened.ask(
        "() => trifingerPage.plots.map(plot => ({name: plot.title.split(' [')[0],"
        " lines: plot.lines.map(line =>"
        " ({isDesired: line.isDesired, low: Math.min(...line.low), high: Math.max(...line.high)}))"
        "}))"
    )
    plots = {plot["name"]: plot["lines"] for plot in found}
    for name, values in (
        ("position", run.session.observations["position"]),
        ("torque", run.session.applied_actions["torque"]),
        ("tip_force", run.session.observations["tip_force"]),
    ):
        lines = [line for line in plots[name] if not line["isDesired"]]
        np.testing.assert_allclose([line["low"] for line in lines], values.min(0), rtol=1e-6)
        np.testing.assert_allclose([line["high"] for line in lines], values.max(0), rtol=1e-6)
    assert next(iter(plots)) == "torque"
    opened.page.select_option("#group", label="finger 120")
    assert opened.page.inner_text("#legend").split() == ["0", "1", "2"]
    shown = opened.ask(
        "trifingerPage.plots.map(plot => [plot.title.split(' [')[0],"
        " plot.shown.map(line => line.low)])"
    )
    for name, lines in shown:
        if name == "tip_force":  # one number for each finger
            assert len(lines) == 1
        elif name == "torque":
            assert len(lines) == 6  # desired and applied


def test_images_of_the_cameras_are_shown_as_they_had_arrived(
    tmp_path: Path, open_page: Open
) -> None:
    simulation = trifinger.Simulation("sim_cameras", {"cameras.size": 270, "cameras.rate": 20})
    with simulation.record(tmp_path / "log") as recorder, simulation.connect() as robot:
        hold = robot.new_action(position=robot.latest_observation().position)
        for _ in range(400):
            robot.wait_until_time_index(robot.append_desired_action(hold))
        robot.finish()
        recorder.stop()
    run = LoggedRun(tmp_path / "log")
    assert write_html(run, tmp_path / "run.html").image_rate > 0
    opened = open_page(tmp_path / "run.html")
    assert run.cameras is not None
    assert opened.page.locator("#images figcaption").all_inner_texts() == list(run.cameras.names)
    opened.page.keyboard.press("End")
    for number, name in enumerate(run.cameras.names):
        images = run.cameras.get_latest_at(run.last)
        assert images is not None
        expected = smaller(images[name], 360).astype(float)
        opened.wait_for(f"document.images[{number}].naturalWidth > 0")
        pixels = opened.ask(
            "(number) => { const image = document.images[number]; const canvas = "
            "document.createElement('canvas'); canvas.width = image.naturalWidth; canvas.height = "
            "image.naturalHeight; const pen = canvas.getContext('2d'); pen.drawImage(image, 0, 0);"
            " return [...pen.getImageData(0, 0, canvas.width, canvas.height).data]; }",
            number,
        )
        found = np.array(pixels).reshape(*expected.shape[:2], 4)[:, :, :3]
        assert np.abs(found - expected).mean() < 8  # JPEG, and at most 0.2 s older
        frame = run.frame_at(run.end)
        np.testing.assert_array_equal(frame.images[name], images[name])


RED, AMBER = (lambda r, g, _: g < 0.62 * r), (lambda r, g, b: 0.55 * r < g < 0.8 * r and b < g)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_faults_are_red_warnings_amber_and_information_neither(
    scheme: Literal["light", "dark"],
    run: LoggedRun,
    tmp_path: Path,
    open_page: Open,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begins = [run.session.get_status(run.step_at(time))["time"] for time in (INFORMED, WARNED)]
    ends = [run.session.get_status(run.step_at(time + 0.1))["time"] for time in (INFORMED, WARNED)]

    def bits(statuses: Any) -> np.ndarray:
        marks = np.zeros(len(statuses), np.uint8)
        for bit, begin, end in zip((4, 1), begins, ends, strict=True):
            marks[(begin <= statuses["time"]) & (statuses["time"] < end)] = bit
        return marks

    monkeypatch.setattr(logged, "_bits", bits)
    write_html(run, tmp_path / "run.html")
    opened = open_page(tmp_path / "run.html")
    opened.page.emulate_media(color_scheme=scheme)
    opened.ask("() => new Promise(requestAnimationFrame)")
    assert run.fault is not None
    served = LogPage(viewed.Page(Nobody()), run)  # type: ignore[arg-type]
    for time, text, level, is_coloured in (
        (INFORMED + 0.05, "action used its own observation", "", None),
        (WARNED + 0.05, "action repeated", "warning", AMBER),
        (run.fault.time, "", "bad", RED),
    ):
        opened.go_to(time)
        line = served._lines(run.frame_at(time))[0]
        assert (text in line.text, line.level) == (True, level)
        assert text in opened.state
        assert opened.page.get_attribute(".says-state", "class") == f"says-state {level}"
        word, mark = opened.ask(COLOURS, time)
        if is_coloured is None:
            assert mark[3] == 0
            assert max(word) - min(word) < 30  # the colour of any text
        else:
            assert mark[3] > 0
            assert is_coloured(*word)
            assert is_coloured(*mark[:3])
    fault = next(line for line in served._lines(run.frame_at(0.0)) if line.label == "fault")
    assert fault.level == "bad"


def test_a_robot_without_a_model_has_its_plots(tmp_path: Path, open_page: Open) -> None:
    program = str(BUILD / "tests/python/write_log")
    subprocess.run([program, str(tmp_path), "odd", "300"], check=True)
    run = LoggedRun(tmp_path / "log.mcap")
    write_html(run, tmp_path / "run.html")
    opened = open_page(tmp_path / "run.html")
    assert opened.page.locator(".plot").count() > 0
    opened.go_to(run.end / 2)
    assert "step" in opened.state


def test_the_time_line_of_the_page_moves_like_that_of_python(file: Path, open_page: Open) -> None:
    opened = open_page(file)
    generator = np.random.default_rng(5)
    now = 0.0

    def clock() -> float:
        return now

    for is_looping in (False, True):
        line = TimeLine(1.0, 9.0, fault=4.0, is_looping=is_looping, clock=clock)
        opened.ask(
            "([isLooping, start]) => { window.now = start; window.line = "
            "new trifingerPage.TimeLine(1, 9, 4, () => now); line.isLooping = isLooping; }",
            [is_looping, now],
        )
        for _ in range(150):
            step = generator.choice(["wait", "wait", "play", "pause", "toggle", "move", "speed"])
            number = generator.uniform(0.0, 10.0)
            if step == "wait":
                now += number / 5
                opened.ask("now => { window.now = now; }", now)
            elif step == "move":
                line.move_to(number)
                opened.ask("time => line.moveTo(time)", number)
            elif step == "speed":
                line.speed = min(max(number, SLOWEST), FASTEST)
                opened.ask("speed => line.setSpeed(speed)", line.speed)
            else:
                getattr(line, step)()
                opened.ask(f"line.{step}()")
            # Both are asked, in this order, because asking moves them.
            assert opened.ask("line.position") == pytest.approx(line.position, abs=1e-9)
            assert opened.ask("line.isPlaying") == line.is_playing


# ---- the file ----


def files_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.is_file()]


def test_a_part_of_the_log_has_only_this_part(
    run: LoggedRun, tmp_path: Path, open_page: Open
) -> None:
    write_html(run, tmp_path / "run.html", begin=0.5, end=1.0, rate=100.0)
    opened = open_page(tmp_path / "run.html")
    line = opened.ask("[trifingerPage.line.begin, trifingerPage.line.end]")
    assert line == pytest.approx([0.5, 1.0])
    assert opened.ask("trifingerPage.times.length") == 51
    plots = opened.ask("trifingerPage.plots.map(plot => [plot.times[0], plot.times.at(-1)])")
    np.testing.assert_allclose(plots, [[0.5, 1.0]] * len(plots), atol=2e-3)
    assert not opened.page.locator("#fault").is_visible()
    opened.page.keyboard.press("End")
    assert opened.state.startswith("running")


def test_the_command_writes_a_file_and_says_what_it_holds(
    run: LoggedRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, path = str(run.log.files[0]), tmp_path / "run.html"
    assert view.main([log, "-o", str(path), "--from", "0.5", "--to", "1.5", "--rate", "50"]) == 0
    written = capsys.readouterr().out
    assert re.fullmatch(rf"{path} written: 0\.\d MB, 51 frames, 50 per second\.\n", written)
    for words in (["--from", "1.5", "--to", "0.5"], ["--rate", "0"], ["--rate", "nan"]):
        assert view.main([log, "-o", str(tmp_path / "no.html"), *words]) == 2
        assert capsys.readouterr().err.startswith("trifinger view: ")
    assert files_in(tmp_path) == ["run.html"]


def test_a_page_beyond_the_limit_is_thinned_out_or_refused_with_what_would_fit(
    run: LoggedRun, tmp_path: Path
) -> None:
    path = tmp_path / "run.html"
    limit = 2_120_000
    written = write_html(run, path, most_bytes=limit)
    assert written.rate < 30.0
    assert written.size == path.stat().st_size <= limit
    assert f"{written.frames} frames" in str(written)
    kept = path.read_bytes()
    with pytest.raises(InvalidArgument, match=r"choose a --rate of at most [\d.]+"):
        write_html(run, path, rate=1000.0, most_bytes=limit)
    with pytest.raises(InvalidArgument, match="shorter part with --from and --to"):
        write_html(run, path, most_bytes=10_000)
    assert path.read_bytes() == kept
    assert files_in(tmp_path) == ["run.html"]


def test_an_error_leaves_no_file_and_keeps_the_one_that_was_there(
    run: LoggedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.html"

    def fails(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("trifinger.whole_file.os.fsync", fails)
    with pytest.raises(OSError, match="No space left"):
        write_html(run, path)
    assert files_in(tmp_path) == []
    path.write_text("before")
    with pytest.raises(OSError, match="No space left"):
        write_html(run, path)
    assert path.read_text() == "before"
    with pytest.raises(FileNotFoundError):
        write_html(run, tmp_path / "nowhere" / "run.html")


def test_the_same_log_gives_the_same_file(run: LoggedRun, tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_html(run, tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


@pytest.mark.parametrize(("width", "factor"), [(1000, 1), (100, 1), (99, 2), (50, 2), (49, 3)])
def test_smaller_images_have_the_means_of_their_squares(width: int, factor: int) -> None:
    image = np.random.default_rng(0).integers(0, 256, (80, 100, 3), np.uint8)
    small = smaller(image, width)
    assert small.shape == (80 // factor, 100 // factor, 3)
    square = image[:factor, :factor].reshape(-1, 3)
    np.testing.assert_allclose(small[0, 0], square.mean(axis=0), atol=1.01)


def test_a_pen_leaves_ink_behind(
    run: LoggedRun, tmp_path: Path, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = [PROGRAM, "model", "export", "--format", "mjcf", "--object", "stick", "cube"]
    scene = Scene(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    assert scene.has_pen
    steps = np.arange(run.first, run.last, 10)
    pose = np.array([0, 0, 0.07, 0.5**0.5, 0, 0.5**0.5, 0])  # its x axis looks down
    poses = np.tile(pose, (len(steps), 1))
    poses[:, 0] = np.linspace(-0.05, 0.05, len(steps))
    ends, mesh = scene.ink(steps, {"stick": poses, "cube": poses})
    assert ends.tolist() == steps[1:].tolist()
    corners = mesh.vertices[mesh.faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert (areas[:, 2] > 0).all()  # they look up
    assert areas[:, 2].sum() == pytest.approx(0.1 * 2 * INK_RADIUS)
    assert not len(scene.ink(np.empty(0), {})[1].faces)  # a log without a pose
    monkeypatch.setattr(run, "ink", (ends, mesh))
    write_html(run, tmp_path / "ink.html")
    opened = open_page(tmp_path / "ink.html")
    for share in (0.0, 0.5, 1.0, 0.2):
        opened.go_to(share * run.end)
        step = opened.ask("trifingerPage.steps[trifingerPage.frame]")
        assert opened.ask("trifingerPage.ink.mesh.count") == 6 * (ends <= step).sum()
