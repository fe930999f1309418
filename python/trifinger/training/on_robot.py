# SPDX-License-Identifier: BSD-3-Clause
"""A training on a robot that runs: starts an actor, a learner and a recorder, and looks after them.

None of them waits for another one. The actor, in C++, moves the robot and tells what happens in the
robot's companion "experience". The learner gets that and sends policies, which the actor takes as
they come. The recorder writes the logs from which all goes on after any kill.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import fcntl
import json
import os
import queue
import re
import secrets
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing import AuthenticationError
from multiprocessing.connection import (
    Client,
    Connection,
    Listener,
    answer_challenge,
    deliver_challenge,
)
from pathlib import Path
from typing import Any, BinaryIO, Literal

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Environment, policy_metadata

# isort: split
import numpy as np
from torch.utils.tensorboard import SummaryWriter

from trifinger._trifinger import list_sessions, observe, recover
from trifinger.commands.program import path as program
from trifinger.errors import Error, InvalidArgument
from trifinger.evaluation import SEED, Summary, save_curve
from trifinger.training import checkpoint
from trifinger.training.experience import JUDGED, PART, Book, LiveExperience, digest_of, of_logs
from trifinger.training.learner import serve
from trifinger.training.plan import PLAN, TALLY, Plan
from trifinger.training.report import Tally, summary_of, write_report
from trifinger.whole_file import replace_file

STATE = "learner"  # the newest state of the learner
LEARN = "trifinger.commands.learn"
JOINING = "token"
LOOPBACK = "127.0.0.1:0"  # a free port of this machine alone
LOGS = "logs"
SPARE = "experience_*.npz"  # there, too: experience that is in no log, or may be
UNWRITTEN = 1000  # elements that a recorder may not have written when it was killed
APPROACH_EVERY = 50  # episodes
LAST_EPISODES = 20  # episodes of the last policy, without noise, of starts and goals that are new
POLL = 0.05  # s between two looks for experience
LOOK = 5.0  # s between two looks for processes that say nothing
SILENCE = 120.0  # s, and five episodes: a process that says nothing for so long is ended
STEADY = 60.0  # s after which a process has not failed at its begin
PAUSE = 0.2  # s before a process that has failed is started again; doubles with each failure
ROOM = 500e6  # bytes of the disk; with less the robot waits. The recorder needs 100 MB.
CURVE_EPISODES = 50  # of a point of the learning curve
MOST_CARES = 20  # in a row: a policy that is new may need one after each episode
MOST_FAILURES = 5  # of a process, one after the other, without an episode between them
KILLS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
WRONG = 2  # exit status of a program that cannot do what it is told
INTERRUPTED = 130  # exit status after a signal that ends in order
WARM, OUT_OF_REACH = 5, 6  # exit status of an actor between two episodes: docs/policies.md
REST_BELOW = 0.1  # thermal margin of the warmest motor
REST = 60.0  # s for which motors rest; those of a TriFinger then have an eighth of their heat left
CARE_TIME = 600.0  # s that a care may take
Verdict = Literal["success", "failure"]


class RobotTraining:
    """A training on a robot in a folder; if the folder has one of the same plan, it goes on."""

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        robot: str,
        say: Callable[[str], None] = lambda _: None,
        *,
        logs: Sequence[Path] = (),
        listen: str | None = None,
        judged: int = LAST_EPISODES,
        care: Sequence[str] | None = (),
        care_of_object: Sequence[str] = (),
        options: Sequence[str] = (),
        is_judged: bool = False,
    ) -> None:
        """`say` gets lines for people. `logs` have experience of the same task to begin with.

        The learner is started here, or `listen` is the HOST:PORT where one is waited for that joins
        from another machine, by join(). `care` is a command that makes the robot ready after a
        fault, and brings its object back; `care_of_object` are further words of the command if the
        robot had no fault. An object out of reach ends the training if there is no such command,
        and nobody looks for it if `care` is None. `options` are more of `trifinger run-policy` for
        the actor. If the training `is_judged`, tell() says what has succeeded, not the task. Raises
        InvalidArgument if the folder has a training by another plan, or if a log has no experience.
        """
        self.plan, self.folder, self.robot, self._say = plan, folder, robot, say
        self.policy_path = folder / f"{plan.name}.policy"
        """The file of the newest policy."""
        self._starts_learner = listen is None
        self._judged_episodes = 0 if is_judged else judged  # by the task
        if plan.recipe.algorithm == "ppo":
            raise InvalidArgument("ppo learns only from what its newest policy did")
        if plan.recipe.reset_states:
            raise InvalidArgument("a robot that runs cannot be put into reset_states")
        if ":" in plan.task:
            raise InvalidArgument(f"'{plan.task}' is a task in Python, which no robot learns alone")
        if is_judged and plan.recipe.relabelled > 0:
            raise InvalidArgument("relabelled makes rewards of its own: judged needs relabelled=0")
        self._care, self._care_of_object, self._is_judged = care, care_of_object, is_judged
        self._options = [*options, "--judge"] if is_judged else list(options)
        self.process = digest_of(policy_metadata(**plan.environment))
        self._live = LiveExperience(robot, self.process)
        self._configuration = observe(robot).documents()["configuration.yml"]
        self._has_room = True
        self.tally = Tally()
        self.curve: list[tuple[int, Summary]] = []
        self._newest: collections.deque[dict[str, Any]] = collections.deque(maxlen=CURVE_EPISODES)
        state = folder / STATE
        self._state = checkpoint.load(state.read_bytes()) if state.exists() else None
        self._logs = [path.resolve() for path in logs]
        self._others: list[int] = []  # sessions in which others moved the robot
        self._next_episode = 0
        self._book = Book(plan.recipe.buffer_size)
        (folder / LOGS).mkdir(parents=True, exist_ok=True)
        self._claim = _claimed(folder / JOINING)
        if (folder / PLAN).exists():
            self._restore()
        elif len(elements := self._live.take()):  # what others did before
            self._others = np.unique(elements["session"]).tolist()
        self._prior = self._read_logs()
        self._events: queue.Queue[tuple[str, Any]] = queue.Queue()
        self._is_over = threading.Event()  # no experience will come
        self._closed_book = threading.Event()
        self._closes = threading.Event()
        self._token = self._claim.read()
        try:
            self._listener = Listener(_address_of(listen or LOOPBACK))
        except (OSError, OverflowError) as error:
            raise InvalidArgument(f"nobody can join at {listen or LOOPBACK}: {error}") from None
        self.address = ":".join(map(str, self._listener.address))
        """Where a learner may join, as HOST:PORT."""
        self._save()
        replace_file(folder / PLAN, plan.to_json().encode())
        self._board = SummaryWriter(str(folder / "tensorboard"))
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._began: dict[str, float] = {}  # when each of them was started
        self._heard: dict[str, float] = {}  # when each of them said something
        self._looked = time.monotonic()
        self._failures: collections.Counter[str] = collections.Counter()
        self._ended_at: float | None = None  # when the actor ended
        self._spare_from: int | None = None  # number of the first element that may be in no log
        self._waits = False  # the actor, for a care or a rest
        self._is_learned = False  # and the last policy is judged
        self._cares_in_a_row = 0
        self._cared_at = 0  # number of episodes that had ended at the last care
        self._judged: list[dict[str, Any]] = []
        self._is_done = False

    def run(self) -> Tally:
        """Learns until the robot has done all episodes of the plan, and judges the last policy.

        Ctrl-C raises KeyboardInterrupt; another RobotTraining in this folder then goes on. Raises
        Error if the robot cannot be mended. The robot is then at rest, as after every end.
        """
        begin = time.monotonic() - self.tally.seconds
        _in_thread(self._accept)
        _in_thread(self._watch)
        try:
            self._start("recorder")
            if self._starts_learner:
                self._start("learner")
            else:
                self._say(f"waits for a learner at {self.address}; {self.folder / JOINING}")
            while not self._is_done:
                self._look()
                with contextlib.suppress(queue.Empty):
                    kind, what = self._events.get(timeout=LOOK)
                    self._heard[kind] = time.monotonic()
                    self._handle(kind, what)
                    self.tally.seconds = time.monotonic() - begin
            if self._judged:
                summary = summary_of(self._judged, self._unit)
                what = f"the last policy without noise, {summary.episodes} new episodes"
                self._say(f"{what}: {summary.in_short}")
        finally:
            self._close()
            self._write_spare()
            self._save()
        return self.tally

    def report(self) -> Path:
        """Writes report.md with its figures, and returns its path."""
        title = f"{self.plan.name} on {self.robot}"
        judged = summary_of(self._judged, self._unit) if self._judged else None
        elements, _ = self._book.since(self._prior)
        return write_report(self.folder, title, self.plan, self.tally, judged, self._own(elements))

    def tell(self, verdict: Verdict) -> None:
        """Ends the running episode, with the reward 1 for a success and 0 for a failure.

        Only for a training that others judge.
        """
        actor = self._processes.get("actor")
        if actor is not None and actor.stdin is not None:
            with contextlib.suppress(OSError, ValueError):  # it has just ended
                actor.stdin.write(f"{verdict}\n")
                actor.stdin.flush()

    # ---- what happens ----

    def _handle(self, kind: str, what: Any) -> None:
        match kind, what:
            case "learner", {"kind": "state"}:
                self._state = what["state"]
                self._write(self.folder / STATE, checkpoint.dump(self._state))
                self._save()
            case "learner", {"kind": "policy"}:
                self._take(what)
            case "learner", {"kind": "done"}:
                self._is_learned = True
                self._start("actor")
            case "actor", _:
                self._failures["actor"] = 0
                count = self._judged.append if self._is_learned else self._count
                count(json.loads(what))
            case "ended", (name, status):
                self._take_leave(name, status)
            case "gone", _ if not self._starts_learner:
                self._say("the learner has gone; another one may join")
            case "failed", _:
                raise what

    def _take(self, message: dict[str, Any]) -> None:
        self._write(self.policy_path, message["policy"].tobytes())
        actions, updates = message["transitions"], message["updates"]
        self.tally.policies, self.tally.updates = message["number"] + 1, updates
        shown = {
            "learner/updates_per_action": updates / max(actions, 1),
            "exploration/noise": message["noise"],
        }
        for name, value in (shown | message["losses"]).items():
            self._board.add_scalar(name, value, actions)
        if not self._is_over.is_set():
            self._start("actor")

    def _count(self, report: dict[str, Any]) -> None:
        tally = self.tally
        tally.episodes += 1
        tally.actions += report["actions"]
        tally.successes += report["is_success"]
        if self._ended_at is not None:
            tally.time_lost += time.monotonic() - self._ended_at
            self._ended_at = None
        self._newest.append(report)
        for name, value in {
            "episode/reward": report["total_reward"],
            "episode/distance": max(one for one in report["distance"] if one is not None),
            "robot/faults": sum(tally.faults.values()),
            "robot/recoveries": tally.recoveries,
            "robot/rests": tally.rests,
            "robot/time_lost": tally.time_lost,
        }.items():
            self._board.add_scalar(name, value, tally.actions)
        if tally.episodes % CURVE_EPISODES == 0:
            self._add_point()
        self._save()

    def _add_point(self) -> None:
        tally, summary = self.tally, summary_of(self._newest, self._unit)
        self.curve.append((tally.episodes, summary))
        faults = sum(tally.faults.values())
        self._say(
            f"episode {tally.episodes} of {self.plan.episodes}: {summary.in_short}, "
            f"policy {tally.policies - 1}, {tally.updates} gradient steps, "
            f"{faults} fault{'s' * (faults != 1)}"
        )
        save_curve({self.plan.name: self.curve}, self.folder / "curve.png")

    # ---- processes ----

    # Looks after processes that hang or were stopped, and after the disk.
    def _look(self) -> None:
        now, before = time.monotonic(), self._looked
        self._looked = now
        if now - before > 4 * LOOK:  # this process itself was stopped
            self._heard = dict.fromkeys(self._heard, now)
        for name, process in self._processes.items():
            if self._is_silent(name):
                with contextlib.suppress(ProcessLookupError):  # it is known to be dead only later
                    os.killpg(process.pid, signal.SIGKILL)
        if "recorder" in self._processes and now - self._began["recorder"] > LOOK:
            self._write_spare()  # it records again
        had_room, self._has_room = self._has_room, shutil.disk_usage(self.folder).free > ROOM
        if had_room and not self._has_room:
            self._say(f"the disk of {self.folder} is nearly full: the robot waits, for room")
            if actor := self._processes.get("actor"):
                actor.terminate()
        elif self._has_room and not had_room:
            self._start("recorder")
            if self.policy_path.exists():
                self._start("actor")

    def _is_silent(self, name: str) -> bool:
        limit = CARE_TIME if name == "care" else SILENCE + 5 * self.plan.options.duration
        return name != "recorder" and time.monotonic() - self._heard[name] > limit

    # Starts a process, unless it is there, must wait, or has nothing left to do.
    def _start(self, name: str) -> None:
        if name in self._processes or (name == "actor" and self._waits):
            return
        match name:
            case "recorder":
                self._launch(name, program(), "record", self.robot, "-o", self.folder / LOGS)
            case "learner":
                where = ("--join", self.address, "--token", self.folder / JOINING)
                how = ("--algorithm", self.plan.recipe.algorithm)  # who made the plan has said it
                self._launch(name, sys.executable, "-P", "-m", LEARN, *where, *how)
            case "actor" if self._is_learned:
                # The last policy, without noise, in episodes that no training has seen.
                if left := self._judged_episodes - len(self._judged):
                    self._start_actor(SEED, len(self._judged), left)
                else:
                    self._is_done = True
            case "actor" if self._next_episode >= self.plan.episodes:
                self._is_over.set()
            case "actor" if self._has_room:
                left = self.plan.episodes - self._next_episode
                more = ("--explore", "--precision", "single", "--approach-every", APPROACH_EVERY)
                self._start_actor(self.plan.seed, self._next_episode, left, *more, *self._options)

    def _start_actor(self, seed: int, first: int, count: int, *more: object) -> None:
        words: list[object] = ["run-policy", self.policy_path, "--robot", self.robot, "--json"]
        words += ["--seed", seed, "--first", first, "--episodes", count, *more]
        words += ["--rest-below", REST_BELOW]
        if self._care is not None:
            words.append("--end-out-of-reach")
        self._launch("actor", program(), *words)

    def _launch(self, name: str, *words: object) -> None:
        with (self.folder / f"{name}.txt").open("a") as log:
            process = subprocess.Popen(
                # Nobody else would end it if this process was killed.
                ["setpriv", "--pdeathsig", "TERM", *map(str, words)],
                stdin=subprocess.PIPE if name == "actor" else subprocess.DEVNULL,  # for verdicts
                stdout=subprocess.PIPE if name == "actor" else log,
                stderr=log,
                text=True,
                start_new_session=True,  # Ctrl-C is for this process, which ends the others
            )
        self._processes[name] = process
        self._began[name] = self._heard[name] = time.monotonic()
        _in_thread(self._follow, name, process)

    def _follow(self, name: str, process: subprocess.Popen[str]) -> None:
        with contextlib.suppress(OSError), process:  # a verdict may be left that nobody reads
            for line in process.stdout or ():
                self._events.put((name, line))
        self._events.put(("ended", (name, process.wait())))

    # A process has ended: starts it again, or what follows it.
    def _take_leave(self, name: str, status: int) -> None:
        del self._processes[name]
        words = self._last_words(name)
        if name == "recorder" and self._spare_from is None:
            self._spare_from = max(0, self._book.end - UNWRITTEN)
        if name == "actor" and status != 0:
            self._ended_at = self._ended_at or time.monotonic()
        match name:
            case "learner" if status == 0:
                pass  # all is learned
            case "actor" | "recorder" if not self._has_room:
                pass  # the robot waits
            case "actor" if status == 0 and self._is_learned:
                self._start("actor")
            case "actor" if status == 0:
                self._is_over.set()
            case "actor" if status == WARM:
                self.tally.rests += 1
                self._say(f"{words}; they rest for {REST:g} s")
                self._waits = True
                self._launch("rest", "sleep", REST)
            case "actor" if status == OUT_OF_REACH:
                self._take_care(words, self._care_of_object)
            case "care" if status == 0:
                self.tally.cares += 1
                self._failures["care"] = 0
                self._go_on()
            case "rest":
                self._go_on()
            case _:
                self._take_failure(name, status, words)
        self._save()

    def _take_failure(self, name: str, status: int, words: str) -> None:
        is_silent = self._is_silent(name)
        if time.monotonic() - self._began[name] > STEADY and not is_silent:
            self._failures[name] = 0
        # Whoever kills a process knows what it does, and it may begin again as often as it likes.
        self._failures[name] += is_silent or (-status not in KILLS and status != INTERRUPTED)
        # Later it is no mistake of whoever has started this: a tracker may have lost the object.
        if status == WRONG and (
            name == "learner" or (name == "actor" and not (self._newest or self._judged))
        ):
            raise InvalidArgument(words)
        fault = self._mend() if name in ("actor", "care") else ""
        if self._failures[name] > MOST_FAILURES:
            who = "the robot stops" if fault else f"the {name} ends"
            raise Error(f"{who} again and again: {fault or words}")
        self.tally.restarts[name] = self.tally.restarts.get(name, 0) + 1
        words = f"the {name} has ended ({status}): {words}"
        if self._failures[name]:
            time.sleep(PAUSE * 2 ** self._failures[name])
        if name == "care" or (fault and self._care):
            self._take_care(words)
        else:
            self._say(f"{words}; it is started again")
            self._start(name)

    # Lets the care make the robot ready for the actor, because of `words`.
    def _take_care(self, words: str, more: Sequence[str] = ()) -> None:
        if not self._care:
            raise Error(f"{words}; --care names a command that brings it back")
        # An episode shows that it did not help.
        episodes = self.tally.episodes + len(self._judged)
        self._cares_in_a_row = self._cares_in_a_row * (episodes <= self._cared_at + 1) + 1
        self._cared_at = episodes
        if self._cares_in_a_row > MOST_CARES:
            raise Error(f"it needs care again and again: {words}")
        self._say(f"{words}; {' '.join([*self._care, *more])}")
        self._waits = True
        self._launch("care", *self._care, *more)

    # A care or a rest is over.
    def _go_on(self) -> None:
        self._waits = False
        self._start("actor")

    # Brings the robot back after a fault, and returns its reason, or "" if there was none; raises
    # Error if its back-end is gone.
    def _mend(self) -> str:
        info = next((one for one in list_sessions() if one.name == self.robot), None)
        if info is None or not info.backend_is_alive:
            raise Error(f"the back-end of '{self.robot}' is gone")
        if info.fault is None or not info.fault.needs_recovery:
            return ""
        reason = re.sub(r" (at|before|for) step -?\d+|(;|, after ).*", "", info.fault_text)
        self.tally.faults[reason] = self.tally.faults.get(reason, 0) + 1
        recover(self.robot, 60.0)
        self.tally.recoveries += 1
        return reason

    def _last_words(self, name: str) -> str:
        lines = (self.folder / f"{name}.txt").read_text(errors="replace").split("\n")
        return next((line for line in reversed(lines) if line.strip()), "it said nothing")[-300:]

    def _restore(self) -> None:
        if not (self.folder / TALLY).exists():
            raise InvalidArgument(f"{self.folder} has a training in simulation")
        if Plan.from_json((self.folder / PLAN).read_text()) != self.plan:
            raise InvalidArgument(f"{self.folder} has a training by another plan")
        known = json.loads((self.folder / TALLY).read_text())
        if known["is_judged"] != self._is_judged:
            who = "--judge" if known["is_judged"] else "its task, without --judge"
            raise InvalidArgument(f"{self.folder} has a training that is judged by {who}")
        self.tally = Tally(**known["tally"])
        self.curve = [(episode, Summary(**one)) for episode, one in known["curve"]]
        self._others = known["others"]
        self._logs = [Path(log) for log in known["logs"]] + self._logs

    # Reads the logs of others and the own ones; returns how many elements are of others.
    def _read_logs(self) -> int:
        with contextlib.closing(Environment(**self.plan.environment)) as environment:
            self._unit = environment.goal_unit.partition(",")[0]
            for path in self._logs:
                read = of_logs(path, self.process, self._say, environment._core.check_robot)
                parts = [part for one in read if len(part := self._judged_alike(one))]
                if not parts:
                    raise InvalidArgument(
                        f"{path} has no experience of this task with these options"
                    )
                for part in parts:
                    self._book.add(part)
        prior = self._book.keep()
        for part in of_logs(self.folder / LOGS, self.process, self._say):
            self._add(part)
        for path in (self.folder / LOGS).glob(SPARE):
            self._add(checkpoint.load(path.read_bytes()))
        return prior

    # Writes what may be in no log: of sessions that have ended while there was no recorder.
    def _write_spare(self) -> None:
        if self._spare_from is not None:
            elements, end = self._book.since(self._spare_from)
            self._spare_from = None
            if len(elements) and (elements["session"] != elements["session"][-1]).any():
                path = self.folder / LOGS / SPARE.replace("*", str(end))
                self._write(path, checkpoint.dump(elements))

    # The elements of this training.
    def _own(self, elements: Array) -> Array:
        if not len(elements):
            return elements
        is_foreign = np.isin(elements["session"], self._others)
        return self._judged_alike(elements[(elements["seed"] == self.plan.seed) & ~is_foreign])

    # The elements whose rewards are of the same kind as those of this training.
    def _judged_alike(self, elements: Array) -> Array:
        alike: Array = elements[(elements["flags"] & JUDGED != 0) == self._is_judged]
        return alike

    # Takes those of these elements that are of this training and new.
    def _add(self, elements: Array) -> None:
        if len(new := self._book.add(self._own(elements))):
            self._next_episode = max(self._next_episode, int(new["episode"].max()) + 1)
            # A kill may have come before their number was saved.
            self.tally.policies = max(self.tally.policies, int(new["policy"].max()) + 1)

    def _save(self) -> None:
        known = {
            "tally": dataclasses.asdict(self.tally),
            "rows": self.tally.rows(self.plan),
            "curve": [(episode, dataclasses.asdict(one)) for episode, one in self.curve],
            "others": self._others,
            "is_judged": self._is_judged,
            "logs": list(map(str, self._logs)),
        }
        self._write(self.folder / TALLY, json.dumps(known, indent=2).encode())

    # Replaces a file. While the disk is full the one before stays: the robot waits, and the newest
    # state of the learner is in its memory.
    def _write(self, path: Path, content: bytes) -> None:
        try:
            replace_file(path, content)
        except OSError:
            if self._has_room:
                raise

    # The recorder ends last: it records how the others end.
    def _close(self) -> None:
        self._closes.set()
        others = [process for name, process in self._processes.items() if name != "recorder"]
        for processes in (others, self._processes.values()):
            for process in processes:
                process.send_signal(signal.SIGCONT)
                process.terminate()
            for process in processes:
                try:
                    process.wait(30.0)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
        self._listener.close()
        self._board.close()
        self._claim.close()

    # ---- threads ----

    # Reads the robot's experience as it comes.
    def _watch(self) -> None:
        is_over = False
        try:
            while not (is_over or self._closes.is_set()):
                # Asked first: what came before it was over is still read.
                is_over = self._is_over.wait(POLL)
                self._add(self._live.take())
                if self._live.missed:
                    self._say(
                        f"{self._live.missed} actions are only in the logs: --resume has them"
                    )
                    self._live.missed = 0
            if is_over:
                self._closed_book.set()
        except Exception as error:
            self._events.put(("failed", error))

    def _accept(self) -> None:
        while not self._closes.is_set():
            with contextlib.suppress(OSError):  # the end, or nobody any more
                _in_thread(self._teach, self._listener.accept())

    # Gives a learner what it asks for; it may be slow, stop or vanish.
    def _teach(self, connection: Connection) -> None:
        errors = (EOFError, OSError, AuthenticationError, ValueError, KeyError)
        with contextlib.suppress(*errors), connection:
            deliver_challenge(connection, self._token)
            answer_challenge(connection, self._token)
            number = 0
            first = {
                "plan": self.plan.to_json(),
                "configuration": self._configuration,
                "prior": self._prior,
                "published": self.tally.policies - 1,
                "state": self._state,
            }
            connection.send_bytes(checkpoint.dump(first))
            while True:
                message = checkpoint.load(connection.recv_bytes())
                self._heard["learner"] = time.monotonic()
                if message["kind"] != "more":
                    self._events.put(("learner", message))
                    continue
                is_closed = self._closed_book.is_set()
                timeout = POLL if message["waits"] else 0.0
                elements, number = self._book.since(number, timeout, PART)
                answer = {"experience": elements, "is_whole": is_closed and len(elements) < PART}
                connection.send_bytes(checkpoint.dump(answer))
        self._events.put(("gone", None))


def join(address: str, token: Path, algorithm: str | None = None) -> None:
    """Learns for a RobotTraining, on this machine or another one, until there is nothing to learn.

    `address` is its HOST:PORT, `token` a copy of the file in its folder. `algorithm` must be said
    if it is MODULE:CLASS. Raises InvalidArgument for anything else, and Error if nobody is there or
    the token is another one.
    """
    try:
        connection = Client(_address_of(address), authkey=token.read_bytes())
    except (AuthenticationError, EOFError):
        raise Error(f"{address} has another token than {token}") from None
    except (OSError, OverflowError) as error:
        raise Error(f"no training waits at {address}: {error}") from None
    with connection:
        serve(connection, algorithm)


def _address_of(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise InvalidArgument(f"'{text}' is no HOST:PORT")
    return host, int(port)


# The file with the token, which is this training's alone while it is open.
def _claimed(path: Path) -> BinaryIO:
    path.touch(0o600)
    path.chmod(0o600)
    file = path.open("rb+")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise InvalidArgument(f"another training runs in {path.parent}") from None
    if not file.read():
        file.write(secrets.token_hex(32).encode())
    file.seek(0)
    return file


def _in_thread(work: Callable[..., None], *arguments: object) -> None:
    threading.Thread(target=work, args=arguments, daemon=True).start()
