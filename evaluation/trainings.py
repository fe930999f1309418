# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate training`: what each algorithm learns of each task, over three seeds.

Each pair is trained with its own recipe (`Plan.of`), and judged in episodes that no training has
seen. The lift is also trained without each part of its recipe. A result is kept in
docs/results/training.jsonl at once, so an evaluation that was cut off goes on, also in the midst of
a training; docs/results/training.md is written from these. Results of an earlier recipe do not
count.
"""

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from lift_states import KEPT, kept_states
from move_cube import FOLDER, begun, processor_minutes
from trifinger.evaluation import SEED, Evaluator
from trifinger.training import Plan

RESULTS = Path("docs/results/training.md")
SEEDS = (1, 2, 3)
JUDGED = 100  # episodes
ENOUGH = 0.5  # share of them that succeed, by each seed, of what has learned


class Way(NamedTuple):
    """What is trained, and how."""

    task: str
    algorithm: str
    name: str = ""
    """What is not as in the recipe."""
    settings: Mapping[str, Any] = MappingProxyType({})
    episodes: int | None = None
    """None: as many as in the recipe."""

    def plan(self, seed: int) -> Plan:
        """The plan of a training."""
        settings: dict[str, Any] = {}
        if self.task in IN_THE_MIDST:
            settings["reset_states"] = str(KEPT)
        settings |= self.settings
        is_shared = bool(settings.pop("is_shared", False))
        more = {} if self.episodes is None else {"episodes": self.episodes}
        return Plan.of(
            self.task, self.algorithm, is_shared=is_shared, seed=seed, settings=settings, **more
        )

    @property
    def title(self) -> str:
        """The words that choose it."""
        return " ".join(filter(None, (self.task, self.algorithm, self.name)))


PAIRS = (
    Way("reach", "ddpg"),
    Way("reach", "ddpg", "shared", {"is_shared": True}),
    *(Way("reach", algorithm) for algorithm in ("td3", "sac", "ppo")),
    *(Way("finger_reach", algorithm) for algorithm in ("ddpg", "td3", "sac", "ppo")),
    Way("push", "ppo"),
    Way("push", "sac"),
    Way("lift", "ppo"),
    Way("lift_pose", "ppo"),
    Way("move_cube_on_trajectory", "ppo"),
    Way("throw", "ppo"),
    Way("throw", "sac"),
    *(
        Way(f"dclaw_{task}_{kind}", "ppo")
        for task in ("pose", "turn", "screw")
        for kind in ("fixed", "random", "random_dynamics")
    ),
)
SHORT = 8000  # episodes of a lift
PARTS = tuple(
    Way("lift", "ppo", name, settings, SHORT)
    for name, settings in (
        ("the whole recipe", {}),
        ("no states of a controller", {"reset_states": ""}),
        ("no symmetric_view", {"symmetric_view": False}),
        ("no object_offsets", {"object_offsets": False}),
        ("no symmetric_object", {"symmetric_object": False}),
        ("no kernel", {"kernel": 0.0}),
        ("no approach", {"approach": 0.0}),
        ("no action_cost", {"action_cost": 0.0}),
        ("position_change of a push, 0.06", {"position_change": 0.06}),
        ("initial_noise of a push, 0.6", {"initial_noise": 0.6}),
        ("the task's own reward, too", {"reward_scale": 1.0}),
        ("a critic that sees what is hidden", {"asymmetric": True}),
        ("three epochs instead of four", {"epochs": 3}),
        ("steps of 1 ms", {"physics_step": 0.001}),
    )
)
IN_THE_MIDST = ("lift", "lift_pose", "move_cube_on_trajectory")  # begin in states of a controller
TEXT = """\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# What is learned: every task and algorithm

Written by `./run evaluate training`. Each row is a recipe of [training.md](../training.md), trained
with the seeds 1 to 3. Each policy is judged in 100 episodes that no training has seen, as long as
those of the training, with steps of 1 ms, on robots as documented; starts and goals vary. A failure
counts like any other episode, in the distances, too. *Learns*: with each seed at least half of the
episodes succeed. `trifinger train` offers what learns; it takes other pairs with `--untried`.
[learning.md](learning.md), [push.md](push.md) and [lift.md](lift.md) say more of some.

| task | algorithm | episodes | time of one processor | success | distance at the end, median \
| learns |
|---|---|---|---|---|---|---|
{rows}

The trainings of lifts and of the trajectory begin in states of a controller, half of the time
([how](../training.md#a-lift-begins-in-the-midst)). {missing}
"""
PARTS_TEXT = """
## What each part of the recipe is good for

A lift, with {short} episodes, one seed, judged in the same way.

| | time of one processor | success | distance at the end, median |
|---|---|---|---|
{parts}
"""


@dataclass(frozen=True)
class Result:
    """What a policy has learned."""

    way: str
    """Title of the way."""
    seed: int
    recipe: str
    """Digest of the plan without its seed."""
    episodes: int
    minutes: float | None
    """Time of one processor, with the evaluations of the curve; None if it is not known, because
    the training was cut off."""
    success: float
    median: float
    unit: str

    @property
    def spent(self) -> str:
        """The time, in words."""
        if self.minutes is None:
            return "-"
        return f"{self.minutes:.0f}" if self.minutes >= 10 else f"{self.minutes:.1f}"

    @property
    def distance(self) -> str:
        """The median, without its unit."""
        return f"{(100 if self.unit == 'm' else 1) * self.median:.2f}"

    @property
    def shown_unit(self) -> str:
        """The unit of `distance`."""
        return "cm" if self.unit == "m" else self.unit


def digest(plan: Plan) -> str:
    """What a result is a result of: what is not as it is by default, so that a new field that is
    off leaves results as they are."""
    said = {
        field.name: getattr(one, field.name)
        for one in (plan.recipe, plan.options)
        for field in fields(one)
        if getattr(one, field.name) != field.default
    }
    said |= {"episodes": plan.episodes, "reset_states": bool(plan.recipe.reset_states)}
    return hashlib.sha256(json.dumps(said, default=str).encode()).hexdigest()[:12]


def train(way: Way, seed: int) -> Result:
    """Trains, or goes on, and judges."""
    plan = way.plan(seed)
    if plan.recipe.reset_states:
        kept_states()
    # Those that have a page of their own are trained once.
    name = way.task if way.title in ("push ppo", "lift ppo") else way.title
    folder = FOLDER / f"{name} {seed}".replace(" ", "_").replace(",", "")
    begin = time.process_time()
    with closing(begun(plan, folder)) as training:
        is_new = not training.curve
        training.run()
        minutes = (time.process_time() - begin) / 60 if is_new else minutes_of(folder)
        evaluator = Evaluator(**plan.environment, episodes=JUDGED, seed=SEED + 1000)
        found = evaluator(training.act, training._rows.rows).summary()
    return Result(
        *(way.title, seed, digest(plan), plan.episodes, minutes),
        *(found.success, found.median, found.unit),
    )


def minutes_of(folder: Path) -> float | None:
    """How long a processor was busy with a training that was cut off, if its log says that."""
    try:
        return processor_minutes(folder)
    except KeyError:
        return None


Found = Mapping[tuple[str, int], Result]  # by title of the way, and seed


def kept(file: Path) -> dict[tuple[str, int], Result]:
    """The results of today's recipes."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    results = {(one.way, one.seed): one for one in (Result(**json.loads(line)) for line in lines)}
    today = {way.title: digest(way.plan(0)) for way in (*PAIRS, *PARTS)}
    return {key: one for key, one in results.items() if one.recipe == today.get(one.way)}


def row(way: Way, results: Sequence[Result]) -> str:
    """A row of the table: all seeds of a pair."""
    if len(results) < len(SEEDS):
        learns = "-"
    else:
        learns = "yes" if all(one.success >= ENOUGH for one in results) else "no"
    algorithm = ", ".join(filter(None, (way.algorithm, way.name)))
    return (
        f"| {way.task} | {algorithm} | {results[0].episodes} "
        f"| {', '.join(one.spent for one in results)} min "
        f"| {', '.join(f'{100 * one.success:.0f}' for one in results)} % "
        f"| {', '.join(one.distance for one in results)} {results[0].shown_unit} "
        f"| {learns} |"
    )


def page(found: Found) -> str:
    """The text of the page."""
    rows, missing = [], []
    for way in PAIRS:
        results = [found[way.title, seed] for seed in SEEDS if (way.title, seed) in found]
        if results:
            rows.append(row(way, results))
        if len(results) < len(SEEDS):
            missing.append(f"`{way.title}`")
    parts = [
        f"| {way.name} | {one.spent} min | {100 * one.success:.0f} % "
        f"| {one.distance} {one.shown_unit} |"
        for way in PARTS
        if (one := found.get((way.title, SEEDS[0])))
    ]
    text = f"Not all seeds are trained yet of {', '.join(missing)}." if missing else ""
    whole = TEXT.format(rows="\n".join(rows), missing=text)
    return whole + PARTS_TEXT.format(short=SHORT, parts="\n".join(parts)) if parts else whole


def main(arguments: Sequence[str] | None = None) -> int:
    """Trains what is missing, and writes the page."""
    parser = argparse.ArgumentParser(prog="./run evaluate training", description=__doc__)
    parser.add_argument("--only", default="", help="train what begins like this: 'reach sac'")
    parser.add_argument("--output", type=Path, default=RESULTS, help="the page that is written")
    options = parser.parse_args(arguments)
    file = options.output.with_suffix(".jsonl")
    found = kept(file)
    wanted = [(way, seed) for way in PAIRS for seed in SEEDS] + [(way, SEEDS[0]) for way in PARTS]
    for way, seed in wanted:
        if (way.title, seed) in found or not way.title.startswith(options.only):
            continue
        found[way.title, seed] = result = train(way, seed)
        print(result, flush=True)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(vars(result)) + "\n")
    options.output.write_text(page(found))
    print(f"{options.output} written.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
