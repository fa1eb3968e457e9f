"""Measure speeds, all in one run, because ratios outlive the machine they were measured on.

    .venv/bin/python scripts/benchmark.py
    .venv/bin/python scripts/benchmark.py --only world --json

In process, on one core, in CPU time: the bare pymunk floor (write, step and read the bodies of as
many fields), the World without and with learning, compiling, two processes against one. Over ROS,
in wall time: a bare ping-pong of a match's messages between as many processes, and matches.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pymunk
import pymunk.batch

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent
PARTS = ("world", "compile", "processes", "ros")
DOMAIN = 93  # of the ROS part, so that it receives no match


def main() -> int:
    """Measure what was asked for and print a table, or one JSON object."""
    args = parse()
    figures: dict[str, float] = {}
    measures: dict[str, Callable[[argparse.Namespace], dict[str, float]]] = {
        "world": measure_world,
        "compile": measure_compile,
        "processes": measure_processes,
        "ros": measure_ros,
    }
    for part in args.only or PARTS:
        if not args.json:
            print(f"measures {part} ..", flush=True)
        figures |= measures[part](args)
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    figures["peak_rss_mb"] = max(own, children) / 1024.0
    print(
        json.dumps({k: round(v, 3) for k, v in figures.items()}, allow_nan=False)
        if args.json
        else table(figures)
    )
    return 0


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", action="append", choices=PARTS, help="one part (repeatable)")
    parser.add_argument("--fields", type=int, default=128, help="side by side (default 128)")
    parser.add_argument("--cycles", type=int, default=2000, help="of a measurement (default 2000)")
    parser.add_argument("--episodes", type=int, default=60, help="of a match (default 60)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return parser.parse_args()


def table(figures: dict[str, float]) -> str:
    """All figures, those per field-cycle also as multiples of the floor."""
    floor = figures.get("floor_us")
    lines = [f"{'figure':22s} {'value':>10s}  ratio"]
    for name, value in figures.items():
        ratio = f"{value / floor:5.1f} x floor" if floor and name.endswith("_us") else ""
        if name in ("ros_match_cps", "ros_recorded_cps", "ros_bag_cps", "ros_single_process_cps"):
            ratio = f"{value / figures['ros_floor_cps']:5.2f} x ros_floor"
        lines.append(f"{name:22s} {value:10.2f}  {ratio}")
    return "\n".join(lines)


# ---------------------------------------------------------------- in process


def measure_world(args: argparse.Namespace) -> dict[str, float]:
    """CPU microseconds per field-cycle: pymunk alone, the World, the World with learners."""
    figures = {"floor_us": floor(args.fields, args.cycles)}
    figures["world_3v2_us"] = trainer_time("3v2", "hand", args.fields, args.cycles)
    for task in ("3v2", "4v3", "5v4"):
        figures[f"learn_{task}_us"] = trainer_time(task, "learn", args.fields, args.cycles)
    for fields in (32, 256):
        figures[f"learn_3v2_{fields}_fields_us"] = trainer_time("3v2", "learn", fields, args.cycles)
    return figures | phases("3v2", args.fields, args.cycles)


def floor(num_fields: int, cycles: int, num_objects: int = 6) -> float:
    """CPU microseconds per field-cycle of bare pymunk: set, step, get of the same bodies."""
    rng = np.random.default_rng(0)
    space = pymunk.Space()
    space.iterations = 1
    space.use_spatial_hash(2.0, 10 * num_fields * num_objects)
    for number in range(num_fields * num_objects):
        body = pymunk.Body(1.0, 1.0)
        space.add(body, pymunk.Circle(body, 0.085 if number % num_objects == 5 else 0.3))
    place = 128.0 * np.stack([np.arange(num_fields) % 16, np.arange(num_fields) // 16], axis=1)
    motion = np.zeros((num_fields, num_objects, 4))
    motion[:, :, :2] = place[:, None] + rng.uniform(-12, 12, (num_fields, num_objects, 2))
    fields = pymunk.batch.BodyFields.POSITION | pymunk.batch.BodyFields.VELOCITY
    given, got = pymunk.batch.Buffer(), pymunk.batch.Buffer()
    given.set_float_buf(motion.data.cast("B"))
    velocity = rng.uniform(-0.5, 0.5, (16, num_fields, num_objects, 2))
    spent = 0.0
    for cycle in range(cycles):
        motion[:, :, 2:] = velocity[cycle % 8] * (1 if cycle % 16 < 8 else -1)
        start = time.process_time()
        pymunk.batch.set_space_bodies(space, fields, given)
        space.step(1.0)
        got.clear()
        pymunk.batch.get_space_bodies(space, pymunk.batch.BodyFields.POSITION, got)
        moved = np.frombuffer(got.float_buf()).reshape(num_fields, num_objects, 2)
        spent += time.process_time() - start
        motion[:, :, :2] = moved
    return spent * 1e6 / cycles / num_fields


def trainer_time(task: str, policy: str, num_fields: int, cycles: int) -> float:
    """CPU microseconds per field-cycle of the trainer, compiled and warmed up before."""
    from keepaway_agent.training.trainer import Trainer
    from keepaway_agent.training.trial import TrainerConfig
    from keepaway_sim.task import Task

    trainer = Trainer(TrainerConfig(Task.parse(task)), num_fields)
    play(trainer, policy, num_fields, 300)
    spent, played = play(trainer, policy, num_fields, cycles)
    return spent * 1e6 / played


def play(trainer: Any, policy: str, num_fields: int, cycles: int) -> tuple[float, int]:
    """CPU seconds and field-cycles of a trial on every field."""
    from keepaway_agent.training.trial import StopRule, Trial, trial_seed

    trials = (
        Trial(trial_seed(1, k), StopRule(max_cycles=cycles), policy) for k in range(num_fields)
    )
    start = time.process_time()
    played = sum(int(result.durations.sum()) for result in trainer.run(trials))
    return time.process_time() - start, played


def phases(task: str, num_fields: int, cycles: int) -> dict[str, float]:
    """Where learning's CPU microseconds go, per field-cycle: the parts of a cycle, and the rest."""
    from keepaway_agent.training.trainer import Trainer
    from keepaway_agent.training.trial import TrainerConfig
    from keepaway_sim.task import Task

    trainer = Trainer(TrainerConfig(Task.parse(task)), num_fields)
    world = trainer._world
    spent: defaultdict[str, float] = defaultdict(float)

    def watch(owner: Any, function: str, phase: str) -> None:
        unwatched = getattr(owner, function)

        def watched(*arguments: Any) -> Any:
            start = time.process_time()
            result = unwatched(*arguments)
            spent[phase] += time.process_time() - start
            return result

        setattr(owner, function, watched)

    watch(world, "_act", "commands")
    watch(world._bodies, "move", "pymunk")
    watch(world, "_settle", "perception")
    watch(trainer, "_decide_all", "decisions")
    watch(world._streams, "refill", "random")
    watch(trainer._streams, "refill", "random")
    play(trainer, "learn", num_fields, 300)
    spent.clear()
    whole, played = play(trainer, "learn", num_fields, cycles)
    spent["rest"] = whole - sum(spent.values())
    return {f"{task}_{phase}_us": time * 1e6 / played for phase, time in spent.items()}


def measure_compile(_: argparse.Namespace) -> dict[str, float]:
    """Seconds until a first short training has finished, machine code cached or not."""
    command = [sys.executable, __file__, "--only", "world", "--cycles", "10", "--json"]
    code = (
        "import time; start = time.monotonic()\n"
        "from keepaway_agent.training.trainer import *\n"
        "trainer = Trainer(TrainerConfig(), 1)\n"
        "list(trainer.run([Trial(trial_seed(0, 0), StopRule(max_episodes=1))]))\n"
        "print(time.monotonic() - start)"
    )
    figures = {}
    with tempfile.TemporaryDirectory() as cache:
        env = os.environ | {"NUMBA_CACHE_DIR": cache}
        for name in ("compile_cold_s", "compile_warm_s"):
            command = [sys.executable, "-c", code]
            done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
            figures[name] = float(done.stdout)
    return figures


def measure_processes(args: argparse.Namespace) -> dict[str, float]:
    """Rate of two processes together over that of one alone, in wall time."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import time, benchmark\n"
        "benchmark.trainer_time('3v2', 'learn', 128, 100); input()\n"
        "start = time.monotonic(); benchmark.trainer_time('3v2', 'learn', 128, int(sys.argv[2]))\n"
        "print(time.monotonic() - start)"
    )

    def wall(processes: int) -> float:
        command = [sys.executable, "-c", code, str(HERE), str(args.cycles)]
        running = [
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            for _ in range(processes)
        ]
        time.sleep(15.0)  # all are warm and wait
        for process in running:
            assert process.stdin
            process.stdin.write("go\n")
            process.stdin.flush()
        return max(float(process.communicate()[0]) for process in running)

    alone = [wall(1)]
    together = wall(2)
    alone.append(wall(1))
    return {"two_process_speedup": 2.0 * float(np.mean(alone)) / together}


# ---------------------------------------------------------------- over ROS


def measure_ros(args: argparse.Namespace) -> dict[str, float]:
    """Cycles a second (wall time) of a ping-pong of a match's messages, and of matches."""
    os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
    figures = {"ros_floor_cps": ping_pong(num_players=5, cycles=3000)}
    with tempfile.TemporaryDirectory() as folder:
        recorder = [sys.executable, str(SCRIPTS / "record.py"), str(Path(folder) / "recorded")]
        figures["ros_match_cps"] = match(args.episodes)
        figures["ros_bag_cps"] = match(args.episodes, "--record", str(Path(folder) / "bag"))
        beside = subprocess.Popen(recorder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            figures["ros_recorded_cps"] = match(args.episodes)
        finally:
            beside.terminate()
            beside.wait(60)
        figures["ros_single_process_cps"] = match(args.episodes, "--single-process")
    return figures


def match(episodes: int, *options: str) -> float:
    """Cycles a second of a lock-step match of learning keepers."""
    command = [sys.executable, str(SCRIPTS / "match.py"), "--task", "3v2", "--episodes"]
    command += [str(episodes), "--keeper-policy", "learn", "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(json.loads(done.stdout.splitlines()[-1])["cycles_per_second"])


def ping_pong(num_players: int, cycles: int) -> float:
    """Perceptions to as many processes, an answer from each, by the fastest sound method."""
    import rclpy
    from rclpy.experimental import EventsExecutor

    from keepaway_msgs.msg import ActionRequest, Perception

    echo = f"import sys; sys.path.insert(0, {str(HERE)!r}); import benchmark; benchmark.echo("
    players = [subprocess.Popen([sys.executable, "-c", f"{echo}{p})"]) for p in range(num_players)]
    rclpy.init()
    node = rclpy.create_node("ping", enable_rosout=False, start_parameter_services=False)
    executor = EventsExecutor()
    executor.add_node(node)
    answered: set[int] = set()

    def take(answer: ActionRequest) -> None:
        answered.add(answer.player_index)

    pings = [node.create_publisher(Perception, f"bench_{p}/ping", 10) for p in range(num_players)]
    for p in range(num_players):
        node.create_subscription(ActionRequest, f"bench_{p}/pong", take, 10)
    message = perception(num_players)
    try:
        for cycle in range(-100, cycles):
            if cycle == 0:
                start = time.perf_counter()
            answered.clear()
            message.cycle = cycle + 100
            missing: Iterable[int] = range(num_players)
            while missing:
                for p in missing:
                    pings[p].publish(message)
                until = time.perf_counter() + 0.5
                while len(answered) < num_players and time.perf_counter() < until:
                    executor.spin_once(timeout_sec=0.5)
                missing = [p for p in range(num_players) if p not in answered]
        return cycles / (time.perf_counter() - start)
    finally:
        for player in players:
            player.terminate()
            player.wait(30)
        node.destroy_node()
        rclpy.shutdown()


def perception(num_players: int):  # type: ignore[no-untyped-def]
    """A perception as long as a match's."""
    from keepaway_msgs.msg import Perception

    message = Perception()
    message.positions = [1.0] * (2 * num_players + 2)
    message.velocities = [0.1] * (2 * num_players + 2)
    message.ages = [1] * (num_players + 1)
    message.cycles_to_ball = [9] * num_players
    return message


def echo(player: int) -> None:
    """Answer every perception at once; the process of one player of `ping_pong`."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.experimental import EventsExecutor

    from keepaway_msgs.msg import ActionRequest, Perception

    rclpy.init()
    node = rclpy.create_node(f"pong_{player}", enable_rosout=False, start_parameter_services=False)
    executor = EventsExecutor()
    executor.add_node(node)
    answer = ActionRequest(player_index=player, action_values=[0.0, 0.0, 0.0])
    publisher = node.create_publisher(ActionRequest, f"bench_{player}/pong", 10)

    def reply(message: Perception) -> None:
        answer.cycle = message.cycle
        publisher.publish(answer)

    node.create_subscription(Perception, f"bench_{player}/ping", reply, 10)
    try:
        while rclpy.ok():
            executor.spin_once(timeout_sec=1.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    sys.exit(main())
