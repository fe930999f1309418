# SPDX-License-Identifier: BSD-3-Clause
"""Programs that run a robot for the programs of users.

In a checkout, `python -m robot_fingers.programs NAME` runs one of them.
"""

import argparse
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import trifinger
from robot_interfaces.py_generic import RobotBackendTerminationReason
from robot_interfaces.py_trifinger_types import MultiProcessData
from trifinger.commands import program
from trifinger.commands.command_line import ArgumentParser
from trifinger.errors import Error
from trifinger.log import original
from trifinger_compat.robot_data import RobotBackend

from robot_fingers.pybullet_drivers import simulator_overrides

CUBE = "[{name: cube, type: cube, size: [0.065], mass: 0.094, position: [0, 0, 0.0325]}]"
PERIOD, DELAY = 0.1, 0.09  # of poses and images [s]
INCOMPLETE = 20  # exit status, by the original
_NO_CAMERAS = (
    "the robot has no cameras; give --render-images to pybullet_backend, or a section 'cameras' "
    "to the configuration (docs/cameras.md)"
)


def _dice() -> str:
    from trifinger_simulation.tasks import rearrange_dice

    return "[{}]".format(
        ", ".join(
            f"{{name: die_{i}, type: cube, size: [0.022], mass: 0.012, position: {list(place)}, "
            f"colours: {[rearrange_dice.DIE_COLOUR] * 6}}}"
            for i, place in enumerate(rearrange_dice.sample_goal())
        )
    )


def simulation_overrides(scene: str, *, has_cameras: bool) -> dict[str, object]:
    """What the configuration of a TriFingerPro needs to be the original's simulated platform."""
    values: dict[str, object] = {
        "objects": {"cube": CUBE, "dice": _dice() if scene == "dice" else "", "none": "[]"}[scene],
        "simulation.object_period": PERIOD,
        "simulation.object_delay": DELAY,
        **simulator_overrides("trifingerpro"),
    }
    if has_cameras:
        values |= {
            "cameras.source": "simulated",
            "cameras.calibration": "figures",
            "cameras.rate": 1 / PERIOD,
            "cameras.exposure": 0.0015,
            "cameras.gain": 0,
            "cameras.size": 540,
            "cameras.pixels": "bayer_rggb8",
            "cameras.devices": "[]",
            "cameras.delay": DELAY,
            "cameras.varies": "false",
        }
    return values


def _add_name(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--ready-indicator", type=Path, help="a file that is made when it is ready")
    parser.add_argument("--name", default="trifinger", help="name of the session")


def _add_limits(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-a", "--max-number-of-actions", type=int, default=0)
    parser.add_argument("-t", "--first-action-timeout", type=float, default=float("inf"))


def _add_logs(parser: argparse.ArgumentParser, condition: str = "") -> None:
    parser.add_argument("--robot-logfile", type=Path, help=f"robot_data.dat{condition}")
    parser.add_argument("--camera-logfile", type=Path, help=f"camera_data.dat{condition}")


def _add_common(parser: argparse.ArgumentParser) -> None:
    _add_limits(parser)
    _add_logs(parser, "; needs -a")
    _add_name(parser)


def _add_ignored(parser: argparse.ArgumentParser) -> None:
    said = "is said by the configuration here"
    for name in ("--cameras-with-tracker", "--cameras", "-c"):
        parser.add_argument(name, action="store_true", help=said)
    for name in ("--object", "--config-dir"):
        parser.add_argument(name, help=said)


def _wants_logs(arguments: Any) -> bool:
    return arguments.robot_logfile is not None or arguments.camera_logfile is not None


def _say_ready(arguments: Any) -> None:
    if arguments.ready_indicator is not None:
        arguments.ready_indicator.touch()
    print("The robot is ready.", flush=True)


def _settings(overrides: Mapping[str, object]) -> list[str]:
    return [word for key, value in overrides.items() for word in ("--set", f"{key}={value}")]


def _has_cameras(config: str, overrides: Mapping[str, object]) -> bool:
    command = [program.path(), "config", config, *_settings(overrides)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # What is wrong with a configuration is said when it is run.
    return done.returncode != 0 or "\ncameras." in done.stdout


def _require_targets(parser: argparse.ArgumentParser, arguments: Any) -> None:
    """Ends the program if a log could not be written: a run must not be for nothing."""
    for target in filter(None, (arguments.robot_logfile, arguments.camera_logfile)):
        try:
            if target.exists() and not target.is_file():
                target.open("wb").close()
            else:  # it will be a new file
                tempfile.TemporaryFile(dir=target.resolve().parent).close()
        except OSError as error:
            parser.error(f"the log {target} cannot be written: {error.strerror}")


def _save(record: Path, arguments: Any) -> bool:
    """Writes the logs that were asked for; False, and says why, if one could not be written."""
    try:
        session = trifinger.Log(record).session(arguments.name)
        if arguments.robot_logfile is not None:
            original.write_robot_log(arguments.robot_logfile, original.robot_rows(session))
        if arguments.camera_logfile is not None:
            if not original.has_cameras(session):
                raise Error(f"{arguments.camera_logfile} is not written: {_NO_CAMERAS}")
            original.export_cameras(session, arguments.camera_logfile)
    except (Error, OSError) as error:
        print(error, file=sys.stderr)
        return False
    return True


@contextmanager
def _record() -> Iterator[Path]:
    """A folder for what a robot does. It stays, and is named, unless the block ends well."""
    folder = Path(tempfile.mkdtemp())
    try:
        yield folder
    except BaseException:
        if any(folder.iterdir()):
            print(
                f"what the robot did is kept in {folder}; `trifinger log export {folder} --format "
                "original -o FOLDER` writes the logs",
                file=sys.stderr,
            )
        else:
            folder.rmdir()
        raise
    shutil.rmtree(folder)


class _EndOnSignal:
    """Makes SIGTERM an orderly end, from now on."""

    def __init__(self) -> None:
        self.ask: Callable[[], None] | None = None
        """Asks what runs to end; before there is one, the program ends."""
        signal.signal(signal.SIGTERM, self._end)

    def _end(self, *_: Any) -> None:
        if self.ask is None:
            sys.exit(128 + signal.SIGTERM)
        self.ask()


def _wait_for_end(arguments: Any, wait: Callable[[], int], end: Callable[[], object]) -> int:
    """Says that a robot is ready and returns what `wait` does; Ctrl-C and errors `end` it."""
    try:
        _say_ready(arguments)
        return wait()
    except BaseException as error:
        end()
        status = wait()
        if not isinstance(error, KeyboardInterrupt):
            raise
        return status


def _run_until_end(
    arguments: Any, config: str, *values: Any, **options: Any
) -> RobotBackendTerminationReason:
    """Starts a robot, says that it is ready, waits for its end and says why it has ended.

    Says why and ends the program if it cannot start.
    """
    at_end = _EndOnSignal()
    try:
        backend = RobotBackend(
            MultiProcessData(arguments.name, True),
            config,
            *values,
            first_action_timeout=arguments.first_action_timeout,
            max_number_of_actions=arguments.max_number_of_actions,
            **options,
        )
    except (RuntimeError, OSError) as error:
        sys.exit(str(error))
    at_end.ask = backend.ask_to_end
    number = _wait_for_end(arguments, backend.wait_until_terminated, backend.request_shutdown)
    reason = RobotBackendTerminationReason(number)
    print(f"The robot has ended: {reason.name}.", flush=True)
    return reason


def _run(
    parser: argparse.ArgumentParser,
    arguments: Any,
    config: str,
    overrides: dict[str, object],
    real_time: bool,
) -> int:
    """Runs a robot and its logs; returns the exit status."""
    if not _wants_logs(arguments):
        reason = _run_until_end(arguments, config, overrides, real_time=real_time)
        return max(0, -reason)
    if not arguments.max_number_of_actions:
        parser.error("--robot-logfile and --camera-logfile need --max-number-of-actions")
    if arguments.camera_logfile is not None and not _has_cameras(config, overrides):
        parser.error(f"--camera-logfile: {_NO_CAMERAS}")
    _require_targets(parser, arguments)
    with _record() as folder:
        record = str(folder)
        reason = _run_until_end(arguments, config, overrides, real_time=real_time, record=record)
        if not _save(folder, arguments):
            sys.exit(max(1, -reason))
    return max(0, -reason)


def pybullet_backend(words: Sequence[str] | None = None) -> int:
    """Runs a simulated TriFingerPro for programs of users; it needs no PyBullet."""
    parser = ArgumentParser(prog="pybullet_backend", description=pybullet_backend.__doc__)
    _add_common(parser)
    parser.add_argument("-r", "--real-time-mode", action="store_true")
    parser.add_argument("--object", choices=("cube", "dice", "none"), default="cube")
    parser.add_argument("--cameras", action="store_true", help="poses of the object; always there")
    parser.add_argument("--render-images", action="store_true", help="images of three cameras")
    parser.add_argument("-v", "--visualize", action="store_true", help="says how to see the robot")
    arguments = parser.parse_args(words)
    if arguments.visualize:
        print(f"`trifinger view {arguments.name}` shows the robot in a browser.", flush=True)
    overrides = simulation_overrides(arguments.object, has_cameras=arguments.render_images)
    return _run(parser, arguments, "trifinger_pro", overrides, arguments.real_time_mode)


def trifinger_backend(words: Sequence[str] | None = None) -> int:
    """Runs the robot of a configuration of this project for programs of users."""
    parser = ArgumentParser(prog="trifinger_backend", description=trifinger_backend.__doc__)
    _add_common(parser)
    parser.add_argument("--config", required=True, help="a configuration: its name or its file")
    _add_ignored(parser)
    arguments = parser.parse_args(words)
    return _run(parser, arguments, arguments.config, {}, True)


def trifinger_robot_backend(words: Sequence[str] | None = None) -> int:
    """Runs the robot of a configuration; trifinger_data_backend, if it runs, writes the logs."""
    parser = ArgumentParser(
        prog="trifinger_robot_backend", description=trifinger_robot_backend.__doc__
    )
    _add_limits(parser)
    _add_name(parser)
    parser.add_argument("--config", required=True, help="a configuration: its name or its file")
    parser.add_argument(
        "--fail-on-incomplete-run",
        action="store_true",
        help=f"exit status {INCOMPLETE} if it ends before the number of actions",
    )
    _add_ignored(parser)
    arguments = parser.parse_args(words)
    reason = _run_until_end(arguments, arguments.config)
    is_whole = reason is RobotBackendTerminationReason.MAXIMUM_NUMBER_OF_ACTIONS_REACHED
    if reason >= 0 and arguments.fail_on_incomplete_run and not is_whole:
        return INCOMPLETE
    return max(0, -reason)


def trifinger_data_backend(words: Sequence[str] | None = None) -> int:
    """Keeps what a robot does and writes it to logs when the robot has ended.

    Start it before the robot. Here it is not needed for the robot or for front-ends.
    """
    parser = ArgumentParser(
        prog="trifinger_data_backend", description=trifinger_data_backend.__doc__
    )
    _add_logs(parser)
    _add_name(parser)
    parser.add_argument("-a", "--max-number-of-actions", help="not needed here: all are kept")
    _add_ignored(parser)
    arguments = parser.parse_args(words)
    _require_targets(parser, arguments)
    with _record() as folder:
        at_end = _EndOnSignal()
        command = [program.path(), "record", arguments.name, "-o", str(folder), "--until-end"]
        recorder = subprocess.Popen(
            [*command, "--images", "raw"], stdout=subprocess.DEVNULL, start_new_session=True
        )
        at_end.ask = recorder.terminate
        status = _wait_for_end(arguments, recorder.wait, recorder.terminate)
        if _wants_logs(arguments):
            if not any(folder.iterdir()):
                sys.exit(f"no robot '{arguments.name}' ran: there are no logs")
            if not _save(folder, arguments) or status > 0:
                sys.exit(max(1, status))
    return max(0, status)


def main() -> int:
    """Runs the program that the command line names; returns its exit status."""
    programs = {
        each.__name__: each
        for each in (
            pybullet_backend,
            trifinger_backend,
            trifinger_robot_backend,
            trifinger_data_backend,
        )
    }
    parser = ArgumentParser(prog="python -m robot_fingers.programs")
    parser.add_argument("program", choices=programs)
    arguments = parser.parse_args(sys.argv[1:2])
    return programs[arguments.program](sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
