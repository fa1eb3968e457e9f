"""Does an agent keep to the contract? Start it, talk to it from a script, judge its answers.

    .venv/bin/python scripts/check_agent.py -- quick_keeper.py
    .venv/bin/python scripts/check_agent.py --name taker_2 -- ./my_agent --brave

The command is started as a match starts it: with the player's name among ROS's arguments. Every
sentence of src/keepaway_agent/docs/agent_contract.md that holds is listed, and every one that does
not. Ends with code 0 if all hold, else with 1.
"""

import argparse
import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import domain_coordinator
import rclpy
from rclpy.experimental import EventsExecutor

from keepaway_agent.checks.conformance import script
from keepaway_agent.checks.judge import answer_times, judge, report
from keepaway_agent.errors import AgentError
from keepaway_agent.nodes.scripted_simulator import ScriptedSimulator
from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.cli.processes import Processes, script_command
from keepaway_sim.ros.running import end_ros

AGENT = "agent"


def main() -> int:
    """Test it, and say what was found."""
    args = parse()
    with own_domain(args.domain) as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        try:
            return check(args)
        finally:
            end_ros()


@contextmanager
def own_domain(asked: int | None) -> Iterator[int]:
    """The domain that was asked for, here or in the environment, or one that no other check has."""
    given = os.environ.get("ROS_DOMAIN_ID", "") if asked is None else str(asked)
    if given.isdecimal():
        yield int(given)
    else:
        with domain_coordinator.domain_id() as domain:
            yield domain


def check(args: argparse.Namespace) -> int:
    """Test it in the domain of the environment."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    rclpy.init(args=[])
    executor = EventsExecutor()
    simulator = ScriptedSimulator(args.name)
    executor.add_node(simulator)
    try:
        with Processes(os.environ) as processes:
            steps = script(args.name, args.seed, args.one_size)
            command = script_command(args.command)
            processes.start(AGENT, [*command, *ros_arguments({}, args.name)])
            simulator.perform(
                steps,
                lambda timeout: executor.spin_once(timeout),
                lambda: processes.is_running(AGENT),
                args.answer_timeout,
            )
            is_there = processes.is_running(AGENT)
            code = processes.end(AGENT, args.end_timeout)
    except (AgentError, OSError) as error:
        print(f"check_agent: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    if not is_there:
        answers = sum(each.answer_time is not None for each in simulator.log)
        print(
            f"the agent ended by itself after {answers} answers, with code {code}: mend that first,"
            " most of what fails below follows from it"
        )
    verdicts = judge(simulator.log, args.name, code)
    times = answer_times(simulator.log)
    print(report(verdicts, times))
    if args.json:
        print(
            json.dumps(
                {"verdicts": [v._asdict() for v in verdicts], "answer_times_s": times},
                allow_nan=False,
            )
        )
    return 0 if all(verdict.holds for verdict in verdicts) else 1


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("command", nargs="+", help="that starts the agent; a .py file is run by this Python")
    add("--name", default="keeper_1", help="of the player it has to be (default keeper_1)")
    add("--seed", type=int, default=0, help="of the script's random numbers (default 0)")
    add("--one-size", action="store_true", help="no match of another size, for a learner of 3v2")
    add("--answer-timeout", type=float, default=2.0, help="for an answer [s] (default 2)")
    add("--end-timeout", type=float, default=5.0, help="to end after SIGTERM [s] (default 5)")
    add("--domain", type=int, help="ROS domain (default: ROS_DOMAIN_ID, or one that is free)")
    add("--json", action="store_true", help="end with one JSON object")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
