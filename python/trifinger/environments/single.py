# SPDX-License-Identifier: BSD-3-Clause
"""A task on one robot, simulated or real."""

import contextlib
from collections.abc import Callable
from typing import Any, Literal, get_args

import gymnasium
import numpy as np

from trifinger import _trifinger, mappings
from trifinger._trifinger import Frontend, Observation as Observed, Simulation
from trifinger.arrays import Array
from trifinger.cameras import Cameras
from trifinger.environments.options import (
    AnyTask,
    Options,
    require,
    reset_options,
    whole_number,
)
from trifinger.environments.task_environment import (
    AGE,
    MODES,
    Info,
    Mode,
    Observation,
    Part,
    TaskEnvironment,
    copied,
    seed_of,
)
from trifinger.errors import ControlHeld, InvalidArgument, RobotStopped
from trifinger.picture import View

OnLate = Literal["hold", "repeat", "end", "nothing"]

ON_LATE = get_args(OnLate)
RECOVERIES = 3  # of a reset
OBJECT = "object"  # the companion with the poses of objects
NEVER = -(10**12)  # step of an image that never came: it counts as the oldest
_MAPPINGS: dict[str, Callable[..., mappings.DecisionProcess[Any]]] = {
    "approximation": mappings.Approximation,
    "state_augmentation": mappings.StateAugmentation,
}


# The driver's own code of the fault, or -1 for any other fault.
def _code_of(stopped: RobotStopped) -> int:
    fault = stopped.fault
    return fault.detail if fault is not None and fault.code == "driver" else -1


class Environment(TaskEnvironment, gymnasium.Env[Any, Array]):
    """A task on one robot: on its own simulation, or on a robot that `connect` attaches to.

    `task` is the name of a task, MODULE:CLASS for one in Python, or an object of such a class.
    `connect` returns a front-end in a new session: `lambda: trifinger.connect("trifinger-edu")`.
    `config` and `config_overrides` must describe that robot. reset() moves it by actions to where
    the episode begins; objects stay where they are. Noise of joints in `options` is added only in
    the environment's own simulation, never to what a connected robot measures. `view` is the camera
    and the size of what `render` draws; a window starts with it. `changes` are other values of
    options, as in `duration=1.0`.

    A connected robot in real time does not wait. Before the first action of an episode it stays
    where reset() has brought it, whatever the program does meanwhile. `on_late` says what happens
    if a later action does not come in time: "hold" holds the robot until the action comes, if that
    takes longer than 10 ms, "repeat" lets the last action act until then, "end" is like "hold" and
    truncates the episode, "nothing" leaves it to the robot's back-end. info["late_steps"] is the
    number of steps that this took. With `recovers`, reset() recovers the robot after a fault, up to
    three times. It then moves by itself: only for robots that can hurt nobody.
    """

    _core: _trifinger.Episodes
    # Gymnasium declares it as an attribute of objects, too, so ClassVar would not be compatible.
    metadata = {"render_modes": [*MODES], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        task: AnyTask,
        *,
        options: Options | None = None,
        connect: Callable[[], Frontend] | None = None,
        config: str | None = None,
        config_overrides: dict[str, object] | None = None,
        render_mode: Mode | None = None,
        view: View | None = None,
        on_late: OnLate = "hold",
        recovers: bool = False,
        **changes: Any,
    ) -> None:
        require(on_late in ON_LATE, "on_late", on_late, f"one of {', '.join(ON_LATE)}")
        is_own = connect is None
        require(not is_own or on_late == "hold", "on_late", on_late, "left out without connect")
        require(not (is_own and recovers), "recovers", recovers, "left out without connect")

        measured = {} if is_own else {"position_noise": 0.0, "velocity_noise": 0.0}
        super().__init__(
            task,
            1,
            lambda known, options, scene: _trifinger.Episodes(
                known, options.changed(**measured).to_json(), *scene
            ),
            options=options,
            config=config,
            config_overrides=config_overrides,
            render_mode=render_mode,
            view=view,
            changes=changes,
        )
        if self.options.observation == "goal":
            # Checkers take an environment that has this for one with goals.
            self.compute_reward = self._compute_reward
        self._on_late = on_late
        self._recoveries = 1 if is_own else RECOVERIES * recovers
        self._object = self._core.object_name
        self._sees_objects = bool(self._object or self._core.bodies)
        self.simulation = Simulation(*self.scene) if connect is None else None
        """The environment's own simulation; None for a connected robot."""
        # What knows where the object really is, if that decides about the outcome.
        self._judge = self.simulation if self._core.judges_by_truth else None
        self._poses: Frontend | None = None
        self.process: mappings.DecisionProcess[Any] = _MAPPINGS[self.options.mapping](
            self.simulation.connect if self.simulation else connect, self.options.steps_per_action
        )
        """The mapping; `process.robot` is the front-end of the session."""
        self.observation_space = self._observation_space()
        self.action_space = self._action_space()
        self._cameras: Cameras | None = None
        self._image: dict[str, Array] = {}  # the newest of each camera
        self._captured: dict[str, int] = {}  # their steps
        self._image_age = np.zeros(0, np.float32)
        self._object_age_now = -1
        self._seed: int | None = None
        self._episode = 0
        self._is_running = False
        self._acted_to = -1  # the last step whose outcome is known
        self._has_acted = False
        self._late_steps = 0
        self.metadata = {**type(self).metadata, "render_fps": self._frame_rate}

    def __repr__(self) -> str:
        return f"Environment('{self.task}', {self.options})"

    @property
    def episode(self) -> tuple[int, int]:
        """The seed, and the number of the present episode among those of the seed."""
        if self._seed is None:
            raise gymnasium.error.ResetNeeded("no episode has begun: call reset() first")
        return self._seed, self._episode - 1

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begins episode 0 of `seed`; without `seed`, the next episode of the last seed.

        If no seed was ever given, one is drawn: `np_random_seed` modulo 2^32. `options` may be
        {"episode": n} to begin episode n instead. Raises what `connect` raises: ControlHeld if
        somebody else controls the robot, RobotStopped after a fault, if the environment may not
        recover it. It recovers faults of its own simulation by itself.
        """
        if seed is not None:
            seed = whole_number("seed", seed, 64)
        options = reset_options(options)
        episode = options.get("episode")
        if episode is not None:
            episode = whole_number('options["episode"]', episode, 64)
        super().reset(seed=seed)
        if seed is not None:
            self._seed, self._episode = seed, 0
        elif self._seed is None:
            self._seed = seed_of(self)
        if episode is not None:
            self._episode = episode
        self._is_running = False
        self._late_steps = 0
        position, object_position, orientation, velocity, variation, stream, joints = (
            self._core.begin(self._seed, self._episode)
        )
        self._episode += 1
        if self.simulation is not None:
            self.simulation.vary(variation)
            self.simulation.reset(position, self._seed, stream, joints or None)
            if self._object:
                self.simulation.place_object(self._object, object_position, orientation)
                self.simulation.set_object_velocity(self._object, velocity)
        for name, height, width in self._core.cameras:
            self._image[name] = np.zeros((height, width, 3), np.uint8)
            self._captured[name] = NEVER
        try:
            self._begin_session()
            robot = self.process.robot
            if self._image:
                self._cameras = Cameras(robot)
            self._poses = robot.companion(OBJECT) if self._sees_objects else None
            seen = self._core.look(robot, self.process.time_index, self._poses, self._judge)
            self._take(seen)
            self._acted_to = self._core.last_step
        except BaseException:
            # A robot that has begun to move must not stay without control.
            self.process.close()
            raise
        self._is_running = True
        self._has_acted = False
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info(is_success=seen[4])

    # Begins a session, after a fault if that is allowed, and moves a connected robot to its start.
    def _begin_session(self) -> None:
        for recoveries in range(self._recoveries, -1, -1):
            try:
                state = self.process.reset()
                if self.simulation is None:
                    # All actions before the first of the episode are places to be.
                    self.process.robot.set_on_late("repeat")
                    self._move_there(state)
                return
            except RobotStopped as stopped:
                if recoveries == 0:
                    raise
                try:
                    # Only the handle that has stopped is surely that of this robot.
                    robot = self.process.robot
                except InvalidArgument:
                    raise stopped from None  # it had stopped before the first session
                robot.recover()

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, Info]:
        """Applies `action`; numbers are clipped to -1 to 1.

        A fault of the robot truncates the episode, with the reward of the last observation.
        info["fault"] is the number of the fault, info["fault_text"] says what it is. Raises
        gymnasium.error.ResetNeeded after the end of the episode, InvalidArgument for a wrong shape
        or NaN. After an exception of a task in Python the episode has ended, and a connected robot
        is given back.
        """
        if not self._is_running:
            raise gymnasium.error.ResetNeeded(
                "the episode has ended, or none has begun: call reset() first"
            )
        numbers = np.ascontiguousarray(action, np.float32)
        if numbers.shape != self.action_space.shape:
            raise InvalidArgument(
                f"the action has shape {numbers.shape}, must have {self.action_space.shape}"
            )
        robot = self.process.robot
        ends_if_late = self._on_late == "end" and self._has_acted
        try:
            if self.simulation is None and not self._has_acted:
                robot.set_on_late("hold" if self._on_late == "end" else self._on_late)
            elif ends_if_late and robot.is_late() and robot.fault() is None:
                return self._end_late(robot)
            before, self._late_steps = self.process.time_index, 0
            seen = self._core.step(robot, numbers, self._poses, self._judge)
            self._take(seen)
        except ControlHeld:
            raise  # another thread steps, and goes on
        except RobotStopped as stopped:
            self._is_running = False
            info = self._info(is_success=False, fault=_code_of(stopped), fault_text=str(stopped))
            return self._observation(), self._last_reward, False, True, info
        except BaseException:
            if self._core.last_step != self._acted_to:
                self._end_unjudged()
            raise
        self._acted_to, reward, terminated, truncated, success, _ = seen
        if self._has_acted:
            self._late_steps = self._acted_to - before - self.options.steps_per_action
            truncated = truncated or (ends_if_late and self._late_steps > 0)
        self._has_acted = True
        if terminated or truncated:
            self._finish()
        if self.render_mode == "human":
            self.render()
        return self._observation(), reward, terminated, truncated, self._info(is_success=success)

    # The next action comes too late: the robot is already held.
    def _end_late(self, robot: Frontend) -> tuple[Observation, float, bool, bool, Info]:
        is_first = isinstance(self.process, mappings.StateAugmentation)  # of those of its action
        due = self.process.time_index + (self.options.steps_per_action if is_first else 1)
        self._late_steps = max(1, robot.current_time_index() + 1 - due)
        self._finish()
        return self._observation(), self._last_reward, False, True, self._info(is_success=False)

    def _finish(self) -> None:
        self._is_running = False
        # Actions that have not acted yet may cause a fault; the episode has ended before it.
        with contextlib.suppress(RobotStopped):
            self.process.finish()

    # The robot has moved, and nobody knows how the episode goes on.
    def _end_unjudged(self) -> None:
        self._is_running = False
        self.process.stepped_to(self._core.last_step)
        if self.simulation is None:
            self.process.close()

    def render(self) -> Any:
        """Draws the scene: as an image, height x width x 3, or in a window with mode "human"."""
        self._require_render_mode()
        return self._draw(self._configuration(), self._arrays["desired"])

    def close(self) -> None:
        """Gives the robot back and closes the drawing."""
        self._is_running = False
        self.process.close()
        self._poses = None
        self._close_drawing()

    # Takes in what C++ has seen, and what the cameras have.
    def _take(self, seen: tuple[int, float, bool, bool, bool, int]) -> None:
        time_index, self._last_reward, *_, self._object_age_now = seen
        self.process.stepped_to(time_index)
        if self._cameras is not None:
            self._look_at_images(self._cameras)

    # Takes the good ones of the newest images. Of a camera without a good one, the last one stays.
    def _look_at_images(self, cameras: Cameras) -> None:
        now = self.process.time_index
        images = cameras.get_latest_at(now)
        for name, last in self._image.items():
            if images is None or images.frame(name).state != "good":
                continue
            captured = int(images.element["stamp"]["capture_index"])
            if captured == self._captured[name]:
                continue
            image = images[name]
            if image.shape != last.shape:
                raise InvalidArgument(
                    f"the images of {name} have {image.shape[1]} x {image.shape[0]} pixels; "
                    f"camera_size is {self.options.camera_size}"
                )
            self._image[name], self._captured[name] = image, captured
        ages = [min(now - step, self._oldest_image_age) for step in self._captured.values()]
        self._image_age = np.array(ages, np.float32)

    def _observation(self) -> Observation:
        return copied(self._views())

    def _images(self, _part: Part) -> dict[str, Array]:
        return self._image | {AGE: self._image_age} if self._image else {}

    def _object_age(self, _part: Part) -> Any:
        return self._object_age_now

    def _info(self, **more: Any) -> Info:
        info: Info = {"is_success": False, "fault": 0} | self._measures()
        if info["distance"].ndim == 0:
            info["distance"] = float(info["distance"])
        if self.simulation is None:
            info["late_steps"] = self._late_steps
        return info | more

    # Moves a connected robot to where the episode begins.
    def _move_there(self, state: Any) -> None:
        self._core.check_robot(self.process.robot.documents().get("configuration.yml"))
        self._oldest_sure_age = self._core.oldest_sure_age
        if self._object:
            self.process.robot.companion(OBJECT)  # raises if there is none
        seen: Observed = state.observation if isinstance(state, mappings.AugmentedState) else state
        for point in self._core.approach(seen.position):
            self.process.step(self.process.robot.new_action(position=point))

    def _configuration(self) -> Array:
        if self.simulation is not None:
            return np.asarray(self.simulation.configuration())
        robot = self.process.robot
        parts = [np.asarray(robot.latest_observation().position)]
        if self._object:
            pose = robot.companion(OBJECT).latest_observation()[self._object]
            parts += [pose["position"], pose["orientation"]]
        return np.concatenate(parts)
