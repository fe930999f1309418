# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger motion`."""

import argparse
import signal
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from trifinger._trifinger import Log, connect
from trifinger.commands.command_line import (
    ArgumentParser,
    add_json,
    add_log_options,
    add_output,
    add_robot,
    run,
    say,
    say_json,
)
from trifinger.errors import InvalidArgument

from trifinger_view.motion import JointFacts, Motion, Plan, play
from trifinger_view.motion.plot import plot

EXAMPLES = """Example:
  trifinger motion from-log logs --from 2 --to 9 -o wave.motion
  trifinger motion info wave.motion
  trifinger motion trim wave.motion --from 1 -o short.motion
  trifinger motion smooth wave.motion --cutoff 5 -o smooth.motion
  trifinger motion slow smooth.motion --within-limits -o slow.motion
  trifinger motion mirror slow.motion -o mirrored.motion
  trifinger motion turn slow.motion -o turned.motion
  trifinger motion join slow.motion turned.motion -o both.motion
  trifinger motion plot slow.motion -o slow.png
  trifinger motion play slow.motion --robot sim
'trifinger motion COMMAND --help' tells more; docs/motions.md tells all."""


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger motion",
        description="Change, draw and play motions: trajectories of joints in files.",
        epilog=EXAMPLES,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, text: str, files: Sequence[str] = ("file",)) -> ArgumentParser:
        command: ArgumentParser = commands.add_parser(name, help=text, description=text + ".")
        for file in files:
            command.add_argument(file, type=Path, help="a motion")
        return command

    about = add("info", "Say what is in a motion, and whether it is within the limits")
    add_config(about)
    add_json(about)
    trim = add("trim", "Keep the part between two times")
    trim.add_argument("--from", dest="from_", type=float, metavar="SECONDS", help="default: 0")
    trim.add_argument("--to", type=float, metavar="SECONDS", help="default: the end")
    smooth = add("smooth", "Take out vibrations, without a delay")
    smooth.add_argument(
        "--cutoff", type=float, required=True, metavar="HZ", help="vibrations above this go"
    )
    slow = add("slow", "Make it slower, or just as slow as the limits of the robot ask for")
    how = slow.add_mutually_exclusive_group(required=True)
    how.add_argument("--factor", type=float, help="times as long; below 1: faster")
    how.add_argument(
        "--within-limits", action="store_true", help="as slow as the limits of its joints ask for"
    )
    mirror = add("mirror", "Exchange left and right: a mirror stands along one finger")
    mirror.add_argument("--finger", type=int, default=0, help="number of this finger; default: 0")
    turn = add("turn", "Give the part of each finger to another one: turn by 120 degrees")
    turn.add_argument(
        "--fingers", type=int, default=1, help="how far, 120 degrees clockwise each; default: 1"
    )
    join = add("join", "Put one motion after the other, without a jump", ("first", "second"))
    join.add_argument(
        "--blend",
        type=float,
        metavar="SECONDS",
        help="time from one to the other; default: as short as the limits allow",
    )
    from_log = add("from-log", "Take what a robot did from a log", ())
    add_source_options(from_log)
    for command in (trim, smooth, slow, mirror, turn, join, from_log):
        add_output(command, "the new motion", required=True)
        command.add_argument("--force", action="store_true", help="replace a file that is there")
    for command in (slow, mirror, join):
        add_config(command)
    draw = add("plot", "Draw positions, speeds, torques and tips beside the limits")
    add_output(draw, ".png, .svg or .pdf; is replaced", required=True)
    add_config(draw)
    add_play_options(
        add("play", "Lead a running robot to the start of a motion, and let it do the motion")
    )
    return parser.parse_args(words)


def add_source_options(from_log: argparse.ArgumentParser) -> None:
    """Adds the options that say what to take from a log."""
    add_log_options(from_log)
    from_log.add_argument("--robot", metavar="NAME", default="", help="needed if there are several")
    from_log.add_argument(
        "--series",
        choices=["observation", "desired_action"],
        default="observation",
        help="measured or desired positions; default: observation",
    )


def add_play_options(do: ArgumentParser) -> None:
    """Adds the robot that does a motion, and how it does it."""
    add_robot(do, "--robot")
    do.add_argument("--times", type=int, default=1, metavar="N", help="how often; default: 1")
    do.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="RAD/S",
        help="largest speed of a joint on the way to the start; default: 1",
    )
    do.add_argument(
        "--no-feedforward",
        dest="feedforward",
        action="store_false",
        help="do not compute torques that the motion needs; the gains of the robot do all",
    )


def add_config(parser: argparse.ArgumentParser) -> None:
    """Adds --config, which `facts_of` reads."""
    parser.add_argument(
        "--config",
        metavar="NAME|FILE",
        help="configuration with the limits of the robot; default: the one in the motion",
    )


def facts_of(arguments: argparse.Namespace) -> JointFacts | None:
    """The joints and limits that --config chose; None for those in the motion."""
    return JointFacts.load(arguments.config) if arguments.config else None


def info(motion: Motion, facts: JointFacts | None) -> str:
    """What is in a motion, as text for people."""
    lines = [
        f"{motion.duration:.3f} s, {len(motion)} samples, of {motion.created}",
        f"for '{motion.robot}' with {len(motion.joints)} joints"
        + ("" if motion.configuration else "; without its configuration"),
    ]
    lines += [f"  {line}" for line in motion.history]
    width = max(map(len, motion.joints))
    lines.append(f"{'joint':{width}}   least  largest [rad]  fastest [rad/s]; of slides [m], [m/s]")
    fastest = np.abs(motion.velocities).max(axis=0)
    for i, name in enumerate(motion.joints):
        column = motion.positions[:, i]
        lines.append(
            f"{name:{width}}  {column.min():6.3f}   {column.max():6.3f}         {fastest[i]:7.3f}"
        )
    if facts is None and not motion.configuration:
        lines.append("limits: unknown; --config NAME checks them")
    elif found := motion.violations(facts):
        lines.append(f"beyond the limits in {len(found)} places:")
        lines += [f"  {violation}" for violation in found]
    else:
        lines.append("within the limits of its robot")
    return "\n".join(lines)


def report(motion: Motion, facts: JointFacts | None) -> dict[str, object]:
    """What is in a motion, for programs; without known limits, violations are None."""
    is_known = facts is not None or motion.configuration
    return {
        "robot": motion.robot,
        "created": str(motion.created),
        "duration": motion.duration,
        "samples": len(motion),
        "joints": list(motion.joints),
        "least": motion.positions.min(axis=0).tolist(),
        "largest": motion.positions.max(axis=0).tolist(),
        "fastest": np.abs(motion.velocities).max(axis=0).tolist(),
        "history": list(motion.history),
        "violations": [str(one) for one in motion.violations(facts)] if is_known else None,
    }


def changed(arguments: argparse.Namespace) -> Motion:
    """The motion that a command makes of one or two others, or of a log."""
    if arguments.command == "from-log":
        return Motion.from_log(
            Log(arguments.log).session(arguments.robot),
            arguments.from_,
            arguments.to,
            series=arguments.series,
        )
    if arguments.command == "join":
        other = Motion.load(arguments.second)
        return Motion.load(arguments.first).join(other, arguments.blend, facts_of(arguments))
    motion = Motion.load(arguments.file)
    if arguments.command == "trim":
        return motion.trim(arguments.from_, arguments.to)
    if arguments.command == "smooth":
        return motion.smooth(arguments.cutoff)
    if arguments.command == "mirror":
        return motion.mirror(arguments.finger, facts_of(arguments))
    if arguments.command == "turn":
        return motion.turn(arguments.fingers)
    if arguments.within_limits:
        return motion.slow_within_limits(facts_of(arguments))
    return motion.slow(arguments.factor)


def play_on_robot(arguments: argparse.Namespace) -> int:
    """Plays a motion on a running robot and ends its session; returns the exit status."""
    motion = Motion.load(arguments.file)
    ending: list[int] = []
    old = {
        number: signal.signal(number, lambda number, _: ending.append(number))
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
    }

    def report(plan: Plan) -> None:
        say(
            f"The robot goes to the start in {plan.approach_time:.2f} s; "
            f"all of it takes {plan.duration:.2f} s. Ctrl-C stops it.",
            flush=True,
        )

    try:
        robot = connect(arguments.robot)
        try:
            play(
                robot,
                motion,
                times=arguments.times,
                speed=arguments.speed,
                feedforward=arguments.feedforward,
                should_stop=lambda: bool(ending),
                on_plan=report,
            )
            robot.finish()
        finally:
            robot.close()
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)
    if ending:
        say("Stopped: the robot has braked and rests.")
        return 128 + ending[0]
    say("Done: the robot rests.")
    return 0


def work(arguments: argparse.Namespace) -> int:
    """Does what the command line says and returns the exit status."""
    if arguments.command == "play":
        return play_on_robot(arguments)
    if arguments.command == "info":
        motion, facts = Motion.load(arguments.file), facts_of(arguments)
        say_json(report(motion, facts)) if arguments.json else say(info(motion, facts))
        return 0
    if arguments.command == "plot":
        plot(Motion.load(arguments.file), arguments.output, facts_of(arguments))
    else:
        if arguments.output.exists() and not arguments.force:
            raise InvalidArgument(f"{arguments.output} exists; --force replaces it")
        motion = changed(arguments)
        motion.save(arguments.output, overwrite=arguments.force)
        if motion.history:
            say(motion.history[-1])
    say(f"{arguments.output} written.")
    return 0


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger motion`."""
    arguments = parse(words)
    return run(lambda: work(arguments))
