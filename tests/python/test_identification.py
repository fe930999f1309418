# SPDX-License-Identifier: BSD-3-Clause
"""The simulation that fits one robot, from logs of it."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trifinger
from conftest import StartProgram
from trifinger._trifinger import FreeRun, configuration_text, read_joint_facts
from trifinger.commands.identify import recorder
from trifinger.commands.program import path as program
from trifinger.environments import Options
from trifinger.identification import check, identify, read_motion, save
from trifinger.identification.check import figures_of
from trifinger.identification.excitation import Excitation, Gains, strokes
from trifinger.identification.fit import KINDS, Figure
from trifinger.identification.handling import HANDLED, Moments, _Scene as Scene, contacts, smooth
from trifinger.identification.page import FIGURES, ranges
from trifinger.identification.softness import SoftContact, presses, softness
from trifinger.identification.stiffness import advice, settings, stiffness

TRUE = {
    "friction": [0.004, 0.012, 0.009],
    "damping": [0.004, 0.002, 0.006],
    "rotor_inertia": [5e-4, 2.5e-4, 4e-4],
    "torque_scale": [0.9, 1.05, 1.1],
    "backlash": [0.003, 0.006, 0.002],
    "zero_offset": [0.004, -0.006, 0.005],
    "link_mass": [1.0, 1.0, 1.0],
    "torque_delay": 0.002,
    "measurement_delay": 0.001,
}


def python_command(name: str) -> list[str]:
    """How to run `trifinger NAME`, which may not be installed."""
    program = f"import sys; from trifinger.commands.{name} import main; sys.exit(main())"
    return [sys.executable, "-c", program]


IDENTIFY = python_command("identify")


def finger(folder: Path, name: str = "robot.yml", **identified: object) -> Path:
    """The configuration of a single finger that is like this."""
    path = folder / name
    path.write_text(f"extends: finger_edu\nobjects: []\nidentified: {json.dumps(identified)}\n")
    return path


def play(robot: trifinger.Frontend, actions: np.ndarray) -> None:
    """Lets a robot carry out all actions, and ends its session."""
    for first in range(0, len(actions), 1000):
        last = robot.append_desired_actions(actions[first : first + 1000])
    robot.get_observation(last)
    robot.finish()


def recorded(config: Path, folder: Path, seconds: float, seed: int = 0) -> Path:
    """Moves a simulated robot as `trifinger identify` does, and returns its log."""
    simulation = trifinger.Simulation(str(config))
    simulation.vary(velocity_noise=0.02)
    _, joints, limits = read_joint_facts(configuration_text(str(config)), "finger")
    with simulation.record(folder), simulation.connect() as robot:
        start = np.array(robot.latest_observation().position)
        plan = Excitation(trifinger.export_mjcf(str(config)), joints, limits, 1e-3, seed)
        rows = plan.plan(start, seconds)
        actions = np.repeat(np.array([robot.new_action()]), len(rows))
        actions["position"] = rows
        play(robot, actions)
    return folder


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("identification")
    return recorded(finger(folder, **TRUE), folder / "log", 40.0)


def test_a_free_run_moves_like_the_robot_if_all_figures_are_true(log: Path) -> None:
    motion = read_motion([log], robot_config=str(log.parent / "robot.yml"))
    begins = np.arange(2000, 12000, 500)
    two = begins[:, None] + np.array([-50, 0])
    speed = np.gradient(motion.position, axis=0) / motion.period
    lists = {name: value for name, value in TRUE.items() if isinstance(value, list)}
    late = np.concatenate([motion.torque[:3], motion.torque[:-3]])

    def errors(figures: dict[str, list[float]]) -> float:
        run = FreeRun.of_text(motion.configuration).run(
            figures, motion.position[two], speed[two], begins.tolist(), late, 50, 100
        )
        return float(np.median(np.abs(run[:, -1] - motion.position[begins + 100])))

    assert errors(lists) < 1e-4
    assert errors(lists | {"friction": [0.0] * 3}) > 10 * errors(lists)
    assert errors(lists | {"torque_scale": [1.0] * 3}) > 10 * errors(lists)
    assert errors(lists | {"link_mass": [1.2] * 3}) > 10 * errors(lists)


def test_centers_of_mass_are_of_the_configuration_or_of_the_figures(tmp_path: Path) -> None:
    shifts = {"link_center_y": [0.004, -0.003, 0.002], "link_center_z": [0.001, 0.005, -0.004]}
    begins, position = np.arange(100, 500, 100), np.zeros((4, 2, 3))
    torque = 0.05 * np.sin(0.01 * np.arange(3000)).reshape(1000, 3)

    def moved(identified: dict[str, list[float]], figures: dict[str, list[float]]) -> np.ndarray:
        robot = FreeRun(str(finger(tmp_path, **identified)))
        return robot.run(figures, position, 0 * position, begins.tolist(), torque, 50, 100)

    assert np.all(moved(shifts, shifts) == moved({}, shifts))
    assert np.max(np.abs(moved({}, shifts) - moved({}, {}))) > 1e-4
    assert FreeRun(str(finger(tmp_path, **shifts))).described["link_center_z"] == [
        0.001, 0.005, -0.004,
    ]  # fmt: skip


@pytest.mark.slow
def test_centers_of_mass_are_told_if_one_asks(tmp_path: Path) -> None:
    true = TRUE | {"link_center_y": [0.006, -0.007, 0.004], "link_center_z": [0.0, 0.006, -0.008]}
    log = recorded(finger(tmp_path, **true), tmp_path / "log", 40.0)
    described = str(finger(tmp_path, "described.yml"))
    result = identify(read_motion([log], robot_config=described), with_centers=True)
    centers = [one for one in result.told if one.name.startswith("link_center")]
    assert len(centers) >= 4
    for one in centers:
        value = true.get(one.name, [0.0] * 3)[result.motion.joints.index(one.joint)]
        # Intervals are of 95 %; this is not the place to count them.
        assert abs(value - one.value) <= 2 * (one.high - one.value)
    assert result.ratio < 0.1
    save(result, tmp_path / "fitted", described)
    fitted = FreeRun(str(tmp_path / "fitted" / "fitted.yml"))
    saved = pytest.approx(result.values["link_center_y"], rel=1e-4)
    assert fitted.described["link_center_y"] == saved


@pytest.mark.slow
def test_logs_tell_what_a_robot_is_like_and_its_simulation_then_moves_like_it(
    log: Path, tmp_path: Path
) -> None:
    described = finger(tmp_path, "described.yml")
    # Otherwise the scale of masses and torques together would be told by 4 % only.
    result = identify(read_motion([log], robot_config=str(described)), known="link_mass")
    joints = result.motion.joints
    inside = []
    for figure in result.told:
        true = 0.003 if figure.name == "delay" else TRUE[figure.name][joints.index(figure.joint)]
        # Intervals are of 95 %; this is not the place to count them.
        half = 2 * (figure.high - figure.value)
        inside.append(figure.value - half <= true <= figure.value + half)
    assert len(result.told) >= 19
    assert sum(inside) >= 0.95 * len(inside)
    assert (result.torque_delay, result.measurement_delay) == (2, 1)
    assert result.ratio < 0.1

    save(result, tmp_path / "fitted", str(described))
    fitted = FreeRun(str(tmp_path / "fitted" / "fitted.yml")).described
    assert fitted["friction"] == pytest.approx(TRUE["friction"], rel=0.15)
    assert fitted["backlash"] == pytest.approx(TRUE["backlash"], abs=2e-4)
    page = (tmp_path / "fitted" / "identified.html").read_text()
    assert "Measured and simulated" in page
    assert all(joint in page for joint in joints)
    trifinger.simulate(str(tmp_path / "fitted" / "fitted.yml")).latest_observation()
    factors = ranges(result)
    assert 0 < factors["motor_gain"][0] < 1 < factors["motor_gain"][1]
    Options.of("reach", **{k: tuple(v) for k, v in factors.items()})
    saved = json.loads((tmp_path / "fitted" / FIGURES).read_text())
    assert figures_of(saved) == result.figures
    assert saved["train"] == {}  # it is late by 3 ms only
    assert not check(result.figures, figures_of(saved))


def test_a_configuration_says_what_was_identified(tmp_path: Path) -> None:
    config = finger(tmp_path, zero_offset=[0.1, 0.2, 0.3], measurement_delay=0.002)
    plain = trifinger.Simulation(str(finger(tmp_path, "plain.yml")))
    assert plain.connect().latest_observation().position == pytest.approx([0.0, 0.9, -1.7])
    robot = trifinger.Simulation(str(config)).connect()
    assert robot.latest_observation().position == pytest.approx([0.1, 1.1, -1.4])


@pytest.mark.parametrize(
    ("identified", "why"),
    [
        ({"friction": [0.1]}, "identified.friction has 1 numbers, must have 3"),
        ({"friction": [-0.1, 0, 0]}, "must be at least 0|must be 0 to"),
        ({"torque_delay": 0.0005}, "must be a whole number of steps"),
        ({"frictions": [0, 0, 0]}, "identified.frictions"),
    ],
)
def test_a_configuration_that_makes_no_sense_is_refused(
    tmp_path: Path, identified: dict[str, object], why: str
) -> None:
    with pytest.raises(trifinger.Error, match=why):
        trifinger.Simulation(str(finger(tmp_path, **identified)))


def test_logs_of_no_use_are_refused_with_a_sentence(tmp_path: Path, log: Path) -> None:
    still = trifinger.Simulation(str(finger(tmp_path)))
    with still.record(tmp_path / "still"), still.connect() as robot:
        rest = np.repeat(np.array([robot.new_action()]), 12000)
        rest["position"] = robot.latest_observation().position
        play(robot, rest)
    with pytest.raises(trifinger.InvalidArgument, match="nothing moves"):
        read_motion([tmp_path / "still"])
    with pytest.raises(trifinger.InvalidArgument, match="another robot"):
        read_motion([log], robot_config="trifinger_edu")
    with still.record(tmp_path / "short"), still.connect() as robot:
        play(robot, rest[:1000])
    with pytest.raises(trifinger.InvalidArgument, match="too short"):
        read_motion([tmp_path / "short"])
    strict = {"safety.plausibility.max_velocity_error": 1e-3}
    faulty = trifinger.Simulation(str(finger(tmp_path)), strict)
    faulty.vary(velocity_noise=1.0)
    recorder = faulty.record(tmp_path / "fault")
    robot = faulty.connect()
    with pytest.raises(trifinger.RobotStopped):
        robot.get_observation(robot.append_desired_actions(rest[:1000]))
    recorder.stop()
    with pytest.raises(trifinger.InvalidArgument, match="stopped with a fault in step"):
        read_motion([tmp_path / "fault"])


def test_saturated_motors_are_refused(tmp_path: Path) -> None:
    warm = {"safety.continuous_torque": float("inf")}
    simulation = trifinger.Simulation(str(finger(tmp_path)), warm)
    with simulation.record(tmp_path / "log"), simulation.connect() as robot:
        push = np.repeat(np.array([robot.new_action()]), 12000)
        push["torque"] = np.sign(np.sin(np.arange(12000) / 20))[:, None] * [1.0, 0.0, 0.0]
        play(robot, push)
    with pytest.raises(trifinger.InvalidArgument, match="gets its largest torque in"):
        read_motion([tmp_path / "log"])


def test_planned_motion_stays_within_limits_and_touches_nothing() -> None:
    config = "trifinger_edu"
    text, model = configuration_text(config), trifinger.export_mjcf(config)
    _, joints, limits = read_joint_facts(text, "trifinger")
    start = np.array([0, 0.9, -1.7] * 3)
    plan = Excitation(model, joints, limits, 1e-3, seed=3)
    rows = plan.plan(start, 20.0)
    assert len(rows) >= 20_000
    assert (rows > limits["soft_lower"]).all()
    assert (rows < limits["soft_upper"]).all()
    assert rows[-1] == pytest.approx(start)
    assert np.abs(np.diff(rows, axis=0)).max() < 1e-3 * limits["max_velocity"].max()
    assert (np.ptp(rows, axis=0) > 0.3).all()
    assert all(map(plan.is_free, rows[::97]))
    assert not plan.is_free(np.zeros(9))  # the fingers hang through the table


def test_gains_grow_until_a_joint_trembles() -> None:
    _, _, limits = read_joint_facts(configuration_text("finger_edu"), "finger")
    gains = Gains(limits)
    calm = np.zeros((1000, 3))
    trembling = calm.copy()
    trembling[:, 1] = np.resize([1, -1], 1000) * limits["max_torque"][1]
    for _ in range(20):
        gains.look(calm)
    assert gains.kp == pytest.approx(limits["default_kp"])
    gains.look(trembling)
    softer = gains.kp[1]
    assert softer < 0.7 * limits["default_kp"][1]
    for _ in range(20):
        gains.look(calm)
    assert gains.kp == pytest.approx([limits["default_kp"][0], softer, limits["default_kp"][2]])


def test_a_robot_that_is_late_is_told_how_soft_it_must_be(tmp_path: Path) -> None:
    late = {"torque_delay": 0.004, "measurement_delay": 0.004}
    config = str(finger(tmp_path, **late))

    def speed(kp: float) -> float:
        """The largest speed of a joint that should have come to rest."""
        with trifinger.Simulation(config).connect() as robot:
            actions = np.repeat(np.array([robot.new_action()]), 1000)
            actions["position"] = [0.1, 0.8, -1.6]
            actions["position_kp"] = kp
            last = robot.append_desired_actions(actions)
            return float(np.abs(robot.get_observations(last - 200, last)["velocity"]).max())

    told = stiffness(config)
    assert told is not None
    assert speed(told) < 1e-2
    assert speed(2.2 * told) > 0.1
    # Dry friction ends a trembling, but not while joints move.
    sticks = finger(tmp_path, "sticks.yml", **late, friction=[0.05] * 3, backlash=[0.0] * 3)
    assert stiffness(str(sticks)) != told
    assert stiffness(str(sticks), ("friction", "backlash")) == told
    assert stiffness(str(finger(tmp_path, "punctual.yml"))) is None
    # The damping of the safety checks alone may be too much.
    too_late = str(finger(tmp_path, "too_late.yml", torque_delay=0.01, measurement_delay=0.01))
    assert stiffness(too_late) == 0.0
    assert settings(0.0) == {"action": "position_change"}
    assert "lower safety.safety_kd" in advice(settings(0.0))
    # A short history is enough for a robot, but not for this.
    short = tmp_path / "short.yml"
    text = configuration_text(config)
    short.write_text(re.sub(r"(?m)^(  history: )\d+", r"\g<1>128", text))
    assert "history: 128" in short.read_text()
    assert stiffness(str(short)) == told
    # One that trembles beyond its limits stops with a fault.
    later = finger(tmp_path, "later.yml", torque_delay=0.006, measurement_delay=0.006)
    text = configuration_text(str(later))
    text = re.sub(r"soft_upper: .*", "soft_upper: [0.03, 0.93, -1.6]", text)
    narrow = tmp_path / "narrow.yml"
    narrow.write_text(re.sub(r"hard_upper: .*", "hard_upper: [0.04, 0.94, -1.59]", text))
    assert stiffness(str(narrow)) == stiffness(str(later))


def test_strokes_move_one_finger_at_a_time_and_press_down() -> None:
    kinematics = trifinger.ModelKinematics("pushing")
    _, _, limits = read_joint_facts(configuration_text("pushing"), "trifinger")
    start = kinematics.initial_position
    rows = strokes(kinematics, limits, 1e-3, start, 0.0095, np.array([0.0, 0.0, 0.065]))
    place = rows["position"]
    assert (place >= limits["soft_lower"]).all()
    assert (place <= limits["soft_upper"]).all()
    assert np.max(np.abs(np.diff(place, axis=0))) < 1e-3 * np.min(limits["max_velocity"])
    moves = (place != start).reshape(len(place), 3, 3).any(axis=2)
    assert moves.sum(axis=1).max() == 1
    pressed = np.flatnonzero(np.any(rows["torque"] != 0, axis=1))[::200]
    forces = []
    for t in pressed:
        finger = int(np.argmax(moves[t])) if moves[t].any() else 0
        mine = slice(3 * finger, 3 * finger + 3)
        lever = kinematics.jacobian(kinematics.frames[finger], place[t])[:3, mine]
        torque = rows["torque"][t] - kinematics.gravity_torques(place[t])
        forces.append(np.linalg.solve(lever.T, torque[mine]))
    assert np.min(forces, axis=0)[2] == pytest.approx(-1.25, abs=0.05)
    assert np.all(np.abs(rows["torque"]) < limits["max_torque"])


def test_a_cubic_through_a_cubic_is_exact() -> None:
    t = 1e-3 * np.arange(200)[:, None]
    place, rate, bent = smooth(2 + t - 3 * t**2 + 40 * t**3, 10, 1e-3)
    inner = slice(10, -10)
    assert place[inner] == pytest.approx((2 + t - 3 * t**2 + 40 * t**3)[inner])
    assert rate[inner] == pytest.approx((1 - 6 * t + 120 * t**2)[inner])
    assert bent[inner] == pytest.approx((-6 + 240 * t)[inner], abs=1e-4)


def test_a_tip_that_sticks_while_it_slides_has_the_friction_of_its_slips() -> None:
    random = np.random.default_rng(1)
    count, friction = 400, 0.8
    press = random.uniform(0.5, 1.5, count)
    sticks = random.random(count) < 0.4
    drag = friction * press * np.where(sticks, random.random(count), 1.0)
    force = np.stack([drag, np.zeros(count), -press], axis=1)
    force += random.normal(0, 0.03, force.shape)
    nothing, three = np.zeros(count), np.zeros((count, 3))
    moments = Moments(
        force=np.repeat(force[:, None, :, None], 3, axis=3),
        touches=np.full((count, 1), "table"),
        normal=np.tile([0.0, 0.0, -1.0], (count, 1, 1)),
        slip=np.tile([0.05, 0.0, 0.0], (count, 1, 1)),
        doubt=nothing[:, None],
        height=nothing,
        velocity=three,
        acceleration=three,
    )
    of_tip = {one.joint: one for one in contacts(moments, "cube")}["tip_table"]
    assert of_tip.is_told
    assert of_tip.low < friction < of_tip.high
    assert of_tip.value == pytest.approx(friction, rel=0.05)


LINKS = """<mujoco><worldbody>
  <body pos="0 0 1" euler="20 0 40">
    <joint name="a" axis="0 1 0" range="-90 90"/>
    <geom type="box" size="0.1 0.02 0.03" pos="0.1 0 0"/>
    <body pos="0.2 0 0" euler="30 50 0">
      <geom size="0.05" pos="0 0.05 0"/>
      <body pos="0 0 0.1">
        <joint name="b" axis="1 0 0" range="-90 90"/>
        <geom type="box" size="0.02 0.1 0.03" pos="0 0.1 0"/>
      </body>
    </body>
  </body>
  <body name="ball" pos="0 1 0"><freejoint/><geom size="0.02"/></body>
</worldbody><actuator>
  <motor joint="a" forcerange="-30 30"/><motor joint="b" forcerange="-30 30"/>
</actuator></mujoco>"""
LINKS_CONFIGURATION = """name: links
driver: simulation
robot: {mjcf: links.xml}
safety:
  every_joint: {safety_kd: 0.01, max_velocity: 3, braking: 10, soft_lower: -1.2, soft_upper: 1.2,
                default_kp: 2, default_kd: 0.05}
identified: {link_mass: [1.2, 0.9], rotor_inertia: [0.1, 0.2], link_center_x: [0.01, 0],
             link_center_y: [-0.02, 0.01], link_center_z: [0.03, 0.004]}
"""


def test_forces_are_of_the_robot_that_was_identified_with_what_is_fixed_to_its_links(
    log: Path, tmp_path: Path
) -> None:
    (tmp_path / "links.xml").write_text(LINKS)
    config = tmp_path / "links.yml"
    config.write_text(LINKS_CONFIGURATION)
    robot = trifinger.ModelKinematics(str(config))  # which C++ has made so
    motion = replace(
        read_motion([log], robot_config=str(log.parent / "robot.yml")),
        configuration=configuration_text(str(config)),
        joints=tuple(robot.joint_names),
    )
    scene = Scene(motion, str(config), "ball")
    place, speed, acceleration = np.array([0.3, -0.5]), np.array([0.7, 0.4]), np.array([1.0, -2.0])
    scene.set(place, speed, np.array([0.0, 1, 0, 1, 0, 0, 0]), np.zeros(7))
    expected = robot.mass_matrix(place) @ acceleration + robot.bias_torques(place, speed)
    assert scene.inverse_dynamics(acceleration) == pytest.approx(expected, rel=1e-5)


BALL = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <geom type="plane" size="1 1 1" condim="1"/>
  <body><joint type="slide" axis="0 0 1"/>
    <geom size="0.01" mass="0.1" condim="1" priority="1" solimp="0.95 0.99 0.001 0.5 2"/></body>
</worldbody></mujoco>"""


def pressed_ball(time_constant: float, damping_ratio: float, friction: float) -> np.ndarray:
    """Forces that a ball is told to press with, and its depths, every 10 ms."""
    model = mujoco.MjModel.from_xml_string(BALL)
    model.geom_solref[1] = time_constant, damping_ratio
    data = mujoco.MjData(model)
    data.qpos[0] = 0.01
    rows = []
    for t in range(6000):
        rate = 0.5 if t < 4000 else 8.0
        push = 0.75 - 0.5 * np.cos(2e-3 * np.pi * rate * t)
        # The joint holds the ball as long as it can.
        kept = rows[-1][2] if rows else push
        kept = float(np.clip(kept, push - friction, push + friction))
        data.qfrc_applied[0] = -kept
        depth = 0.01 - data.qpos[0]
        mujoco.mj_step(model, data)
        # What its inertia takes is no press.
        rows.append((push + 0.1 * data.qacc[0], depth, kept))
    return np.array(rows)[1500::10]


@pytest.mark.parametrize(
    ("time_constant", "damping_ratio", "friction"),
    [(0.006, 1.0, 0.0), (0.02, 0.5, 0.0), (0.012, 2.0, 0.0), (0.02, 1.0, 0.1)],
)
def test_presses_tell_how_soft_a_tip_is_and_how_much_it_damps(
    time_constant: float, damping_ratio: float, friction: float
) -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    contact = SoftContact.of(model, 1)
    assert contact is not None
    assert contact.inverse_mass == pytest.approx(10)
    row = pressed_ball(time_constant, damping_ratio, friction)
    rests = np.ones((len(row), 2), dtype=bool)
    rests[350:, 1] = False  # another finger presses a shorter time
    force, depth = np.repeat(row[:, :1, None], 2, axis=1), np.repeat(row[:, 1:2], 2, axis=1)
    found = presses(rests, force, depth, 0.01)
    assert [len(one) for _, one in found] == [len(row) - 20, 330]
    of_tip = {one.name: one for one in softness(found, contact, 0.01)}
    assert of_tip["tip_time_constant"].is_told
    assert of_tip["tip_time_constant"].value == pytest.approx(time_constant, rel=0.05)
    assert of_tip["tip_damping_ratio"].value == pytest.approx(damping_ratio, rel=0.05)


def test_softness_is_not_told_by_what_does_not_show_it() -> None:
    contact = SoftContact.of(mujoco.MjModel.from_xml_string(BALL), 1)
    assert contact is not None
    row = pressed_ball(0.006, 1.0, 0.0)
    force, depth = row[:, :1, None], row[:, 1:2]
    rests = np.ones((len(row), 1), dtype=bool)
    assert not presses(~rests, force, depth, 0.01)
    assert not presses(rests & (np.arange(len(row)) % 150 > 0)[:, None], force, depth, 0.01)
    assert not presses(rests, 0.1 * force, depth, 0.01)
    assert not presses(rests, np.nan * force, depth, 0.01)

    def is_told(depth: np.ndarray, contact: SoftContact | None = contact) -> bool:
        found = presses(rests, force, depth, 0.01)
        assert found
        return any(one.is_told for one in softness(found, contact, 0.01))

    assert is_told(depth)
    assert not is_told(depth, None)
    assert is_told(depth, replace(contact, time_constant=0.1, damping_ratio=10.0))
    assert not is_told(0 * depth)
    assert not is_told(-depth)
    assert not is_told(np.random.default_rng(0).normal(0, 1e-6, depth.shape))
    stiffness_instead = BALL.replace("solimp=", 'solref="-1e4 -1e2" solimp=')
    assert SoftContact.of(mujoco.MjModel.from_xml_string(stiffness_instead), 1) is None


def test_damping_that_friction_may_be_is_not_told_and_the_tip_is_as_soft_as_it_is() -> None:
    contact = SoftContact.of(mujoco.MjModel.from_xml_string(BALL), 1)
    assert contact is not None
    row = pressed_ball(0.006, 1.0, 0.0)
    late = np.roll(row[:, 0], -2)  # if so much were friction
    force = np.stack([row[:, 0], late], axis=1)
    [(forces, depths)] = presses(np.ones((len(row), 1), bool), force[:, None], row[:, 1:2], 0.01)
    of_tip = {
        one.name: one
        for one in softness([(forces, depths)], replace(contact, damping_ratio=0.5), 0.01)
    }
    assert not of_tip["tip_damping_ratio"].is_told
    assert of_tip["tip_time_constant"].value == pytest.approx(0.012, rel=0.05)


@pytest.mark.slow
def test_lifts_and_slides_tell_the_mass_and_the_friction_of_an_object(
    tmp_path: Path, start_program: StartProgram
) -> None:
    mass, friction, of_tip, softness, damping = 0.12, 0.4, 0.7, 0.012, 0.8
    config = tmp_path / "heavy.yml"
    config.write_text(
        "extends: pushing\n"
        f"objects: [{{name: cube, type: cube, size: [0.065], mass: {mass}}}]\n"
        "contact: {tip_friction: 1.0, tip_torsional_friction: 0.005, floor_friction: 0.5, "
        f"tip_time_constant: {softness}, tip_damping_ratio: {damping}, "
        f"friction: {{object_table: {friction}, tip_table: {of_tip}}}}}\n"
        "simulation: {seed: 1, object_period: 0.01, object_delay: 0.02, "
        "object_position_noise: 0.0005, object_orientation_noise: 0.005}\n"
    )
    logs = []
    for task in ("lift", "slide"):
        name = f"handled-{task}"
        robot = start_program("run", str(config), "--name", name, "--non-real-time")
        robot.wait_for("waits for a user")
        (tmp_path / task).mkdir()
        with recorder(name, tmp_path / task):
            words = ["manipulate", task, "--robot", name, "-o", str(tmp_path / "report")]
            words += ["--identified", str(config)]
            subprocess.run([program(), *words], check=True)
        logs.append(str(tmp_path / task))
    output = tmp_path / "found"
    words = ["--object", "cube", "--robot-config", "pushing", "-o", str(output)]
    robot = start_program("run", str(config), "--name", "handled", "--non-real-time")
    robot.wait_for("waits for a user")
    subprocess.run([*IDENTIFY, "handled", *words], check=True)
    logs.extend(map(str, (output / "logs").iterdir()))
    subprocess.run([*IDENTIFY, *logs, *words], check=True)
    found = configuration_text(str(output / HANDLED))

    def value(key: str) -> float:
        return float(re.findall(rf"^ +{key}: (\S+)", found, re.MULTILINE)[0])

    assert value("mass") == pytest.approx(mass, rel=0.1)
    assert value("object_table") == pytest.approx(friction, rel=0.1)
    assert value("tip_table") == pytest.approx(of_tip, rel=0.1)
    assert value("tip_time_constant") * value("tip_damping_ratio") == pytest.approx(
        softness * damping, rel=0.1
    )
    assert value("tip_damping_ratio") == pytest.approx(damping, rel=0.5)
    assert value("object_delay") == pytest.approx(0.02)
    assert value("object_position_noise") == pytest.approx(0.0005, rel=0.2)


def test_an_object_needs_a_robot_that_is_known(tmp_path: Path, log: Path) -> None:
    def error(*words: str) -> str:
        done = subprocess.run(
            [*IDENTIFY, str(log), "--object", "cube", "-o", str(tmp_path), *words],
            check=False, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 2
        return done.stderr

    assert "--robot-config" in error()
    assert "nothing says where" in error("--robot-config", str(log.parent / "robot.yml"))
    assert not (tmp_path / HANDLED).exists()


def test_what_is_fitted_simulates_a_robot_that_has_boards(tmp_path: Path) -> None:
    config = tmp_path / "fitted.yml"
    config.write_text("extends: trifinger_edu_emulated\ndriver: simulation\n")
    assert "boards:" in configuration_text(str(config))
    simulation = trifinger.Simulation(str(config))
    with simulation.connect() as robot:
        assert robot.latest_observation().position.shape == (9,)
    config.write_text("extends: trifinger_edu_emulated\ndriver: simulation\nboard: {}\n")
    with pytest.raises(trifinger.Error, match="board is not a known key"):
        trifinger.Simulation(str(config))


def test_a_check_names_what_has_changed_by_more_than_chance() -> None:
    def friction(value: float, half: float) -> Figure:
        return Figure("friction", "a", value, value - half, value + half, 0.0, True, "")

    before, near, far = friction(0.01, 1e-3), friction(0.0105, 1e-3), friction(0.02, 1e-3)
    assert not check([before], [near])
    assert not check([before], [replace(far, is_told=False)])
    assert not check([before], [friction(0.02, 1e-2)])
    (change,) = check([before], [far])
    assert str(change).startswith("friction of joint 'a' is 0.02 (0.019 to 0.021), was 0.01")
    for kind in KINDS:
        old, new = (replace(one, name=kind.name) for one in (before, friction(1.0, 1e-3)))
        assert check([old], [new])


@pytest.mark.slow
def test_the_command_writes_a_simulation_and_says_later_that_a_robot_has_changed(
    log: Path, tmp_path: Path
) -> None:
    described, folder = finger(tmp_path, "described.yml"), tmp_path / "fitted"
    words = [*IDENTIFY, str(log), "-o", str(folder), "--robot-config", str(described)]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    assert "figures are told" in said
    assert f"extends: {json.dumps(str(described))}" in (folder / "fitted.yml").read_text()
    worn = finger(tmp_path, "worn.yml", **(TRUE | {"friction": [0.004, 0.03, 0.009]}))
    later = recorded(worn, tmp_path / "later", 40.0, seed=1)
    words = [*IDENTIFY, "--check", str(later), "-o", str(folder)]
    words += ["--robot-config", str(described), "--json"]
    ended = subprocess.run(words, capture_output=True, text=True)
    assert ended.returncode == 1
    changed = json.loads(ended.stdout)["changed"]
    assert any("friction of joint 'finger_upper_to_middle_joint" in one for one in changed)
    assert len((folder / "history.jsonl").read_text().splitlines()) == 1


def test_the_command_refuses_what_is_neither_log_nor_robot() -> None:
    ended = subprocess.run([*IDENTIFY, "nobody"], capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert ended.stderr == ("trifinger identify: 'nobody' is neither a log nor a robot that runs\n")


@pytest.mark.slow
def test_the_commands_of_the_page_identify_a_robot(
    tmp_path: Path, start_program: StartProgram
) -> None:
    worn = ("--set", "simulation.condition=worn")
    robot = start_program("run", "finger_edu", "--name", "mine", "--non-real-time", *worn)
    robot.wait_for("waits for a user")
    words = [*IDENTIFY, "mine", "-o", str(tmp_path / "fitted"), "--seconds", "30"]
    ended = subprocess.run(words, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert "The robot 'mine' moves for 3" in ended.stdout
    assert "The error of a free run of 1 s is 0." in ended.stdout
    advice = r"--set action=position_change --set position_kp=[\d.]+\n"
    said = re.search(advice, ended.stdout)
    assert said is not None, ended.stdout
    assert said[0].strip() in (tmp_path / "fitted" / "identified.html").read_text()
    assert 'extends: "robot.yml"' in (tmp_path / "fitted" / "fitted.yml").read_text()


@pytest.mark.slow
def test_a_fitted_simulation_trains(tmp_path: Path) -> None:
    nine = {name: value * 3 for name, value in TRUE.items() if isinstance(value, list)}
    config = tmp_path / "fitted.yml"
    config.write_text(f"extends: trifinger_edu\nidentified: {json.dumps(nine)}\n")
    words = [*python_command("train"), "reach", "--robot-config", str(config), "--episodes", "2"]
    words += ["-o", str(tmp_path / "reach"), "--set", "action=position_change"]
    words += ["--set", "position_kp=2.4"]
    words += ["--set", "motor_gain=(0.92, 1.08)"]
    ended = subprocess.run(words, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "reach" / "reach.policy").exists()
