# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger policy`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from trifinger import extras
from trifinger._trifinger import Policy
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_json, add_output, say, say_json
from trifinger.errors import InvalidArgument
from trifinger.policy_file import to_onnx, with_metadata
from trifinger.whole_file import whole_file


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger policy`."""
    parser = ArgumentParser(
        prog="trifinger policy",
        description="Look at the file of a policy, make a policy of a network that another "
        "program has trained and exported as ONNX, or write one as ONNX.",
        epilog="Examples:\n"
        "  trifinger policy info reach/reach.policy\n"
        "  trifinger policy import actor.onnx --task reach --set action=torque -o reach.onnx\n"
        "  trifinger run-policy reach.onnx --robot sim\n"
        "  trifinger policy export reach/reach.policy",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    info = commands.add_parser("info", help="say what a policy turns into what, and for which task")
    info.add_argument("policy", type=Path, help="a file of a policy")
    add_json(info)
    take = commands.add_parser("import", help="say for which task and robot a network is")
    take.add_argument("network", type=Path, help="a file of ONNX")
    take.add_argument("--task", required=True, help="what it does: one of `trifinger train --help`")
    take.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a field of trifinger.environments.Options: how it observes and acts",
    )
    take.add_argument("--robot-config", metavar="NAME|FILE", help="the robot of its training")
    add_output(take, "the file that is written; default: TASK.onnx", "FILE")
    give = commands.add_parser("export", help="write a policy as ONNX, for the programs of others")
    give.add_argument("policy", type=Path, help="a file of a policy")
    add_output(give, "the file that is written; default: that of the policy, with .onnx", "FILE")
    arguments = parser.parse_args(words)
    work = {"info": _info, "import": _import, "export": _export}[arguments.command]
    return command_line.run(lambda: work(arguments))


def _info(arguments: argparse.Namespace) -> None:
    policy = Policy(arguments.policy)
    about = {
        "inputs": policy.num_inputs,
        "outputs": policy.num_outputs,
        "has_state": policy.has_state,
        "metadata": policy.metadata,
    }
    if arguments.json:
        say_json(about)
        return
    of = "also of earlier observations" if policy.has_state else "of the last observation alone"
    say(f"{policy.num_inputs} numbers become {policy.num_outputs}, {of}")
    for name in ("task", "options", "robot"):
        say(f"{name}: {policy.metadata.get(name, 'the file does not say it')}")


def _import(arguments: argparse.Namespace) -> None:
    extras.require("learning", "gymnasium")
    from trifinger.environments import Options, policy_metadata
    from trifinger.evaluation import Evaluator
    from trifinger.training import parse_setting

    if arguments.network.suffix != ".onnx":
        raise InvalidArgument(f"{arguments.network} does not end in .onnx")
    policy, content = network_of(arguments.network)
    options = Options.of(arguments.task, **dict(map(parse_setting, arguments.set)))
    Evaluator(arguments.task, options, 1, config=arguments.robot_config).rows_of(policy)
    if policy.metadata.keys() & {"task", "options"}:
        raise InvalidArgument(f"{arguments.network} is a policy already: its file says its task")
    known = policy_metadata(arguments.task, options, arguments.robot_config)
    output = arguments.output or Path(f"{arguments.task.replace(':', '_')}.onnx")
    if output.suffix != ".onnx":
        raise InvalidArgument(f"{output} does not end in .onnx")
    with whole_file(output) as part:
        part.write_bytes(with_metadata(content, known))
    say(f"{output} is a policy for the task '{arguments.task}'.", file=sys.stderr)


def network_of(file: Path) -> tuple[Policy, bytes]:
    """A network of ONNX and the bytes of its file, with weights that PyTorch wrote beside it."""
    if not file.with_name(f"{file.name}.data").exists():
        return Policy(file), file.read_bytes()
    extras.require("learning", "onnx")
    import onnx

    content = bytes(onnx.load(file).SerializeToString())
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, file.name)
        whole.write_bytes(content)
        return Policy(whole), content


def _export(arguments: argparse.Namespace) -> None:
    extras.require("learning", "onnx")
    output = arguments.output or arguments.policy.with_suffix(".onnx")
    if output.suffix != ".onnx":
        raise InvalidArgument(f"{output} does not end in .onnx")
    content = to_onnx(Policy(arguments.policy))
    with whole_file(output) as part:
        part.write_bytes(content)
    say(f"{output} has what {arguments.policy} computes.", file=sys.stderr)
