# SPDX-License-Identifier: BSD-3-Clause
"""Who steers a robot from a page, and what that does: without a browser."""

import os
import random
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, StartChild, StartProgram
from hypothesis import given, strategies as st
from trifinger.errors import ControlHeld, InvalidArgument, RobotStopped, SessionNotFound
from trifinger_view import page_controller
from trifinger_view.authentication import Authentication
from trifinger_view.commands import view
from trifinger_view.control_panel import short_names
from trifinger_view.page_controller import SETPOINT_PERIOD, TIMEOUT, PageController
from trifinger_view.stop import Stop
from viewing import StartView

TIPS = ("finger_tip_link_0", "finger_tip_link_120", "finger_tip_link_240")


class FakeGuide:
    """A guide that notes what it is asked for."""

    num_joints = 9

    def __init__(self, frames: tuple[str, ...] = ()) -> None:
        self.frame_names = frames or TIPS
        self.asked: list[Any] = []
        self.mode = "hold"
        self.fault: Exception | None = None
        self.runs = True

    def _ask(self, mode: str, *what: Any) -> None:
        if not self.runs:
            raise InvalidArgument("the guide has ended")
        self.mode = mode
        self.asked.append((mode, *what))

    def home(self) -> None:
        self._ask("home")

    def hold(self) -> None:
        self._ask("hold")

    def float_freely(self) -> None:
        self._ask("float")

    def move_frame(self, finger: int, point: Any) -> None:
        self._ask("move_frame", finger, tuple(point))

    def move_joint(self, joint: int, position: float) -> None:
        self._ask("move_joint", joint, position)

    def state(self, timeout: float | None = None) -> Any:
        assert timeout == 0  # nobody waits for a robot
        return SimpleNamespace(mode=self.mode, refusal="", has_arrived=False)

    def is_running(self) -> bool:
        return self.runs

    def check(self) -> None:
        if self.fault is not None:
            raise self.fault

    def finish(self) -> None:
        self.asked.append(("finish",))


class FakeHand:
    """A hand that notes what it pulls."""

    def __init__(self) -> None:
        self.pulls: list[Any] = []
        self.is_closed = False

    def pull(self, body: str, target: Any, seconds: float) -> None:
        assert seconds > 0  # it lets go if this process stands still
        if body not in ("tip_0", "tip_1", "tip_2", "cube"):
            raise InvalidArgument(f"there is no '{body}' to pull")
        self.pulls.append((body, tuple(target)))

    def let_go(self) -> None:
        self.pulls.append(None)

    def close(self) -> None:
        self.is_closed = True


class Rig:
    """A controller of a robot that is not there."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch | None = None, **options: Any) -> None:
        self.now = 100.0
        self.guides: list[FakeGuide] = []
        self.hands: list[FakeHand] = []
        self.controller = PageController("sim", clock=lambda: self.now, **options)
        self.controller.begin_session(TIPS)
        self._patch = monkeypatch

    def guide(self, name: str, timeout: float, frames: tuple[str, ...]) -> FakeGuide:
        assert name == "sim"
        assert np.isfinite(timeout)
        self.guides.append(FakeGuide(frames))
        return self.guides[-1]

    def hand(self, name: str) -> FakeHand:
        assert name == "sim"
        self.hands.append(FakeHand())
        return self.hands[-1]


def make_rig(monkeypatch: pytest.MonkeyPatch, **options: Any) -> Rig:
    rig = Rig(**options)
    monkeypatch.setattr(
        page_controller, "_trifinger", SimpleNamespace(guide=rig.guide, hand=rig.hand)
    )
    return rig


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    rig = make_rig(monkeypatch)
    rig.controller.take(1)
    return rig


POINT = (0.0, 0.1, 0.05)


def everything(controller: PageController, browser: int) -> list[Any]:
    """All that a browser can ask for."""
    return [
        lambda: controller.do(browser, "home"),
        lambda: controller.do(browser, "hold"),
        lambda: controller.do(browser, "float"),
        lambda: controller.move_joint(browser, 0, 0.1),
        lambda: controller.drag_frame(browser, 0, POINT),
        lambda: controller.drag_object(browser, "cube", POINT),
        lambda: controller.drop(browser),
    ]


def test_only_the_driver_moves_anything(rig: Rig) -> None:
    for ask in everything(rig.controller, 2):
        with pytest.raises(InvalidArgument, match="does not have control"):
            ask()
    with pytest.raises(InvalidArgument, match="another browser"):
        rig.controller.take(2)
    rig.controller.leave(2)
    assert rig.controller.driver == 1
    assert rig.guides[0].asked == []
    assert rig.hands == []


def test_when_the_driver_leaves_the_robot_holds_and_another_can_take_over(rig: Rig) -> None:
    rig.controller.do(1, "float")
    rig.controller.drag_frame(1, 0, POINT)
    rig.controller.leave(1, "it has gone")
    assert rig.guides[0].asked[-1] == ("hold",)
    assert rig.hands[0].is_closed
    assert rig.controller.words == "it has gone"
    for ask in everything(rig.controller, 1):
        with pytest.raises(InvalidArgument):
            ask()
    rig.controller.take(2)
    assert rig.controller.driver == 2
    assert len(rig.guides) == 1  # the session goes on


def test_a_driver_that_is_not_heard_loses_control_and_the_robot_holds(rig: Rig) -> None:
    rig.controller.do(1, "home")
    rig.now += 0.9 * TIMEOUT
    rig.controller.heard(2)  # somebody else
    rig.controller.tick()
    assert rig.controller.driver == 1
    rig.controller.heard(1)
    rig.now += 0.9 * TIMEOUT
    rig.controller.tick()
    assert rig.controller.driver == 1
    rig.now += 0.2 * TIMEOUT
    rig.controller.tick()
    assert rig.controller.driver is None
    assert rig.guides[0].asked[-1] == ("hold",)
    assert "nothing was heard" in rig.controller.line()


def test_of_the_setpoints_of_a_drag_the_newest_wins_and_few_are_sent(rig: Rig) -> None:
    for number in range(1000):  # a second of a fast mouse
        rig.now += 1e-3
        rig.controller.drag_frame(1, number % 2, (0.0, 0.0, number * 1e-4))
        if number % 10 == 0:
            rig.controller.tick()
    rig.controller.drop(1)
    sent = rig.guides[0].asked
    for finger in (0, 1):
        own = [point for _, which, point in sent if which == finger]
        assert 10 < len(own) <= 1.0 / SETPOINT_PERIOD + 2
        assert own == sorted(own)
        assert own[-1] == (0.0, 0.0, (998 + finger) * 1e-4)


def test_a_slider_moves_its_joint_and_no_other_one(rig: Rig) -> None:
    rig.controller.drag_frame(1, 0, (0.0, 0.0, 0.1))
    rig.controller.do(1, "hold")
    rig.controller.move_joint(1, 4, -0.25)  # before the robot has heard of the hold
    rig.controller.drag_frame(1, 0, POINT)  # sent later, unless something follows
    rig.controller.move_joint(1, 0, 0.5)
    rig.controller.tick()
    assert rig.guides[0].asked == [
        ("move_frame", 0, (0.0, 0.0, 0.1)),
        ("hold",),
        ("move_joint", 4, -0.25),
        ("move_frame", 0, POINT),
        ("move_joint", 0, 0.5),
    ]


def test_while_the_robot_floats_a_drag_pulls_and_a_release_lets_go(rig: Rig) -> None:
    rig.controller.do(1, "float")
    rig.controller.drag_frame(1, 2, POINT)
    for _ in range(3):
        rig.controller.tick()  # a mouse that does not move pulls on
    assert rig.hands[0].pulls == [("tip_2", POINT)] * 4
    rig.controller.drop(1)
    rig.controller.tick()
    assert rig.hands[0].pulls[4:] == [None]
    assert rig.guides[0].mode == "float"


def test_the_hand_pulls_the_tip_that_a_handle_shows_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = make_rig(monkeypatch, frames=("finger_tip_link_240", "finger_lower_link_0"))
    rig.controller.take(1)
    rig.controller.do(1, "float")
    rig.controller.drag_frame(1, 0, POINT)
    with pytest.raises(InvalidArgument, match="no 'finger_lower_link_0' to pull"):
        rig.controller.drag_frame(1, 1, POINT)
    assert rig.hands[0].pulls == [("tip_2", POINT)]


def test_a_page_with_a_hand_alone_controls_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make_rig(monkeypatch, with_guide=False)
    rig.controller.take(1)
    rig.controller.drag_frame(1, 0, POINT)
    rig.controller.drag_object(1, "cube", POINT)
    assert rig.hands[0].pulls == [("tip_0", POINT), ("cube", POINT)]
    with pytest.raises(InvalidArgument):
        rig.controller.do(1, "home")
    rig.now += 2 * TIMEOUT
    rig.controller.tick()
    assert rig.hands[0].is_closed
    assert rig.guides == []


def test_when_the_session_ends_nobody_drives_and_the_reason_is_said(rig: Rig) -> None:
    guide = rig.guides[0]
    guide.runs, guide.fault = False, RobotStopped("the motors are hot")
    rig.controller.tick()
    assert rig.controller.driver is None
    assert rig.controller.line() == "the motors are hot"
    rig.controller.take(2)  # of the next session
    assert len(rig.guides) == 2
    rig.controller.do(2, "home")
    assert rig.guides[1].asked == [("home",)]
    rig.controller.close()
    assert rig.guides[1].asked[-1] == ("finish",)


def test_a_robot_recovers_when_nobody_drives(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    recovered: list[str] = []

    def recover(name: str, timeout: float) -> None:
        assert np.isfinite(timeout)
        if recovered:
            raise SessionNotFound("no robot 'sim' runs")
        recovered.append(name)

    monkeypatch.setattr(page_controller._trifinger, "recover", recover, raising=False)
    with pytest.raises(InvalidArgument):
        rig.controller.recover()  # a browser drives
    rig.guides[0].runs, rig.guides[0].fault = False, RobotStopped("the motors are hot")
    rig.controller.tick()
    rig.controller.recover()
    assert recovered == ["sim"]
    assert "'Take control' does" in rig.controller.line()
    with pytest.raises(SessionNotFound):
        rig.controller.recover()


def test_why_a_session_has_ended_is_said_until_the_next_one(rig: Rig) -> None:
    rig.controller.begin_session()
    rig.guides[0].runs, rig.guides[0].fault = False, RobotStopped("the motors are hot")
    rig.controller.tick()
    assert rig.controller.line() == "the motors are hot"
    rig.controller.begin_session()
    assert "'Take control' does" in rig.controller.line()


HOSTILE = st.one_of(
    st.none(),
    st.booleans(),
    st.text(max_size=5),
    st.integers(),
    st.floats(),
    st.lists(st.one_of(st.floats(), st.integers(), st.text(max_size=2), st.none()), max_size=5),
)


@given(st.lists(st.tuples(st.integers(-5, 12), HOSTILE), max_size=20), st.randoms())
def test_hostile_numbers_are_refused_and_break_nothing(
    asked: list[tuple[int, Any]], chance: random.Random
) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        rig = make_rig(monkeypatch)
        rig.controller.take(1)
        for number, value in asked:
            rig.now += 1.0 / 30
            rig.controller.heard(1)
            kind = chance.choice(["tip", "object", "joint", "mode"])
            try:
                if kind == "tip":
                    rig.controller.drag_frame(1, number, value)
                elif kind == "object":
                    rig.controller.drag_object(1, "cube", value)
                elif kind == "mode":
                    rig.controller.do(1, str(value))
                elif isinstance(value, float):
                    rig.controller.move_joint(1, number, value)
            except InvalidArgument:
                pass
            rig.controller.tick()
        for ask in rig.guides[0].asked:
            if ask[0] == "move_frame":
                assert 0 <= ask[1] < 3
                assert np.isfinite(ask[2]).all()
            elif ask[0] == "move_joint":
                assert np.isfinite(ask[2])
        for hand in rig.hands:
            assert all(pull is None or np.isfinite(pull[1]).all() for pull in hand.pulls)
        assert rig.controller.driver == 1


def test_names_of_joints_are_short_if_they_stay_different() -> None:
    names = [f"finger_{part}_joint_{angle}" for part in ("a_to_b", "b_to_c") for angle in (0, 120)]
    assert short_names(names) == ["a 0", "a 120", "c 0", "c 120"]
    for kept in ([], ["joint"], ["a_b", "b_a"], ["a", "a_b"], ["a", "a"]):
        assert short_names(kept) == kept


# ---- the stop ----


class Headers:
    """Headers of a request as `Authentication` reads them."""

    def __init__(self, **headers: str) -> None:
        self._headers = {name.replace("_", "-").lower(): one for name, one in headers.items()}

    def get_all(self, name: str) -> list[str]:
        value = self._headers.get(name.lower())
        return [] if value is None else [value]


@pytest.mark.parametrize(
    "headers",
    [
        {},  # a link or an image of another site
        {"X_TriFinger": "go"},
        {"X_TriFinger": "stop", "Origin": "http://evil.example"},
        {"X_TriFinger": "stop", "Sec_Fetch_Site": "cross-site"},
        {"X_TriFinger": "stop", "Sec_Fetch_Site": "same-site"},  # another port of this machine
    ],
)
def test_only_a_script_of_the_page_can_do_an_action(headers: dict[str, str]) -> None:
    authentication = Authentication(port=0)
    done: list[int] = []
    authentication.offer("/stop", lambda: (200, str(done.append(1))))
    host = f"127.0.0.1:{authentication.port}"
    answer = authentication.answer("/stop", Headers(Host=host, **headers))
    assert answer is not None
    assert answer[0] == 403
    assert done == []
    own = {"X_TriFinger": "stop", "Origin": f"http://{host}", "Sec_Fetch_Site": "same-origin"}
    assert authentication.answer("/stop", Headers(Host=host, **own)) == (200, "None")
    assert authentication.answer("/stop", Headers(Host=host, X_TriFinger="stop")) == (200, "None")
    assert authentication.answer("/other", Headers(Host=host, **own)) is None
    authentication.close()


def test_the_stop_ends_a_back_end_whoever_controls_it(start_program: StartProgram) -> None:
    stop = Stop("sim")
    assert stop.order()[0] == 404
    assert stop.outcome()[0] == 404
    program = start_program("run", "sim", *PATIENT)
    program.wait_for("waits for a user")
    guide = trifinger.guide("sim")
    guide.home()
    status, text = stop.order()
    assert status == 202
    assert str(program.process.pid) in text
    program.process.wait()
    assert stop.outcome() == (
        200,
        "Stopped: the robot has come to rest, and its back-end has ended.",
    )
    with pytest.raises(RobotStopped, match="was asked to stop"):
        guide.finish()
    stop.close()


SLOW_STOP = """
import signal, sys
STOP = {signal.SIGTERM}
signal.pthread_sigmask(signal.SIG_BLOCK, STOP)  # in all threads that begin
import trifinger
with trifinger.run_fake("sim"):
    print("ready", flush=True)
    signal.sigwait(STOP)
    print("told", flush=True)
    sys.stdin.readline()
print("told again" if signal.sigpending() & STOP else "told once", flush=True)
sys.stdin.readline()
"""


def test_a_back_end_that_stops_slowly_is_told_once(start_child: StartChild) -> None:
    # `trifinger run` would end at a second signal, before the robot is at rest.
    child = start_child(sys.executable, "-c", SLOW_STOP)
    stop = Stop("sim")
    assert stop.order()[0] == 202
    assert child.read_line() == "told"
    assert stop.order()[0] == stop.outcome()[0] == 202
    child.write_line()
    assert child.read_line() == "told once"
    assert stop.order()[0] == 202  # there is no session any more, but there is the process
    assert child.finish() == (0, "")
    assert stop.order() == stop.outcome()
    assert stop.outcome()[0] == 200
    stop.close()


# ---- the command ----


def test_control_is_refused_with_the_name_of_the_holder(start_program: StartProgram) -> None:
    start_program("run", "sim", *PATIENT).wait_for("waits for a user")
    with trifinger.guide("sim"):
        script = "import sys; from trifinger_view.commands.view import main; sys.exit(main())"
        words = ["sim", "--control", "--no-browser"]
        done = subprocess.run(
            [sys.executable, "-c", script, *words], capture_output=True, text=True, check=False
        )
        assert done.returncode == 1
        assert done.stderr.count("\n") == 1
        assert str(os.getpid()) in done.stderr
        with pytest.raises(ControlHeld):
            PageController("sim").take(1)


@pytest.mark.parametrize(
    ("words", "status", "text"),
    [
        (["--control"], 1, "no robot runs on this machine"),
        (["--hand"], 1, "no robot runs on this machine"),
        (["./log.mcap", "--control"], 2, "needs the name of a robot"),
    ],
)
def test_only_a_robot_is_steered(
    words: list[str], status: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert view.main(words) == status
    assert text in capsys.readouterr().err


@pytest.mark.slow
def test_the_terminal_says_that_the_page_waits_and_what_runs(
    start_view: StartView, start_program: StartProgram
) -> None:
    assert "No robot runs. The page waits for it" in start_view().said
    start_program("run", "sim", *PATIENT).wait_for("waits for a user")
    said = start_view("typo").said
    assert "No robot 'typo' runs; there is sim. The page waits for it" in said
    assert "'trifinger run typo' starts it." in said
    assert said.index("waits for it") < said.index("Ctrl-C ends the page")
    assert "waits" not in start_view("sim").said + start_view().said
