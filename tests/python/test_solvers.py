# SPDX-License-Identifier: BSD-3-Clause
"""The reachable set of push and lift, and the controller that solves both."""

import itertools

import evaluate_environments
import numpy as np
import pytest
import solvers
from evaluate_environments import Trials
from solvers import RoutePlanner, Trial
from trifinger import control
from trifinger.control import Pose
from trifinger.environments import Environment

# These are hundreds of plans. The tests of their parts run under sanitizers.
pytestmark = pytest.mark.slow

HALF = solvers.SIZE / 2
LIFTED = (0.02, -0.03, 0.08)


def lying(x: float, y: float, yaw: float = 0.0) -> Pose:
    return Pose((x, y, HALF), control.rotation_from_vector((0, 0, yaw)))


@pytest.fixture(scope="module")
def planner() -> RoutePlanner:
    return RoutePlanner()


@pytest.mark.parametrize("goal", [(0.03, 0.05, HALF), LIFTED, (-0.09, 0.02, 0.06)])
@pytest.mark.parametrize("start", [lying(0, 0), lying(0.05, -0.04, 0.7), lying(-0.07, 0.03, 2.0)])
def test_a_route_leads_from_the_start_to_the_goal_without_a_gap(
    planner: RoutePlanner, start: Pose, goal: tuple[float, float, float]
) -> None:
    route = planner.plan(start, goal)
    assert route is not None
    ends = [leg.at(np.inf).pose.position for leg in route]
    begins = [leg.at(0).pose.position for leg in route]
    np.testing.assert_array_equal(begins[0], start.position)
    np.testing.assert_allclose(ends[-1], goal)
    for end, begin in itertools.pairwise([*ends[:-1], begins[-1]]):
        np.testing.assert_array_equal(end, begin)


def test_places_that_fingers_do_not_reach_are_not_in_the_reachable_set(
    planner: RoutePlanner,
) -> None:
    assert planner.plan(lying(0, 0), (0.3, 0, HALF)) is None
    assert planner.plan(lying(0, 0), (0, 0, 0.4)) is None
    assert planner.plan(lying(0.3, 0), (0, 0, HALF)) is None


def test_a_cube_that_slides_leaves_a_part_of_its_weight_on_the_table(planner: RoutePlanner) -> None:
    for goal, share in [((0.03, 0.05, HALF), solvers.TABLE_SHARE), (LIFTED, 0.0)]:
        route = planner.plan(lying(0, 0), goal)
        assert route is not None
        at_rest = route[-1].at(np.inf).acceleration.linear
        np.testing.assert_allclose(at_rest, share * control.gravity())


@pytest.mark.parametrize("yaw", [-2.0, 0.3, 1.5])
@pytest.mark.parametrize("face", [(0, 0, 0), (np.pi / 2, 0, 0), (np.pi, 0, 0), (0, -np.pi / 2, 0)])
@pytest.mark.parametrize("tilt", [(0, 0, 0), (0.3, -0.2, 0)])
def test_a_tilted_cube_comes_to_rest_on_the_nearest_face(
    yaw: float, face: tuple[float, float, float], tilt: tuple[float, float, float]
) -> None:
    turns = [control.Twist(angular=vector) for vector in (face, (0, 0, yaw))]
    resting = Pose((0.1, 0.2, HALF))
    for turn in turns:
        resting = control.moved(resting, turn, 1.0)
    tilted = control.moved(resting, control.Twist((0, 0, 0.01), tilt), 1.0)
    found = solvers.on_table(tilted)
    np.testing.assert_allclose(found.position, resting.position)
    error = control.rotation_error(found.orientation, resting.orientation)
    np.testing.assert_allclose(error, 0, atol=1e-9)


@pytest.mark.parametrize("task", ["push", "lift"])
def test_reachable_goals_are_solved_through_the_interface_of_the_environment(task: str) -> None:
    found = evaluate_environments.run_trials(task, seed=1, goals=3)
    assert found.drawn >= 3
    assert [trial.is_success for trial in found.trials] == 3 * [True]


def test_a_goal_that_one_grasp_does_not_reach_is_reached_with_two(planner: RoutePlanner) -> None:
    environment = Environment("push", options=solvers.options("push"))
    trial = solvers.try_goal(environment, planner, seed=2, episode=30)
    assert trial is not None
    assert (trial.legs, trial.grasps, trial.is_success) == (2, 2, True)


def test_a_cube_that_gets_lost_is_grasped_again(planner: RoutePlanner) -> None:
    environment = Environment("push", options=solvers.options("push"))
    observation, info = environment.reset(seed=1, options={"episode": 1})
    solver = solvers.Solver(planner, observation)
    simulation = environment.simulation
    assert simulation is not None
    has_ended = was_moved = False
    while not has_ended:
        if solver.is_leading and not was_moved:
            # Takes the cube out of the fingers, back to its start.
            simulation.place_object("cube", (0.0, 0.0, HALF))
            was_moved = True
        observation, _, terminated, truncated, info = environment.step(
            solver.act(observation, info)
        )
        has_ended = terminated or truncated
    assert was_moved
    assert solver.grasps > 1
    assert info["is_success"]


def test_the_evaluation_fails_below_95_of_100_goals() -> None:
    def result(successes: int) -> Trials:
        trials = [Trial(1, i, 1, 1, i < successes, 0.001) for i in range(100)]
        return Trials("push", 120, trials)

    assert evaluate_environments.is_solved(result(95))
    assert not evaluate_environments.is_solved(result(94))
    assert "| 94 of 100 |" in evaluate_environments.row(result(94))
