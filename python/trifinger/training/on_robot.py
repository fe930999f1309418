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
import json
import queue
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, answer_challenge, deliver_challenge
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Environment, policy_metadata

# isort: split
import numpy as np
from torch.utils.tensorboard import SummaryWriter

from trifinger._trifinger import list_sessions, observe, recover
from trifinger.commands.program import path as program
from trifinger.errors import Error, InvalidArgument
from trifinger.evaluation import SEED, SHOWN_EPISODES, Evaluation, Summary, save_curve, save_paths
from trifinger.training import checkpoint
from trifinger.training.experience import (
    SUCCESS,
    TERMINATED,
    TRUNCATED,
    Book,
    LiveExperience,
    digest_of,
    of_logs,
)
from trifinger.training.learner import serve
from trifinger.training.plan import PLAN, TALLY, Plan
from trifinger.whole_file import replace_file

STATE = "learner"  # the newest state of the learner
LEARN = "trifinger.commands.learn"
JOINING = "token"
LOOPBACK = ("127.0.0.1", 0)  # a free port of this machine alone
LOGS = "logs"
APPROACH_EVERY = 50  # episodes
JUDGED = 20  # episodes of the last policy, without noise, of starts and goals that are new
POLL = 0.05  # s between two looks for experience
LOOK = 5.0  # s between two looks for processes that say nothing
SILENCE = 120.0  # s, and five episodes: a process that says nothing for so long is ended
STEADY = 60.0  # s after which a process has not failed at its begin
PAUSE = 0.2  # s before a process that has failed is started again; doubles with each failure
ROOM = 500e6  # bytes of the disk; with less the robot waits. The recorder needs 100 MB.
CURVE_EPISODES = 50  # of a point of the learning curve
MOST_FAILURES = 5  # of a process, one after the other, without an episode between them
KILLS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
WRONG = 2  # exit status of a program that cannot do what it is told


@dataclasses.dataclass
class Tally:
    """What has happened, of this run and those that it resumed."""

    episodes: int = 0
    actions: int = 0
    successes: int = 0
    faults: dict[str, int] = dataclasses.field(default_factory=dict)
    """How often the robot stopped, by reason."""
    recoveries: int = 0
    time_lost: float = 0.0
    """From each end of the actor to the next episode that ended [s]."""
    restarts: dict[str, int] = dataclasses.field(default_factory=dict)
    """How often a process was started again, by name."""
    policies: int = 0
    updates: int = 0
    seconds: float = 0.0
    """How long it took."""


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
        address: tuple[str, int] = LOOPBACK,
        starts_learner: bool = True,
        judged: int = JUDGED,
    ) -> None:
        """`say` gets lines for people. `logs` have experience of the same task to begin with.

        The learner is started here, or joins from another machine: join(). `address` is where it is
        waited for. Raises InvalidArgument if the folder has a training by another plan, or if a log
        has no experience.
        """
        self.plan, self.folder, self._robot, self._say = plan, folder, robot, say
        self._starts_learner, self._judged_episodes = starts_learner, judged
        if plan.recipe.algorithm == "ppo":
            raise InvalidArgument("ppo learns only from what its newest policy did")
        if ":" in plan.task:
            raise InvalidArgument(f"'{plan.task}' is a task in Python, which no robot learns alone")
        if (folder / PLAN).exists():
            if not (folder / TALLY).exists():
                raise InvalidArgument(f"{folder} has a training in simulation")
            if Plan.from_json((folder / PLAN).read_text()) != plan:
                raise InvalidArgument(f"{folder} has a training by another plan")
        self._process = digest_of(policy_metadata(**plan.environment))
        self._live = LiveExperience(robot, self._process)
        self._configuration = observe(robot).documents()["configuration.yml"]
        with contextlib.closing(Environment(**plan.environment)) as environment:
            self._unit = environment.goal_unit.partition(",")[0]
        self.tally = Tally()
        self.curve: list[tuple[int, Summary]] = []
        self._newest: collections.deque[dict[str, Any]] = collections.deque(maxlen=CURVE_EPISODES)
        self._state = _state_of(folder / STATE)
        self._logs = [path.resolve() for path in logs]
        self._others: list[int] = []  # sessions in which others moved the robot
        self._next_episode = 0
        self._book = Book(plan.recipe.buffer_size)
        self._restore()
        (folder / LOGS).mkdir(parents=True, exist_ok=True)
        self._prior = self._read_logs()
        self._events: queue.Queue[tuple[str, Any]] = queue.Queue()
        self._is_over = threading.Event()  # no experience will come
        self._closed_book = threading.Event()
        self._closes = threading.Event()
        self._token = _token_in(folder / JOINING)
        try:
            self._listener = socket.create_server(address)
        except (OSError, OverflowError) as error:
            host, port = address
            raise InvalidArgument(f"nobody can join at {host}:{port}: {error}") from None
        self.address = ":".join(map(str, self._listener.getsockname()[:2]))
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
        self._has_room = True
        self._judged: list[dict[str, Any]] = []
        self._is_done = False

    @property
    def policy_path(self) -> Path:
        """The file of the newest policy."""
        return self.folder / f"{self.plan.name}.policy"

    def run(self) -> Tally:
        """Learns until the robot has done all episodes of the plan, and judges the last policy.

        Ctrl-C raises KeyboardInterrupt; another RobotTraining in this folder then goes on. Raises
        Error if the robot cannot be mended. The robot is then at rest, as after every end.
        """
        begin = time.monotonic() - self.tally.seconds
        threads = [
            threading.Thread(target=work, daemon=True) for work in (self._accept, self._watch)
        ]
        for thread in threads:
            thread.start()
        try:
            self._start_recorder()
            if self._starts_learner:
                self._start_learner()
            else:
                self._say(f"waits for a learner at {self.address}; {self.folder / JOINING}")
            while not self._is_done:
                self._look()
                with contextlib.suppress(queue.Empty):
                    kind, what = self._events.get(timeout=LOOK)
                    self._heard[kind] = time.monotonic()
                    self._handle(kind, what)
                    self.tally.seconds = time.monotonic() - begin
        finally:
            self._close()
            self.tally.seconds = time.monotonic() - begin
            self._save()
        return self.tally

    def report(self) -> Path:
        """Writes report.md with its figures, and returns its path."""
        figures = []
        if self.curve:
            save_curve({self.plan.name: self.curve}, self.folder / "curve.png")
            figures.append("curve.png")
        paths = self._paths()
        if self.plan.task in ("reach", "finger_reach", "push") and paths:
            save_paths(paths, self.folder / "tips.png")
            figures.append("tips.png")
        tally, plan = self.tally, self.plan
        rows = [
            ("task, algorithm", f"{plan.task}, {plan.recipe.algorithm}"),
            ("episodes, actions", f"{tally.episodes}, {tally.actions}"),
            ("time", f"{tally.seconds / 60:.1f} min"),
            ("time lost by ends of the actor", f"{tally.time_lost:.1f} s"),
            ("policies, gradient steps", f"{tally.policies}, {tally.updates}"),
            ("recoveries", str(tally.recoveries)),
            *((f"fault: {reason}", str(count)) for reason, count in tally.faults.items()),
            *((f"{name} started again", str(count)) for name, count in tally.restarts.items()),
        ]
        if self._judged:
            judged = summary_of(self._judged, self._unit)
            words = judged.in_words(judged.lower_quartile, judged.median, judged.upper_quartile)
            rows.append(
                (
                    f"last policy without noise, {judged.episodes} new episodes on the robot",
                    f"quartiles {words}, success {100 * judged.success:.0f} %",
                )
            )
        lines = [f"# {plan.name} on {self._robot}", "", "| | |", "|---|---|"]
        lines += [f"| {name} | {value} |" for name, value in rows]
        lines += ["", *(f"![]({name})" for name in figures), ""]
        replace_file(self.folder / "report.md", "\n".join(lines).encode())
        return self.folder / "report.md"

    # ---- what happens ----

    def _handle(self, kind: str, what: Any) -> None:
        match kind:
            case "learner":
                self._hear(what)
            case "actor":
                self._count(json.loads(what))
            case "judge":
                self._judged.append(json.loads(what))
            case "ended":
                self._take_leave(*what)
            case "gone":
                if not self._starts_learner:
                    self._say("the learner has gone; another one may join")
            case "failed":
                raise what

    def _hear(self, message: dict[str, Any]) -> None:
        match message["kind"]:
            case "state":
                self._state = message["state"]
                replace_file(self.folder / STATE, checkpoint.dump(self._state))
                self._save()
            case "policy":
                self._take(message)
            case "done":
                self._judge()

    def _take(self, message: dict[str, Any]) -> None:
        replace_file(self.policy_path, message["policy"].tobytes())
        self.tally.policies, self.tally.updates = message["number"] + 1, message["updates"]
        board, actions = self._board, message["transitions"]
        board.add_scalar("learner/updates_per_action", self._rate(message), actions)
        board.add_scalar("exploration/noise", message["noise"], actions)
        for name, loss in message["losses"].items():
            board.add_scalar(name, loss, actions)
        if "actor" not in self._processes and not self._is_over.is_set():
            self._start_actor()

    @staticmethod
    def _rate(message: dict[str, Any]) -> float:
        return float(message["updates"] / max(message["transitions"], 1))

    def _count(self, report: dict[str, Any]) -> None:
        tally = self.tally
        tally.episodes += 1
        tally.actions += report["actions"]
        tally.successes += report["is_success"]
        self._failures["actor"] = 0
        if self._ended_at is not None:
            tally.time_lost += time.monotonic() - self._ended_at
            self._ended_at = None
        self._newest.append(report)
        worst = max(one for one in report["distance"] if one is not None)
        for name, value in (("reward", report["total_reward"]), ("distance", worst)):
            self._board.add_scalar(f"episode/{name}", value, tally.actions)
        if tally.episodes % CURVE_EPISODES == 0:
            self._add_point()

    def _add_point(self) -> None:
        summary = summary_of(self._newest, self._unit)
        self.curve.append((self.tally.episodes, summary))
        tally = self.tally
        faults = sum(tally.faults.values())
        median = summary.in_words(summary.median)
        self._say(
            f"episode {tally.episodes} of {self.plan.episodes}: {median}, "
            f"success {100 * summary.success:.0f} %, policy {tally.policies - 1}, "
            f"{tally.updates} gradient steps, {faults} fault{'s' * (faults != 1)}"
        )
        save_curve({self.plan.name: self.curve}, self.folder / "curve.png")
        self._save()

    # ---- processes ----

    # Looks after processes that hang or were stopped, and after the disk.
    def _look(self) -> None:
        now, before = time.monotonic(), self._looked
        self._looked = now
        if now - before > 4 * LOOK:  # this process itself was stopped
            self._heard = dict.fromkeys(self._heard, now)
        limit = SILENCE + 5 * self.plan.options.duration
        for name in ("actor", "learner", "judge"):
            process = self._processes.get(name)
            if process and now - self._heard[name] > limit:
                process.kill()
        had_room, self._has_room = self._has_room, shutil.disk_usage(self.folder).free > ROOM
        if had_room and not self._has_room:
            self._say(f"the disk of {self.folder} is nearly full: the robot waits, for room")
            if actor := self._processes.get("actor"):
                actor.terminate()
        elif self._has_room and not had_room and self.policy_path.exists():
            self._start_actor()

    def _start(self, name: str, *words: object, command: Sequence[str] = (program(),)) -> None:
        with (self.folder / f"{name}.txt").open("w") as log:
            process = subprocess.Popen(
                # Nobody else would end it if this process was killed.
                ["setpriv", "--pdeathsig", "TERM", *command, *map(str, words)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if name in ("actor", "judge") else log,
                stderr=log,
                text=True,
                start_new_session=True,  # Ctrl-C is for this process, which ends the others
            )
        self._processes[name] = process
        self._began[name] = self._heard[name] = time.monotonic()
        threading.Thread(target=self._follow, args=(name, process), daemon=True).start()

    def _follow(self, name: str, process: subprocess.Popen[str]) -> None:
        with process:
            for line in process.stdout or ():
                self._events.put((name, line))
        self._events.put(("ended", (name, process, process.returncode)))

    def _start_recorder(self) -> None:
        self._start("recorder", "record", self._robot, "-o", self.folder / LOGS)

    def _start_learner(self) -> None:
        words = ("--join", self.address, "--token", self.folder / JOINING)
        self._start("learner", *words, command=(sys.executable, "-P", "-m", LEARN))

    def _start_actor(self) -> None:
        left = self.plan.episodes - self._next_episode
        if left <= 0:
            self._is_over.set()
        elif self._has_room and "actor" not in self._processes:
            words = ("--explore", "--precision", "single", "--approach-every", APPROACH_EVERY)
            self._start_policy("actor", self.plan.seed, self._next_episode, left, *words)

    # Lets the last policy act without noise, in episodes that no training has seen.
    def _judge(self) -> None:
        first = len(self._judged)
        if first < self._judged_episodes:
            self._start_policy("judge", SEED, first, self._judged_episodes - first)
            return
        self._is_done = True
        if self._judged:
            summary = summary_of(self._judged, self._unit)
            self._say(
                f"the last policy without noise, {summary.episodes} new episodes: "
                f"{summary.in_words(summary.median)}, success {100 * summary.success:.0f} %"
            )

    def _start_policy(self, name: str, seed: int, first: int, count: int, *more: object) -> None:
        words = ("run-policy", self.policy_path, "--robot", self._robot, "--json", *more)
        self._start(name, *words, "--seed", seed, "--first", first, "--episodes", count)

    # A process has ended: starts it again, or what follows it.
    def _take_leave(self, name: str, process: subprocess.Popen[str], status: int) -> None:
        if self._processes.get(name) is not process or self._closes.is_set():
            return
        del self._processes[name]
        if (name == "learner" and status == 0) or (name == "actor" and not self._has_room):
            return  # all is learned; the robot waits
        if name == "actor" and status == 0:
            self._is_over.set()
            return
        if name == "judge" and status == 0:
            self._judge()
            return
        words = self._last_words(name)
        if time.monotonic() - self._began[name] > STEADY:
            self._failures[name] = 0
        # Whoever kills a process knows what it does, and it may begin again as often as it likes.
        self._failures[name] += -status not in KILLS
        if name in ("actor", "judge"):
            if status == WRONG:
                raise InvalidArgument(words)
            self._ended_at = self._ended_at or time.monotonic()
            self._mend()
        if self._failures[name] > MOST_FAILURES:
            raise Error(f"the {name} ends again and again: {words}")
        restarts = self.tally.restarts
        restarts[name] = restarts.get(name, 0) + 1
        self._say(f"the {name} has ended ({status}): {words}; it is started again")
        if self._failures[name]:
            time.sleep(PAUSE * 2 ** self._failures[name])
        starts = {
            "actor": self._start_actor,
            "learner": self._start_learner,
            "recorder": self._start_recorder,
            "judge": self._judge,
        }
        starts[name]()

    # Brings the robot back after a fault; raises Error if its back-end is gone.
    def _mend(self) -> None:
        info = next((one for one in list_sessions() if one.name == self._robot), None)
        if info is None or not info.backend_is_alive:
            raise Error(f"the back-end of '{self._robot}' is gone")
        if info.fault is not None and info.fault.needs_recovery:
            reason = re.sub(r" (at|before) step -?\d+", "", info.fault_text)
            self.tally.faults[reason] = self.tally.faults.get(reason, 0) + 1
            if max(self._failures["actor"], self._failures["judge"]) > MOST_FAILURES:
                raise Error(f"the robot stops again and again: {reason}")
            recover(self._robot, 60.0)
            self.tally.recoveries += 1

    def _last_words(self, name: str) -> str:
        lines = (self.folder / f"{name}.txt").read_text(errors="replace").split("\n")
        return next((line for line in reversed(lines) if line.strip()), "it said nothing")

    # Paths to the goals, as in the paper's figure: at the beginning, later and at the end.
    def _paths(self) -> dict[str, Array]:
        elements = self._own(self._book.since(0)[0])
        if not len(elements):
            return {}
        last = int(elements["episode"].max())
        begins = {"begin": 0, "after 200 episodes": 200, "end": last + 1 - SHOWN_EPISODES}
        paths: dict[str, Array] = {}
        for name, first in begins.items():
            of_part = [
                (one["achieved"] - one["desired"])
                for number in range(max(first, 0), first + SHOWN_EPISODES)
                if len(one := elements[elements["episode"] == number]) > 1
            ]
            if of_part:
                path = np.full((len(of_part), max(map(len, of_part)), of_part[0].shape[1]), np.nan)
                for row, one in zip(path, of_part, strict=True):
                    row[: len(one)] = one
                paths[name] = path
        return paths

    def _restore(self) -> None:
        path = self.folder / TALLY
        if not path.exists():
            if len(elements := self._live.take()):  # what others did before
                self._others = np.unique(elements["session"]).tolist()
            return
        known = json.loads(path.read_text())
        self.tally = Tally(**known["tally"])
        self.curve = [(episode, Summary(**one)) for episode, one in known["curve"]]
        self._others = known["others"]
        self._logs = [Path(log) for log in known["logs"]] + self._logs

    # Reads the logs of others and the own ones; returns how many elements are of others.
    def _read_logs(self) -> int:
        for path in self._logs:
            parts = list(of_logs(path, self._process, self._say))
            if not parts:
                raise InvalidArgument(f"{path} has no experience of this task with these options")
            for part in parts:
                self._book.add(part)
        _, prior = self._book.since(0)
        logs = self.folder / LOGS
        parts = [self._add(part) for part in of_logs(logs, self._process, self._say)]
        if any(map(len, parts)):
            self._recount(np.concatenate([part for part in parts if len(part)]))
        return prior

    # The elements of this training.
    def _own(self, elements: Array) -> Array:
        if not len(elements):
            return elements
        is_foreign = np.isin(elements["session"], self._others)
        mine: Array = elements[(elements["seed"] == self.plan.seed) & ~is_foreign]
        return mine

    # Takes elements of the robot; returns those of this training that are new.
    def _add(self, elements: Array) -> Array:
        new = self._book.add(self._own(elements))
        if len(new):
            self._next_episode = max(self._next_episode, int(new["episode"].max()) + 1)
        return new

    # A killed training may not have saved what it counted; the logs know it.
    def _recount(self, elements: Array) -> None:
        ended = elements["flags"] & (TERMINATED | TRUNCATED) != 0
        tally = self.tally
        tally.episodes = int(ended.sum())
        tally.actions = int((elements["actions"] > 0).sum())
        tally.successes = int((elements["flags"][ended] & SUCCESS != 0).sum())

    def _save(self) -> None:
        known = {
            "tally": dataclasses.asdict(self.tally),
            "curve": [(episode, dataclasses.asdict(one)) for episode, one in self.curve],
            "others": self._others,
            "logs": list(map(str, self._logs)),
        }
        replace_file(self.folder / TALLY, json.dumps(known, indent=2).encode())

    # The recorder ends last: it records how the others end.
    def _close(self) -> None:
        self._closes.set()
        recorder = self._processes.pop("recorder", None)
        for processes in (list(self._processes.values()), [recorder] if recorder else []):
            for process in processes:
                process.send_signal(signal.SIGCONT)
                process.terminate()
            for process in processes:
                try:
                    process.wait(30.0)
                except subprocess.TimeoutExpired:
                    process.kill()
        self._listener.close()
        self._board.close()

    # ---- threads ----

    # Reads the robot's experience as it comes.
    def _watch(self) -> None:
        try:
            while not self._closes.is_set():
                # Asked first: what came before it was over is still read.
                is_over = self._is_over.is_set()
                self._add(self._live.take())
                if self._live.missed:
                    self._say(
                        f"{self._live.missed} actions are only in the logs: --resume has them"
                    )
                    self._live.missed = 0
                if is_over:
                    self._closed_book.set()
                    return
                time.sleep(POLL)
        except Exception as error:
            self._events.put(("failed", error))

    def _accept(self) -> None:
        while not self._closes.is_set():
            with contextlib.suppress(OSError):  # the end, or nobody any more
                learner, _ = self._listener.accept()
                connection = Connection(learner.detach())
                threading.Thread(target=self._teach, args=(connection,), daemon=True).start()

    # Gives a learner what it asks for; it may be slow, stop or vanish.
    def _teach(self, connection: Connection) -> None:
        with contextlib.suppress(EOFError, OSError, AuthenticationError, ValueError), connection:
            deliver_challenge(connection, self._token)
            answer_challenge(connection, self._token)
            elements, number = self._book.since(0)
            first = {
                "plan": self.plan.to_json(),
                "configuration": self._configuration,
                "experience": elements,
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
                is_whole = self._closed_book.is_set()
                elements, number = self._book.since(number, 0.05 if message["waits"] else 0.0)
                answer = {"experience": elements, "is_whole": is_whole}
                connection.send_bytes(checkpoint.dump(answer))
        self._events.put(("gone", None))


def join(address: str, token: Path) -> None:
    """Learns for a RobotTraining, on this machine or another one, until there is nothing to learn.

    `address` is its HOST:PORT, `token` a copy of the file in its folder. Raises InvalidArgument for
    anything else, and Error if nobody is there or the token is another one.
    """
    try:
        connection = Client(address_of(address), authkey=token.read_bytes())
    except (AuthenticationError, EOFError):
        raise Error(f"{address} has another token than {token}") from None
    except (OSError, OverflowError) as error:
        raise Error(f"no training waits at {address}: {error}") from None
    with connection:
        serve(connection)


def address_of(text: str) -> tuple[str, int]:
    """The address that HOST:PORT means; raises InvalidArgument."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise InvalidArgument(f"'{text}' is no HOST:PORT")
    return host, int(port)


def summary_of(reports: Iterable[Mapping[str, Any]], unit: str) -> Summary:
    """How near episodes came to their goals, of the reports of `trifinger run-policy --json`."""
    ended = list(reports)
    distances = [one for report in ended for one in report["distance"] if one is not None]
    successes = [report["is_success"] for report in ended]
    no_paths = np.zeros((len(ended), 0, 0))
    return Evaluation(np.array(distances), np.array(successes), no_paths, unit).summary()


def _token_in(path: Path) -> bytes:
    path.touch(0o600)
    path.chmod(0o600)
    if not path.read_text():
        path.write_text(secrets.token_hex(32))
    return path.read_bytes()


def _state_of(path: Path) -> Any:
    return checkpoint.load(path.read_bytes()) if path.exists() else None
