"""Measure speeds, all in one run, because ratios outlive the machine they were measured on.

    .venv/bin/python scripts/checks/benchmark.py
    .venv/bin/python scripts/checks/benchmark.py --only world --json
    .venv/bin/python scripts/checks/benchmark.py --runs 3 --write     # the performance page

In process, on one core, in CPU time: the bare pymunk floor (write, step and read the bodies of as
many fields), the World without and with learning, environments, two processes against one. In wall
time: compiling, the start of a match, a study; over ROS a bare ping-pong of a match's messages
between as many processes, and matches.
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
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pymunk
import pymunk.batch
from benchmark_ros import first_cycle, measure_ros
from performance_page import keep
from trainer_speed import play

from keepaway_sim.version import code_version

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent
PARTS = ("world", "vector", "processes", "starts", "study", "ros")
ONCE = ("processes", "study")  # of several runs only the first measures these
STUDY_TRIALS, STUDY_HOURS = 64, 0.5


def main() -> int:
    """Measure what was asked for and print a table or JSON objects, or write the page."""
    args = parse()
    parts, runs = args.only or list(PARTS), []
    for number in range(args.runs):
        chosen = [part for part in parts if number == 0 or part not in ONCE]
        runs.append(figures := measure(args, chosen))
        print(
            json.dumps({k: round(v, 3) for k, v in figures.items()}, allow_nan=False)
            if args.json
            else table(figures),
            flush=True,
        )
    if args.write:
        keep(runs, "scripts/checks/benchmark.py " + " ".join(sys.argv[1:]), code_version())
    return 0


def measure(args: argparse.Namespace, parts: list[str]) -> dict[str, float]:
    """One run of some parts."""
    figures: dict[str, float] = {}
    measures: dict[str, Callable[[argparse.Namespace], dict[str, float]]] = {
        "world": measure_world,
        "vector": measure_vector,
        "processes": measure_processes,
        "starts": measure_starts,
        "study": measure_study,
        "ros": measure_ros,
    }
    for part in parts:
        if not args.json:
            print(f"measures {part} ..", flush=True)
        figures |= measures[part](args)
    if "world" in parts:
        figures["peak_rss_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return figures


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", action="append", choices=PARTS, help="one part (repeatable)")
    parser.add_argument("--fields", type=int, default=128, help="side by side (default 128)")
    parser.add_argument("--cycles", type=int, default=2000, help="of a measurement (default 2000)")
    parser.add_argument("--episodes", type=int, default=60, help="of a match (default 60)")
    parser.add_argument("--runs", type=int, default=1, help="of all of it (default 1)")
    parser.add_argument("--json", action="store_true", help="print a JSON object for each run")
    parser.add_argument("--write", action="store_true", help="write the performance page")
    args = parser.parse_args()
    if args.only and args.write:
        parser.error("--write needs all parts: the page holds all figures of one run")
    return args


def table(figures: dict[str, float]) -> str:
    """All figures, those per field-cycle also as multiples of the floor."""
    floor = figures.get("floor_us")
    lines = [f"{'figure':22s} {'value':>10s}  ratio"]
    for name, value in figures.items():
        ratio = f"{value / floor:5.1f} x floor" if floor and name.endswith("_us") else ""
        if name.startswith("ros_") and name != "ros_floor_cps":
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
    whole, played = play(trainer, "learn", num_fields, cycles, begin=spent.clear)
    spent["rest"] = whole - sum(spent.values())
    return {f"{task}_{phase}_us": time * 1e6 / played for phase, time in spent.items()}


def measure_vector(args: argparse.Namespace) -> dict[str, float]:
    """Cycles a CPU second of a vector environment beside the trainer's, in turns."""
    from environment_speed import measure as in_turns
    from environment_speed import trainer, vector

    plays = {
        "trainer": lambda: trainer(args.fields),
        "vector": lambda: vector(args.fields, "all"),
    }
    speeds = in_turns(plays, cycles=args.cycles // 4, rounds=5)
    return {"vector_share": speeds["vector"] / speeds["trainer"]}


def measure_starts(args: argparse.Namespace) -> dict[str, float]:
    """Seconds to the end of a first short training, machine code on disk or not; to a match."""
    code = (
        "import time; start = time.monotonic()\n"
        "from keepaway_agent.training.trainer import Trainer\n"
        "from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, trial_seed\n"
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
    return {**figures, "first_cycle_s": first_cycle()}


def measure_study(_: argparse.Namespace) -> dict[str, float]:
    """Hours of play a minute of a row of a study, by one worker, its start included."""
    settings = {
        "name": "benchmark",
        "target": "4v3",
        "threshold": 99.0,
        "window": 1000,
        "trials": STUDY_TRIALS,
        "max_hours": STUDY_HOURS,
        "greedy_episodes": 0,
        "seed": 1,
        "references": ["scratch"],
    }
    lines = [f"{name} = {json.dumps(value, allow_nan=False)}" for name, value in settings.items()]
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "benchmark.toml"
        study.write_text("\n".join([*lines, 'rows = [{ name = "scratch" }]']))
        command = [sys.executable, str(SCRIPTS / "study.py"), str(study)]
        start = time.monotonic()
        subprocess.run(
            [*command, "--workers", "1", "--out", str(Path(folder) / "out")],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=True,
        )
        minutes = (time.monotonic() - start) / 60.0
    return {"study_hours_a_minute": STUDY_TRIALS * STUDY_HOURS / minutes}


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


if __name__ == "__main__":
    sys.exit(main())
