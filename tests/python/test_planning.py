# SPDX-License-Identifier: BSD-3-Clause
"""Planning from Python: the same as in C++, and costs that are functions of Python."""

import gc
import itertools
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import BUILD
from numpy.typing import ArrayLike, NDArray
from trifinger import control
from trifinger.control import CostKind, CostShape, CostTerm, PlannedCommand, PlanningMethod

pytestmark = pytest.mark.bindings

Array = NDArray[np.float64]
WATCHDOG = 60.0  # [s]
METHODS = [
    PlanningMethod.PREDICTIVE_SAMPLING,
    PlanningMethod.CROSS_ENTROPY,
    PlanningMethod.PATH_INTEGRAL,
]
GOAL = control.Pose((0.03, 0.02, 0.0325))


def push() -> list[CostTerm]:
    """Returns what the program plan_push has."""
    return [
        CostTerm(kind=CostKind.OBJECT_POSITION, weight=10, end_weight=1, goal=GOAL),
        CostTerm(kind=CostKind.TIP_OBJECT, weight=2, distance=0.046),
        CostTerm(kind=CostKind.JOINT_VELOCITY, weight=0.01, shape=CostShape.SQUARE),
    ]


def reach() -> list[CostTerm]:
    return [
        CostTerm(kind=CostKind.JOINT_POSITION, joints=[0.2, 0.5, -1.2]),
        CostTerm(kind=CostKind.JOINT_VELOCITY, weight=0.02),
    ]


def few(
    method: PlanningMethod = PlanningMethod.PATH_INTEGRAL, rounds: int = 1
) -> control.PlannerOptions:
    return control.PlannerOptions(
        method=method, samples=10, rounds=rounds, horizon=0.12, num_threads=1, seed=7
    )


def of_rollouts(cost: Callable[[control.RolloutBatch], Array]) -> control.PlanningTask:
    return control.PlanningTask(batch_cost=cost)


@pytest.fixture(scope="module")
def model() -> control.PlanningModel:
    return control.PlanningModel()


# ---- the same as in C++ ----


@pytest.mark.without_sanitizer
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("command", [PlannedCommand.POSITION, PlannedCommand.TORQUE])
def test_the_same_seed_finds_the_same_plan_as_in_cpp(
    method: PlanningMethod, command: PlannedCommand, model: control.PlanningModel
) -> None:
    spline = control.SplineKind.CUBIC
    numbers = [str(int(kind.value)) for kind in (method, command, spline)]
    program = [str(BUILD / "tests/python/plan_push"), *numbers]
    printed = subprocess.run(program, check=True, capture_output=True, text=True).stdout
    expected = [[float.fromhex(word) for word in line.split()] for line in printed.splitlines()]

    options = few(method, rounds=2)
    options.command = command
    options.spline = spline
    planner = control.PredictivePlanner(model, control.PlanningTask(push(), late_factor=3), options)
    start = model.initial_state()
    start.velocity[1] = 0.3
    for numbers_of_plan in expected:
        plan = planner.plan(start)
        assert [plan.cost, *plan.commands.values.ravel()] == numbers_of_plan
        start.time += 0.02


def test_a_model_has_the_limits_of_its_configuration() -> None:
    usual = control.PlanningModel()
    weak = control.PlanningModel(
        overrides={"safety.max_torque": 0.18, "safety.continuous_torque": 0.18}
    )
    assert weak.joints[0].max_torque == pytest.approx(usual.joints[0].max_torque / 2)
    half = control.PlanningModel(options=control.PlanningModelOptions(torque_share=0.5))
    assert half.joints[0].max_torque == pytest.approx(usual.joints[0].max_torque * 0.5 / 0.95)


# ---- the laws of plans ----


def test_predictive_sampling_never_gets_worse(model: control.PlanningModel) -> None:
    options = few(PlanningMethod.PREDICTIVE_SAMPLING)
    planner = control.PredictivePlanner(model, control.PlanningTask(push()[:2]), options)
    start = model.initial_state()
    plans = [planner.plan(start) for _ in range(10)]
    for before, after in itertools.pairwise(plans):
        assert after.previous_cost == before.cost
        assert after.cost <= before.cost
        assert after.cost == after.least_cost
    assert plans[-1].cost < 0.98 * plans[0].previous_cost
    assert planner.newest.number == 10


@pytest.mark.parametrize("method", METHODS)
def test_a_batch_cost_equal_to_terms_finds_the_same_plan(
    method: PlanningMethod, model: control.PlanningModel
) -> None:
    def cost(batch: control.RolloutBatch) -> Array:
        cube = batch.positions[:, :, 9:12]
        far = np.linalg.norm(cube - GOAL.position, axis=-1)
        reach = np.linalg.norm(batch.tips - cube[:, :, None], axis=-1)
        tips = np.maximum(0, reach - 0.046).sum(axis=-1)
        speed = (batch.velocities[:, :, :9] ** 2).sum(axis=-1)
        running = (10 * far + 2 * tips + 0.01 * speed)[:, :-1]
        costs: Array = batch.time_step * running.sum(axis=1) + far[:, -1]
        return costs

    options = few(method, rounds=2)
    start = model.initial_state()
    plans = []
    for task in (control.PlanningTask(push()), of_rollouts(cost)):
        planner = control.PredictivePlanner(model, task, options)
        plans.append(planner.plan(start))
    assert plans[0].cost == pytest.approx(plans[1].cost, rel=1e-9)
    np.testing.assert_allclose(plans[0].commands.values, plans[1].commands.values, rtol=1e-7)


def test_a_batch_has_all_rollouts_and_the_function_may_keep_it(
    model: control.PlanningModel,
) -> None:
    batches = []

    def cost(batch: control.RolloutBatch) -> Array:
        batches.append(batch)
        return np.arange(batch.num_rollouts, dtype=float)

    planner = control.PredictivePlanner(model, of_rollouts(cost), few(rounds=3))
    start = model.initial_state()
    start.time = 5.0
    plan = planner.plan(start)
    np.testing.assert_array_equal(planner.costs, np.arange(10))
    # Once per round, and once for the plan itself.
    assert [batch.num_rollouts for batch in batches] == [10, 10, 10, 1]
    kept = [batch.positions.copy() for batch in batches]
    del planner
    gc.collect()
    for batch, positions in zip(batches, kept, strict=True):
        np.testing.assert_array_equal(batch.positions, positions)
        shape = (batch.num_rollouts, 21)
        assert (batch.num_states, batch.begin, batch.time_step) == (21, 5.0, model.time_step)
        assert batch.positions.shape == (*shape, model.position_size)
        assert batch.velocities.shape == (*shape, model.velocity_size)
        assert batch.targets.shape == batch.torques.shape == (*shape, 9)
        assert batch.tips.shape == (*shape, 3, 3)
    np.testing.assert_array_equal(batches[-1].positions[0], plan.states.positions)
    np.testing.assert_array_equal(batches[-1].targets[0, 0], plan.commands.at(5.0)[0])


def test_simulate_goes_where_the_plan_leads_to(model: control.PlanningModel) -> None:
    planner = control.PredictivePlanner(model, control.PlanningTask(push()), few())
    start = model.initial_state()
    reached: dict[str, Array] = {}
    keeper = control.PlanningTask(
        push(),
        lambda batch: reached.update(end=batch.positions[0, -1]) or np.zeros(len(batch.tips)),
    )
    planner.set_task(keeper)
    plan = planner.plan(start)
    cost, end = planner.simulate(start, plan.commands, 0.12)
    assert cost == pytest.approx(plan.cost, rel=1e-12)
    assert end.time == pytest.approx(0.12)
    np.testing.assert_allclose(end.position, plan.states.positions[-1], atol=1e-12)
    np.testing.assert_array_equal(reached["end"], plan.states.positions[-1])


def test_weights_are_those_of_their_equations() -> None:
    costs = np.array([3.0, 1.0, np.inf, 2.0, 5.0])
    weights = control.path_integral_weights(costs, 0.5)
    expected = np.exp(-(costs - 1.0) / (0.5 * (3.0 - 1.0)))
    np.testing.assert_allclose(weights, expected / expected.sum())
    np.testing.assert_array_equal(control.elite_weights(costs, 2), [0, 0.5, 0, 0.5, 0])
    assert control.elite_weights([], 2).size == control.path_integral_weights([], 0.5).size == 0


# ---- states, splines ----


def test_states_hold_joints_and_objects_in_place(model: control.PlanningModel) -> None:
    state = model.initial_state()
    position = state.position
    model.set_joints(np.arange(9) / 10, np.arange(9), state)
    cube = model.object("cube")
    turned = control.rotation_from_vector((0.1, 0.2, 0.3))
    twist = control.Twist((1, 2, 3), (4, 5, 6))
    model.set_object(cube, control.Pose((0.1, 0, 0.2), turned), twist, state)
    np.testing.assert_array_equal(position[:9], np.arange(9) / 10)
    np.testing.assert_allclose(model.object_pose(cube, state.position).orientation, turned)
    found = model.object_twist(cube, state.position, state.velocity)
    np.testing.assert_allclose([found.linear, found.angular], [(1, 2, 3), (4, 5, 6)])
    state.position = np.zeros(16)
    np.testing.assert_array_equal(position, np.zeros(16))
    with pytest.raises(trifinger.InvalidArgument, match="position has 3 numbers, must have 16"):
        state.position = np.zeros(3)


def test_splines_go_through_their_knots() -> None:
    spline = control.KnotSpline(control.SplineKind.LINEAR, 3, 2, 0.1, begin=1.0)
    spline.values = [[0, 0], [1, 2], [3, 3]]
    spline.knot(2)[1] = 5
    value, rate = spline.at(1.15)
    np.testing.assert_allclose(value, [2, 3.5])
    np.testing.assert_allclose(rate, [20, 30])
    assert spline.end == pytest.approx(1.2)
    spline.move_to(2.0)
    np.testing.assert_allclose(spline.at(2.1)[0], [1, 2])
    with pytest.raises(trifinger.InvalidArgument, match="must be 0 to 2"):
        spline.knot(3)
    with pytest.raises(trifinger.InvalidArgument, match=r"values has shape \(2, 2\), must"):
        spline.values = np.zeros((2, 2))


def test_arrays_outlive_what_they_show(model: control.PlanningModel) -> None:
    planner = control.PredictivePlanner(model, control.PlanningTask(push()), few())
    plan = planner.plan(model.initial_state())
    states, values = plan.states, plan.commands.values
    expected = values.copy()
    positions, its_model = states.positions, planner.model
    del plan, planner, states
    gc.collect()
    np.testing.assert_array_equal(values, expected)
    assert positions.shape == (21, 16)
    assert its_model.num_joints == 9


# ---- what is refused ----


def test_errors_are_those_of_cpp(model: control.PlanningModel) -> None:
    task = control.PlanningTask(push())
    refused = trifinger.InvalidArgument
    with pytest.raises(refused, match="samples is 0, must be at least 1"):
        control.PredictivePlanner(model, task, control.PlannerOptions(samples=0))
    with pytest.raises(refused, match="samples is 0, must be at least 1"):
        control.OnlinePlanner(model, task, control.PlannerOptions(samples=0))
    with pytest.raises(refused, match="object 1, the model has 1"):
        control.PredictivePlanner(model, control.PlanningTask([CostTerm(index=1)]))
    with pytest.raises(refused, match="time_step"):
        control.PlanningModel(options=control.PlanningModelOptions(time_step=0))
    with pytest.raises(refused, match="There is no object 'ball'; the scene has cube"):
        model.object("ball")
    planner = control.PredictivePlanner(model, task, few())
    short = control.PlanningState(0, [1, 2], [])
    with pytest.raises(refused, match="the state has 2 positions and 0 velocities"):
        planner.plan(short)
    with pytest.raises(refused, match="the commands have 2 numbers per knot"):
        planner.begin_with(control.KnotSpline(control.SplineKind.LINEAR, 3, 2, 0.1))
    with pytest.raises(refused, match="rollout is 10, must be 0 to 9"):
        planner.knots_of(10)
    # Nothing is written beyond the end of a state.
    cube = model.object("cube")
    with pytest.raises(refused, match="no object 'cube'"):
        model.set_object(cube, control.Pose(), control.Twist(), short)
    with pytest.raises(refused, match="no object 'cube'"):
        model.object_pose(cube, [0] * 15)
    with pytest.raises(refused, match="position of the state has 2"):
        model.set_joints([0] * 9, [0] * 9, short)
    with pytest.raises(TypeError):
        control.PlanningTask([1])  # type: ignore[list-item]
    with pytest.raises(TypeError):
        control.PredictivePlanner(1, task)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        planner.set_terms([1])  # type: ignore[list-item]
    with pytest.raises(TypeError):
        CostTerm(joints=[0] * 10)


def test_a_cost_that_raises_arrives_as_that_exception(model: control.PlanningModel) -> None:
    def cost(batch: control.RolloutBatch) -> Array:
        raise ZeroDivisionError(f"at {batch.begin}")

    planner = control.PredictivePlanner(model, of_rollouts(cost), few())
    with pytest.raises(ZeroDivisionError, match="at 0"):
        planner.plan(model.initial_state())
    # It goes on with another task.
    planner.set_task(control.PlanningTask(push()))
    assert planner.plan(model.initial_state()).cost > 0


@pytest.mark.parametrize(
    ("returned", "error", "text"),
    [
        (np.zeros(3), trifinger.InvalidArgument, r"shape \(3,\), must have \(10,\)"),
        (0.0, trifinger.InvalidArgument, r"shape \(\), must have \(10,\)"),
        (None, trifinger.InvalidArgument, r"shape \(\), must have \(10,\)"),
        (["a"] * 10, ValueError, "could not convert"),
    ],
)
def test_a_cost_must_return_a_number_per_rollout(
    returned: ArrayLike, error: type[Exception], text: str, model: control.PlanningModel
) -> None:
    planner = control.PredictivePlanner(
        model, control.PlanningTask(batch_cost=lambda _: returned), few()
    )
    with pytest.raises(error, match=text):
        planner.plan(model.initial_state())


def test_rollouts_without_a_finite_cost_are_masked(model: control.PlanningModel) -> None:
    def cost(batch: control.RolloutBatch) -> Array:
        costs = np.arange(batch.num_rollouts, dtype=float)
        costs[3:] = np.nan
        return costs

    planner = control.PredictivePlanner(model, of_rollouts(cost), few())
    assert planner.plan(model.initial_state()).num_masked == 7
    assert planner.weights[3:].sum() == 0


def test_one_thread_at_a_time_uses_a_planner(model: control.PlanningModel) -> None:
    inside, may_end = threading.Event(), threading.Event()

    def cost(batch: control.RolloutBatch) -> Array:
        with pytest.raises(trifinger.Error, match="at work"):
            planner.restart()
        inside.set()
        assert may_end.wait(WATCHDOG)
        return np.zeros(batch.num_rollouts)

    planner = control.PredictivePlanner(model, of_rollouts(cost), few())
    start = model.initial_state()
    plans: list[control.Plan] = []
    other = threading.Thread(target=lambda: plans.append(planner.plan(start)))
    other.start()
    assert inside.wait(WATCHDOG)
    for use in (
        lambda: planner.plan(start),
        lambda: planner.newest,
        lambda: planner.costs,
        lambda: planner.set_terms([]),
        lambda: planner.task,
    ):
        with pytest.raises(trifinger.Error, match="at work"):
            use()
    may_end.set()
    other.join()
    assert planner.newest.cost == plans[0].cost == 0


def test_terms_and_task_change_between_plans(model: control.PlanningModel) -> None:
    planner = control.PredictivePlanner(model, control.PlanningTask(push()), few())
    start = model.initial_state()
    assert planner.plan(start).cost > 0
    terms = planner.task.terms
    for term in terms:
        term.weight = term.end_weight = 0
    assert planner.plan(start).cost > 0  # these were copies
    planner.set_terms(terms)
    assert planner.plan(start).cost == 0
    planner.set_task(control.PlanningTask(batch_cost=lambda batch: np.ones(batch.num_rollouts)))
    assert planner.plan(start).cost == 1
    assert planner.task.terms == ()
    assert planner.task.batch_cost is not None


# ---- cycles of references ----


class Owner:
    """Has a planner that has its method."""

    def __init__(self, model: control.PlanningModel, online: bool) -> None:
        task = control.PlanningTask(batch_cost=self.cost)
        make = control.OnlinePlanner if online else control.PredictivePlanner
        self.planner = make(model, task, few())

    def cost(self, batch: control.RolloutBatch) -> Array:
        return np.zeros(batch.num_rollouts)


@pytest.mark.parametrize("online", [False, True])
def test_planners_do_not_keep_their_owners_alive(
    online: bool, model: control.PlanningModel
) -> None:
    owner = Owner(model, online)
    if isinstance(owner.planner, control.OnlinePlanner):
        owner.planner.set_state(model.initial_state())
        owner.planner.wait_for_plan(1, WATCHDOG)
    gone = weakref.ref(owner)
    del owner
    gc.collect()
    assert gone() is None


def test_a_cost_may_drop_its_own_planner(model: control.PlanningModel) -> None:
    dropped = threading.Event()
    planners: list[control.OnlinePlanner] = []

    def cost(batch: control.RolloutBatch) -> Array:
        planners.clear()
        dropped.set()
        return np.zeros(batch.num_rollouts)

    planners.append(control.OnlinePlanner(model, of_rollouts(cost), few()))
    planners[0].set_state(model.initial_state())
    assert dropped.wait(WATCHDOG)


# ---- beside a loop ----


def test_an_online_planner_hands_over_its_plans() -> None:
    model = control.PlanningModel("finger_edu")
    task = control.PlanningTask(reach())
    online = control.OnlinePlanner(
        model, task, few(), control.OnlinePlannerOptions(period=0.04, lead=0.03)
    )
    reference = control.PredictivePlanner(model, task, few())
    assert online.at(0.0) is None
    assert online.status.num_plans == 0
    state = model.initial_state()
    before = None
    for i in range(4):
        state.time = 0.06 * i
        assert online.set_state(state)
        online.wait_for_plan(i + 1, WATCHDOG)
        start = state if before is None else reference.simulate(state, before, 0.03)[1]
        plan = reference.plan(start)
        assert online.status.cost == plan.cost
        assert online.status.begin == start.time
        commands = online.at(start.time + 0.02)
        assert commands is not None
        np.testing.assert_array_equal(commands, plan.commands.at(start.time + 0.02))
        before = plan.commands
    assert not online.set_state(control.PlanningState(0, [], []))
    assert not online.set_terms([])
    with pytest.raises(trifinger.TimedOut, match="only 4 plans were made, 100 were awaited"):
        online.wait_for_plan(100, 0)


def test_an_online_planner_hands_on_what_a_cost_raises() -> None:
    model = control.PlanningModel("finger_edu")

    def cost(_: control.RolloutBatch) -> Array:
        raise ZeroDivisionError("no cost today")

    online = control.OnlinePlanner(model, of_rollouts(cost), few())
    online.set_state(model.initial_state())
    with pytest.raises(ZeroDivisionError, match="no cost today"):
        online.wait_for_plan(1, WATCHDOG)
    with pytest.raises(trifinger.Error, match="its cost function failed"):
        online.wait_for_plan(1, WATCHDOG)


@pytest.mark.parametrize("holder", ["module", "daemon"])
def test_a_program_ends_while_a_cost_of_python_runs(holder: str) -> None:
    program = f"""
import threading, numpy as np
from trifinger import control
model = control.PlanningModel("finger_edu")
begun = threading.Event()
def cost(batch):
    begun.set()
    return np.zeros(batch.num_rollouts)
planner = control.OnlinePlanner(model, control.PlanningTask(batch_cost=cost))
state = model.initial_state()
def feed():
    while True:
        state.time += 0.04
        planner.set_state(state)
        planner.wait_for_plan(planner.status.num_plans + 1)
if {holder!r} == "daemon":
    threading.Thread(target=feed, daemon=True).start()
else:
    planner.set_state(state)
begun.wait()
print("ends")
"""
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=WATCHDOG
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == "ends\n"


# ---- other robots ----


def test_plans_for_the_robot_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "cart.xml"
    path.write_text("""<mujoco model="cart"><option timestep="0.01" gravity="0 0 0"/><worldbody>
      <body name="cart"><joint name="x" type="slide" axis="1 0 0"/><geom size=".1" mass="2"/>
        <site name="nose" pos=".1 0 0"/></body>
      <body name="ball" pos="9 0 0"><freejoint/><geom size=".1"/></body>
    </worldbody><actuator><motor joint="x"/></actuator></mujoco>""")
    joints = [control.PlannedJoint(-1, 1, max_torque=5)]
    model = control.PlanningModel.of_file(path, joints, ["nose"])
    assert (model.num_joints, model.time_step) == (1, 0.01)
    assert [found.name for found in model.objects] == ["ball"]
    options = control.PlannerOptions(
        command=PlannedCommand.TORQUE, least_sigma=0.5, most_sigma=5, horizon=0.5, num_threads=1
    )
    goal = control.Pose((0.3, 0, 0))
    task = control.PlanningTask([CostTerm(kind=CostKind.TIP_POSITION, goal=goal, end_weight=1)])
    plan = control.PredictivePlanner(model, task, options).plan(model.initial_state())
    assert plan.cost < 0.95 * plan.previous_cost
    with pytest.raises(trifinger.InvalidArgument, match="no site 'tail'"):
        control.PlanningModel.of_file(path, joints, ["tail"])
