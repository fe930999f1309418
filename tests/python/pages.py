# SPDX-License-Identifier: BSD-3-Clause
"""Runs a page as a reader does: code blocks in their order, in an empty folder.

What stands after the language of a block says what a reader does with it:

    ```bash                     types its lines into one terminal, one after the other
    ```bash stays               types its line into a terminal of its own, where it keeps running
    ```text output              finds it in what the block before has printed; ... is anything
    ```text typed 1             types it into the first terminal whose program keeps running
    ```text output 2            waits until the second of these programs has printed it
    ```python NAME              saves it as the file NAME; so for every language
    ```bash tests/FILE::TEST    nothing here: this test does it, as a rule in less time
    ```bash needs root          nothing here, and in no test: see NEEDS
    ```python                   nothing here: it is only shown; so for every language but bash
"""

import contextlib
import math
import re
import signal
import subprocess
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tracked_files import tracked_files

ROOT = Path(__file__).parents[2]
TESTS = ("tests/", "packages/")  # folders of tests
BLOCK = re.compile(
    r"^```(?P<language>\w+)(?: (?P<use>[^\n]+))?\n(?P<code>.*?)^```$", re.DOTALL | re.MULTILINE
)
PICTURE = re.compile(r"!\[[^]]*\]\([^)]*images/tutorials/(?P<name>[^)]+)\)")
NEEDS = {
    "hardware": "motors, cameras or input devices that no program can stand for",
    "root": "changes the machine: its packages, its kernel, its users",
    "network": "downloads, or reaches another machine",
    "environment": "changes the Python environment that the tests run in",
    "setup": "./run test does it before any test",
    "release": "./run release --check does it",
    "systemd": "no systemd runs where the tests do; tests/machine has such a group",
    "hours": "takes hours, and nothing of it can be left out",
}
"""Why no test types a command, after `needs` in a block of a page."""

# `trifinger doctor` says by its status that a check has failed: this is no failure.
WITH_FINDINGS = "trifinger doctor"
LONGEST = 270.0
"""Time for all commands of a page on a busy machine [s]. The watchdog of pytest comes later."""


@dataclass(frozen=True)
class Block:
    """A code block of a page."""

    language: str
    use: str
    code: str
    line: int

    @property
    def is_file(self) -> bool:
        """Whether a reader saves it as a file."""
        uses = ("output", "stays", "typed", *TESTS, "needs ")
        return bool(self.use) and not self.use.startswith(uses)

    @property
    def is_typed(self) -> bool:
        """Whether a reader types it into a terminal, and nothing speaks against it here."""
        return self.language == "bash" and self.use in ("", "stays")

    @property
    def test(self) -> tuple[Path, str] | None:
        """The file and the name of the test that does it instead."""
        if not self.use.startswith(TESTS):
            return None
        path, _, name = self.use.partition("::")
        return ROOT / path, name


def documents() -> list[Path]:
    """Returns all pages that a reader may follow."""
    return [ROOT / path for path in tracked_files(".md") if path.name != "CHANGELOG.md"]


def blocks(text: str) -> list[Block]:
    """Returns the code blocks of a page."""
    return [
        Block(found["language"], found["use"] or "", found["code"], line_of(text, found))
        for found in BLOCK.finditer(text)
    ]


def line_of(text: str, found: re.Match[str]) -> int:
    """Returns the number of the line at which something was found."""
    return text[: found.start()].count("\n") + 1


def pictures(text: str) -> list[str]:
    """Returns the names of the pictures that a page makes and shows."""
    return PICTURE.findall(text)


def commands(code: str) -> list[str]:
    """Returns the commands of a block; a line that ends with a backslash goes on in the next."""
    lines = code.replace("\\\n", " ").splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def contains(output: str, expected: str) -> bool:
    """Says whether `expected` is part of an output; spaces count once, ... is anything."""
    parts = (r"\s+".join(map(re.escape, part.split())) for part in expected.split("..."))
    return re.search(r".*?".join(parts), output, re.DOTALL) is not None


class Terminal:
    """A program that keeps running in a terminal of its own."""

    def __init__(self, command: str, folder: Path, variables: Mapping[str, str]) -> None:
        """Starts it."""
        self.command = command
        self.output = ""
        self._is_closed = False
        self._changed = threading.Condition()
        self._process = subprocess.Popen(
            # It ends with this process, however that ends.
            ["setpriv", "--pdeathsig", "KILL", "bash", "-c", f"exec {command}"],
            cwd=folder,
            env=variables,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def wait_for(self, text: str, timeout: float) -> None:
        """Waits until it has printed `text`, in which ... is anything."""
        with self._changed:
            self._changed.wait_for(lambda: contains(self.output, text) or self._is_closed, timeout)
        assert contains(self.output, text), f"'{self.command}' has only said:\n{self.output}"

    def type(self, text: str) -> None:
        """Types a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(text)
        self._process.stdin.flush()

    def end(self) -> None:
        """Presses Ctrl-C, as the page says at its end."""
        with self._process:
            try:
                self._process.send_signal(signal.SIGINT)
                self._process.wait(LONGEST)
            finally:
                self._process.kill()
                self._reader.join()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._changed:
                self.output += line
                self._changed.notify_all()
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()


class Page:
    """A page that is run in a folder."""

    def __init__(
        self,
        path: Path,
        folder: Path,
        variables: Mapping[str, str],
        added: Mapping[str, str] | None = None,
    ) -> None:
        """Reads the page. `added` is what files of these names get at their end besides."""
        self.path = path
        self.folder = folder
        self.text = path.read_text()
        self._variables = dict(variables)
        self._added = added or {}
        self._terminals: list[Terminal] = []
        self._said: str | Terminal = ""
        self._end = math.inf

    def run(self) -> None:
        """Does what the blocks say, then ends what still runs."""
        self._end = time.monotonic() + LONGEST
        try:
            for block in blocks(self.text):
                self._do(block)
        except BaseException:
            for terminal in self._terminals:
                print(f"{terminal.command}:\n{terminal.output}")
            raise
        finally:
            with contextlib.ExitStack() as ends:
                for terminal in self._terminals:
                    ends.callback(terminal.end)

    @property
    def _remaining(self) -> float:
        return max(self._end - time.monotonic(), 0.0)

    def save_files(self) -> None:
        """Saves what the blocks name as files, and does nothing else."""
        for block in blocks(self.text):
            if block.is_file:
                self._save(block)

    def _save(self, block: Block) -> None:
        text = block.code + self._added.get(block.use, "")
        (self.folder / block.use).write_text(text)

    def _do(self, block: Block) -> None:
        where = f"{self.path.name}:{block.line}"
        if block.use.startswith("output "):
            self._terminals[int(block.use.split()[1]) - 1].wait_for(block.code, self._remaining)
        elif block.use == "output":
            if isinstance(self._said, Terminal):
                self._said.wait_for(block.code, self._remaining)
            else:
                assert contains(self._said, block.code), f"{where}: the output is\n{self._said}"
        elif block.use == "stays":
            (command,) = commands(block.code)
            self._said = Terminal(command, self.folder, self._variables)
            self._terminals.append(self._said)
        elif block.use.startswith("typed"):
            self._terminals[int(block.use.split()[1]) - 1].type(block.code)
        elif block.is_file:
            self._save(block)
        elif block.is_typed:
            said = [self._run(command, where) for command in commands(block.code)]
            self._said = "".join(said)

    def _run(self, command: str, where: str) -> str:
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self.folder,
            env=self._variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            timeout=self._remaining,
            text=True,
            check=False,
        )
        fine = (0, 1) if command.startswith(WITH_FINDINGS) else (0,)
        assert done.returncode in fine, f"{where}: '{command}' failed:\n{done.stdout}"
        return done.stdout
