# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate learn-on-robot`: the paper's second experiment, `trifinger learn` in real time.

A robot learns to reach from scratch: simulated, three seeds, and on emulated motor boards. Each
training takes 25 minutes of real time; two run at once. What was killed goes on the next time, and
what is finished is kept: `rm -r build/learn-on-robot` begins anew. Policies are judged by
`trifinger evaluate`, which knows nothing of the training. Writes docs/results/learn_on_robot.md.
"""

import argparse
import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from trifinger.commands.program import path as program

RUNS = Path("build/learn-on-robot")
PAGE = Path("docs/results/learn_on_robot.md")
MINUTES = 26.0  # wall time of a training
JUDGED = 50  # episodes


@dataclass(frozen=True)
class Job:
    """A training, and the median distance that it must reach."""

    robot: str
    words: tuple[str, ...]
    seed: int
    reach: float  # [m]

    @property
    def name(self) -> str:
        """Name of the folder, and of a simulated robot."""
        kind = "shared" if self.words else "joint"
        return f"{'boards' if self.is_emulated else 'sim'}-{kind}-{self.seed}"

    @property
    def is_emulated(self) -> bool:
        """Whether the robot is one of emulated motor boards."""
        return self.robot.endswith("emulated")


def trifinger(*words: object) -> list[str]:
    """A command line."""
    return [program(), *map(str, words)]


@contextlib.contextmanager
def running(*words: object, until: str) -> Iterator[None]:
    """Runs a command beside the block, once it has said `until`."""
    process = subprocess.Popen(trifinger(*words), stdout=subprocess.PIPE, text=True)
    try:
        while process.stdout is None or until not in process.stdout.readline():
            if process.poll() is not None:
                sys.exit(f"'trifinger {' '.join(map(str, words))}' has ended")
        yield
    finally:
        process.terminate()
        process.communicate()


def learn(job: Job) -> dict[str, float]:
    """Trains, or goes on, and judges; returns the figures."""
    folder = RUNS / job.name
    result = folder / "result.json"
    if not result.exists():
        with contextlib.ExitStack() as robots:
            if job.is_emulated:
                robots.enter_context(running("emulate", job.robot, until="are on"))
            named = () if job.is_emulated else ("--name", job.name)
            robots.enter_context(running("run", job.robot, *named, until="waits for a user"))
            name = job.robot.replace("_", "-") if job.is_emulated else job.name
            begun = (folder / "plan.json").exists()
            words = ("reach", *job.words, "--seed", job.seed, "-o", folder)
            subprocess.run(
                trifinger("learn", "--robot", name, *(("--resume", folder) if begun else words)),
                check=True,
            )
        words = (folder / "reach.policy", "--episodes", JUDGED, "--json")
        judged = subprocess.run(
            trifinger("evaluate", *words), stdout=subprocess.PIPE, check=True, text=True
        )
        tally = json.loads((folder / "tally.json").read_text())["tally"]
        found = json.loads(judged.stdout) | {"minutes": tally["seconds"] / 60}
        found |= {name: tally[name] for name in ("updates", "policies", "recoveries")}
        result.write_text(json.dumps(found, indent=2))
    figures: dict[str, float] = json.loads(result.read_text())
    print(
        f"{job.name}: {100 * figures['median']:.2f} cm in {figures['minutes']:.1f} min", flush=True
    )
    return figures


def page(jobs: Sequence[Job], results: Sequence[dict[str, float]]) -> str:
    """The text of the page."""
    rows = "\n".join(
        f"| {job.name} | {100 * job.reach:g} | {100 * one['median']:.2f} | "
        f"{100 * one['lower_quartile']:.2f} to {100 * one['upper_quartile']:.2f} | "
        f"{100 * one['largest']:.2f} | {100 * one['success']:.0f} | {one['minutes']:.1f} | "
        f"{one['updates']:.0f} | {one['recoveries']:.0f} |"
        for job, one in zip(jobs, results, strict=True)
    )
    return f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Learning on a robot that runs: results

Written by `./run evaluate learn-on-robot` on {time.strftime("%Y-%m-%d")}. `trifinger learn reach`
from scratch: 700 episodes of 2 s in real time at 1 kHz; back-end, actor, learner and recorder are
processes on two processors, two trainings at once. The robot of `sim` is a simulated
`trifinger_edu`, that of `boards` the same on emulated motor boards. What varies from seed to seed
are networks, starts, goals and noise. Judged in {JUDGED} new episodes by `trifinger evaluate`:
distances of all tips to their goals at the end. The paper: about 2 cm in 23 minutes "plus a few".

| training, seed | reach [cm] | median [cm] | quartiles [cm] | farthest [cm] | success [%] \
| wall time [min] | gradient steps | recoveries |
|---|---|---|---|---|---|---|---|---|
{rows}

The wall time has the start of all processes, and 20 episodes on the robot that judge the last
policy; it shall be at most {MINUTES:g} min.
"""


def main() -> int:
    """Runs the whole experiment."""
    parser = argparse.ArgumentParser(prog="./run evaluate learn-on-robot", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(1, parser.parse_args().seeds + 1)
    kinds = ((("--shared",), 0.003), ((), 0.012))
    jobs = [
        *(Job("trifinger_edu", words, seed, reach) for seed in seeds for words, reach in kinds),
        Job("trifinger_edu_emulated", *(kinds[0][0], 1, kinds[0][1])),
    ]
    RUNS.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(learn, jobs))
    PAGE.write_text(page(jobs, results))
    print(f"{PAGE} written.")
    holds = all(
        one["median"] <= job.reach and one["minutes"] <= MINUTES
        for job, one in zip(jobs, results, strict=True)
    )
    print("The table holds." if holds else "THE TABLE DOES NOT HOLD.")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
