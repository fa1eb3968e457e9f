"""Play a match of ROS 2 nodes: the simulator and every player, each a process of its own.

    .venv/bin/python scripts/match.py --task 3v2 --episodes 50 --keeper-policy learn
    .venv/bin/python scripts/match.py --speed 1 --keeper-policy hand --record out/bag
    .venv/bin/python scripts/match.py --keeper-policy greedy --load-weights out/weights --json
    .venv/bin/python scripts/match.py --episodes 20 --keeper-agent "python my_keeper.py"
    .venv/bin/python scripts/match.py --episodes 20 --agent keeper_2=my_keeper.py

Ctrl-C ends it with weights and bag whole. A player that fails is named, and the code at the end is
1. Give a second match on this machine another --domain or --namespace. With --json the last line of
the output is one JSON object.
"""

import argparse
import itertools
import json
import multiprocessing
import os
import shlex
import sys
import time
from functools import partial
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import NamedTuple

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from keepaway_agent.actions import Role
from keepaway_agent.errors import AgentError
from keepaway_agent.nodes import keeper, taker
from keepaway_agent.nodes.player import PlayerNode
from keepaway_agent.playing.policies import KEEPER_POLICIES, TAKER_POLICIES
from keepaway_agent.training.ahead import load_for_match
from keepaway_sim.cli.interrupts import SIGNALS
from keepaway_sim.cli.options import add_options, ros_arguments
from keepaway_sim.cli.processes import Processes, script_command
from keepaway_sim.errors import KeepawayError
from keepaway_sim.match.beginning import random_match_id
from keepaway_sim.match.settings import MatchSettings, named_texts
from keepaway_sim.nodes import simulator
from keepaway_sim.nodes.scoreboard import Scoreboard
from keepaway_sim.nodes.simulator import Simulator
from keepaway_sim.ros.running import end_ros, ignore_signals, received_signals
from keepaway_sim.task import Role as TaskRole
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config

SCRIPTS = Path(__file__).resolve().parent
COMPILE_TIMEOUT = 1800.0  # [s] for the simulator to be found; a first start compiles before
START_TIMEOUT = 300.0  # [s] after that, for all players to come; they may compile, too
END_TIMEOUT = 15.0  # [s] for all nodes to save and end
MATCH_OPTIONS = (
    *("task", "field", "seed", "speed", "episodes", "answer_timeout"),
    *("record", "wait_for_recorder", "force"),
)
WORLD_OPTIONS = ("profile", "visible_angle_deg")
MAINS = {"simulator": simulator.main, "keeper": keeper.main, "taker": taker.main}
MOST_UNHEARD = 1000  # messages that may still wait to be taken in at the end


class MatchError(RuntimeError):
    """A match that cannot be played (to its end)."""


class Member(NamedTuple):
    """One node of a match."""

    name: str
    kind: str  # simulator, keeper or taker
    program: list[str]  # the command that starts it, without arguments
    arguments: list[str]  # ROS's
    is_ours: bool


def main() -> int:
    """Play, say how it went."""
    args = parse()
    args.namespace = args.namespace and f"/{args.namespace.strip('/')}"
    signals = received_signals(SIGNALS)
    if args.domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(args.domain)
    try:
        task = Task.parse(args.task, args.field)
        seat_agents(args, task)
        check_files(args)
        args.match_id = random_match_id()
        if not args.json:
            announce(args)
        play = play_in_one_process if args.single_process else play_in_processes
        board, failed = play(args, members(args, task), signals)
        board.conclude()
        report(args, board.summary())
    except (AgentError, KeepawayError, MatchError, OSError) as error:
        print(f"match: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:  # StoppedCompiling, where all nodes are in this process
        print("match: stopped while it compiled", file=sys.stderr)
        return 128 + signals[0]
    finally:
        end_ros()
    ignore_signals(SIGNALS)
    if signals:
        return 128 + signals[0]  # as shells expect it: 130 after Ctrl-C
    return 1 if failed else 0


def announce(args: argparse.Namespace) -> None:
    """Say what is going to be played, before anything of it can be seen."""
    parts = [f"{args.task}: keepers {args.keeper_policy}, takers {args.taker_policy}"]
    parts += [f"{name} by {command}" for name, command in args.agent.items()]
    parts += [f"waits for {', '.join(args.elsewhere)} to be started elsewhere"] * bool(
        args.elsewhere
    )
    parts += [f"records to {args.record}"] if args.record else []
    print("; ".join(parts), flush=True)


def seat_agents(args: argparse.Namespace, task: Task) -> None:
    """Let `args.agent` say of every player that is not ours by which command it is started.

    Raises:
        MatchError: without a command, of a player whom the match has not, or in one process with
            ours.
    """
    single = dict(each.partition("=")[::2] for each in args.agent)
    for name in (*single, *args.elsewhere):
        if name not in task.player_names:
            raise MatchError(
                f"{name!r} does not play: {task.name} has {', '.join(task.player_names)}"
            )
        if not single.get(name, "elsewhere").strip():
            raise MatchError(f"--agent {name}: give NAME=COMMAND")
    teams = {
        name: getattr(args, f"{task.role(p).name.lower()}_agent")
        for p, name in enumerate(task.player_names)
    }
    args.agent = {name: command for name, command in (teams | single).items() if command}
    if (args.agent or args.elsewhere) and args.single_process:
        raise MatchError("--single-process plays with our own players only")


def members(args: argparse.Namespace, task: Task) -> list[Member]:
    """Every node of the match and how it is started."""
    settings = {name: vars(args)[name] for name in ("match_id", *MATCH_OPTIONS, *WORLD_OPTIONS)}
    players = {
        name: player_settings(args, name, task.role(p)) for p, name in enumerate(task.player_names)
    }
    agents = {
        name: {"policy": "agent", "command": args.agent[name]}
        if name in args.agent
        else {"policy": player["policy"]}
        for name, player in players.items()
    }
    info = {"command": shlex.join(sys.argv), "agents": json.dumps(agents, allow_nan=False)}
    settings["record_info"] = named_texts(info)
    settings["record_attachments"] = named_texts(weights_at_start(players))
    kinds = {"simulator": "simulator"} | {
        name: task.role(p).name.lower() for p, name in enumerate(task.player_names)
    }
    team = []
    for name in [name for name in kinds if name not in args.elsewhere]:
        start, arguments = program(args, name, kinds[name]), players.get(name, settings)
        made = arguments_of(name, args, arguments)
        team.append(Member(name, kinds[name], start, made, name not in args.agent))
    return team


def player_settings(args: argparse.Namespace, name: str, role: TaskRole) -> dict[str, object]:
    """The parameters of a player's node."""
    policy = getattr(args, f"{role.name.lower()}_policy")
    settings: dict[str, object] = {
        "policy": policy,
        "resume": args.resume,
        "match_id": args.match_id,
    }
    if policy in ("learn", "greedy") and args.load_weights:
        given = args.load_weights.absolute()
        settings["load_weights"] = str(given / f"{name}.npz" if given.is_dir() else given)
    if policy == "learn" and args.save_weights:
        settings["save_weights"] = str(args.save_weights.absolute() / f"{name}.npz")
        settings["save_every"] = args.save_every
    return settings


def weights_at_start(players: dict[str, dict[str, object]]) -> dict[str, str]:
    """The weights files that players begin with; a bag gets copies of them."""
    files = {}
    for name, settings in players.items():
        own = Path(str(settings.get("save_weights", "")))
        resumes = settings["resume"] and own.is_file()
        start = own if resumes else settings.get("load_weights")
        if start:
            files[f"{name}.npz"] = str(start)
    return files


def weights_so_far(args: argparse.Namespace) -> dict[str, str]:
    """The same for a match that continues: what learners have saved last counts."""
    task = Task.parse(args.task, args.field)
    players = {
        name: {**player_settings(args, name, task.role(p)), "resume": True}
        for p, name in enumerate(task.player_names)
    }
    return weights_at_start(players)


def arguments_of(name: str, args: argparse.Namespace, settings: dict[str, object]) -> list[str]:
    """A node's name, namespace and parameters, as ROS arguments."""
    clock = {"/clock": f"{args.namespace}/clock"} if args.namespace else {}
    made = ros_arguments(settings, name, args.namespace, clock)
    return [*made, *log_level(args)[1:]]


def log_level(args: argparse.Namespace) -> list[str]:
    """What the nodes tell of themselves, as ROS arguments."""
    return ["--ros-args", "--log-level", "info" if args.verbose else "warn"]


def check_files(args: argparse.Namespace) -> None:
    """Refuse to write over what is there, before anything is started."""
    if args.record and Path(args.record).exists():
        raise MatchError(f"--record {args.record} is there already: name another folder")
    if args.save_weights and not args.resume and list(args.save_weights.glob("*.npz")):
        raise MatchError(
            f"--save-weights {args.save_weights} has weights already: name another folder, or"
            " --resume to continue from them"
        )


def begin_ros(args: argparse.Namespace) -> tuple[Scoreboard, Executor]:
    """The node of this process, and what spins it."""
    rclpy.init(args=log_level(args), signal_handler_options=SignalHandlerOptions.NO)
    board = Scoreboard(args.episodes, args.match_id, namespace=args.namespace)
    executor = EventsExecutor()
    executor.add_node(board)
    return board, executor


def play_in_one_process(
    args: argparse.Namespace, team: list[Member], signals: list[int]
) -> tuple[Scoreboard, list[str]]:
    """All nodes here, taking turns; nobody fails alone."""
    board, executor = begin_ros(args)
    options = [{"cli_args": each.arguments, "use_global_arguments": False} for each in team]
    referee = Simulator(**options[0])
    players = [
        PlayerNode(Role[each.kind.upper()], **option)
        for each, option in zip(team[1:], options[1:], strict=True)
    ]
    for node in (referee, *players):
        executor.add_node(node)

    def spin(timeout: float) -> None:
        executor.spin_once(timeout)
        board.show()

    try:
        referee.play(spin, lambda: bool(signals))
    finally:
        referee.close()
        for player in players:
            player.save()
    return board, []


def play_in_processes(
    args: argparse.Namespace, team: list[Member], signals: list[int]
) -> tuple[Scoreboard, list[str]]:
    """Every node its own process; ends when the simulator's does. Players that failed are named."""
    failed = []
    with Processes(os.environ) as processes:
        commands = {each.name: [*each.program, *each.arguments] for each in team}
        is_counted = start(team, processes)
        board, executor = begin_ros(args)
        is_counted.set()
        until = time.monotonic() + COMPILE_TIMEOUT
        is_found = False
        while not signals and "simulator" in processes.names:
            executor.spin_once(0.1)
            board.show()
            for name, code in processes.ended():
                judge_end(name, code, board, args.restart)
                failed += [name] * (code > 0)
                if args.restart and code < 0:
                    hear_all(executor)
                    processes.start(name, [*commands[name], *going_on(args, name, board)])
            if board.figures and not is_found:
                is_found, until = True, time.monotonic() + START_TIMEOUT
            if not board.has_begun and time.monotonic() > until:
                raise MatchError(f"nothing has begun for too long: {board.state}")
        processes.stop(["simulator"], END_TIMEOUT)
        for name in processes.stop(processes.names, END_TIMEOUT):
            print(f"match: {name} did not end and was killed", file=sys.stderr)
    hear_all(executor)
    return board, failed


def start(team: list[Member], processes: Processes) -> Event:
    """Start all nodes; the simulator waits for the event, that its episodes are counted here.

    Ours are split off this process before it uses ROS, as all of them would import and load the
    same again, which takes longer than all else at a match's start.
    """
    load_for_match()
    is_counted = multiprocessing.get_context("fork").Event()
    for each in team:
        command = [*each.program, *each.arguments]
        if each.is_ours:
            processes.split_off(each.name, command, partial(run_member, each, is_counted))
        else:
            processes.start(each.name, command)
    return is_counted


def run_member(member: Member, is_counted: Event) -> None:
    """Run a node of ours in this process until it ends."""
    if member.kind == "simulator":
        is_counted.wait()
    MAINS[member.kind](member.arguments)


def hear_all(executor: Executor) -> None:
    """Take in what has been published."""
    for _ in range(MOST_UNHEARD):
        executor.spin_once(0.0)


def judge_end(name: str, code: int, board: Scoreboard, restart: bool) -> None:
    """A process has ended by itself: is it the end of the match, an accident, or a failure?"""
    is_simulator, was_killed = name == "simulator", code < 0
    if is_simulator and not code:
        return
    if not board.has_begun:
        raise MatchError(f"{name} did not join: its process ended with code {code}")
    if is_simulator and not (restart and was_killed):
        raise MatchError(f"the simulator ended with code {code}")
    print(f"match: {name} ended with code {code}; the match continues without it", file=sys.stderr)


def going_on(args: argparse.Namespace, name: str, board: Scoreboard) -> list[str]:
    """The parameters with which a node that was killed resumes where it was.

    A simulator resumes its own match beside any other: players know it by its id.
    """
    if name != "simulator":
        return ["-p", "resume:=true"]
    changed = {
        "first_episode": board.next_episode,
        "force": True,
        "record": free_folder(args.record),
        "record_attachments": named_texts(weights_so_far(args)),
    }
    pairs = (f"{name}:={json.dumps(value, allow_nan=False)}" for name, value in changed.items())
    return [word for pair in pairs for word in ("-p", pair)]


def free_folder(record: str) -> str:
    """A bag's folder that is not there yet, named after another: out/bag_2, out/bag_3."""
    numbered = (f"{record}_{number}" for number in itertools.count(2))
    return next(folder for folder in numbered if not Path(folder).exists()) if record else ""


def program(args: argparse.Namespace, name: str, kind: str) -> list[str]:
    """The command that starts a node, without arguments."""
    if name not in args.agent:
        return [sys.executable, str(SCRIPTS / f"{kind}.py")]
    return script_command(shlex.split(args.agent[name]))


def report(args: argparse.Namespace, summary: dict[str, object]) -> None:
    """Say how it went; without an error where a player learns, as a match is one trial."""
    if "learn" in (args.keeper_policy, args.taker_policy):
        summary = {**summary, "sem_duration_s": None}
    mean, sem = (summary[f"{name}_duration_s"] for name in ("mean", "sem"))
    if mean is not None:
        unknown = ", if no player learns" if args.agent else ""
        spread = "" if sem is None else f" +- {sem:.2f} (standard error{unknown})"
        print(f"{args.task}: {summary['episodes']} episodes, held {mean:.2f}{spread} s on average")
    if args.record and Path(args.record).is_dir():
        print(f"recorded in {args.record}: scripts/view.py {args.record} shows it")
    if args.save_weights and args.save_weights.is_dir():
        print(f"what was learned is in {args.save_weights}")
    if args.json:
        print(json.dumps({"task": args.task, "seed": args.seed, **summary}, allow_nan=False))


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add_options(parser, MatchSettings, only=MATCH_OPTIONS, with_defaults=True)
    add_options(parser, Config, only=WORLD_OPTIONS, with_defaults=True)
    add("--keeper-policy", choices=list(KEEPER_POLICIES), default="hand")
    add("--taker-policy", choices=list(TAKER_POLICIES), default="hand")
    add("--save-weights", type=Path, metavar="DIR", help="where learners write NAME.npz")
    add("--save-every", type=int, default=100, help="and how often, in episodes (default 100)")
    add("--load-weights", type=Path, metavar="PATH", help="file, or DIR with NAME.npz")
    add("--resume", action="store_true", help="resume from the weights in --save-weights")
    add("--restart", action="store_true", help="start nodes that were killed again where they were")
    add("--keeper-agent", metavar="COMMAND", help="started for each keeper instead of ours")
    add("--taker-agent", metavar="COMMAND", help="started for each taker instead of ours")
    add("--agent", action="append", default=[], metavar="NAME=COMMAND", help="for one player")
    add("--elsewhere", action="append", default=[], metavar="NAME", help="started by others")
    add("--single-process", action="store_true", help="all nodes in this process: quicker")
    add("--namespace", default="", help="of all nodes and topics, like /match_2")
    add("--domain", type=int, help="ROS domain (default: that of the environment)")
    add("--verbose", action="store_true", help="show what the nodes log")
    add("--json", action="store_true", help="end with one JSON object")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
