"""Matches recorded for tests: a World played by a simple rule, into a bag."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from keepaway_agent.playing.agent import Agent, AgentConfig, MatchFacts, Perceived
from keepaway_agent.playing.policies import View
from keepaway_agent.settings import build
from keepaway_sim.bags.field_recorder import FieldRecorder, world_info
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.task import Action, Outcome, Task
from keepaway_sim.world.config import CYCLE_TIME, Config, profile
from keepaway_sim.world.state import Belief
from keepaway_sim.world.world import World


def record_match(path: Path, task: str, seed: int, episodes: int) -> Path:
    """Play and record `episodes` episodes; keepers pass round, with made-up action values."""
    world = World(Task.parse(task), Config())
    world.start(0, np.random.SeedSequence(entropy=seed, spawn_key=(0, 0)))
    with BagWriter(path, world_info(world, seed), flush_interval=math.inf) as bag:
        recorder = FieldRecorder(bag, world, 0, seed)
        recorder.moment()
        while world.belief.episode[0] < episodes:
            action, target, values = simple_requests(world.belief, world.task)
            recorder.requests(action, target, values)
            world.step(action[None], target[None])
            if world.belief.episode[0] < episodes:
                recorder.moment()
    return path


def record_agents(
    path: Path, agents: dict[str, dict[str, Any]], seed: int, episodes: int, task: str = "3v2"
) -> Path:
    """Play and record a match of real players in this process; they see 90 degrees.

    Args:
        path: of the bag.
        agents: player's name -> fields of AgentConfig.
        seed, episodes, task: of the match.
    """
    world = World(Task.parse(task), profile(visible_angle_deg=90.0))
    world.start(0, np.random.SeedSequence(seed, spawn_key=(0, 0)))
    teams = world.task.num_keepers, world.task.num_takers
    facts = MatchFacts(*teams, world.task.field_length, world.task.field_width, CYCLE_TIME, seed)
    players = [
        Agent(facts, index, build(AgentConfig, agents.get(name, {})))
        for index, name in enumerate(world.task.player_names)
    ]
    with BagWriter(path, world_info(world, seed, agents=json.dumps(agents))) as bag:
        recorder = FieldRecorder(bag, world, 0, seed)
        recorder.moment()
        while world.belief.episode[0] < episodes:
            decisions = [
                player.perceive(perceived(world.belief, index))
                for index, player in enumerate(players)
            ]
            action = np.array([d.action if d else 0 for d in decisions])
            target = np.array([d.target if d else 0 for d in decisions])
            recorder.requests(action, target, [d.values.tolist() if d else () for d in decisions])
            world.step(action[None], target[None])
            if world.belief.episode[0] < episodes:
                recorder.moment()
    return path


def perceived(seen: Belief, player: int) -> Perceived:
    """What a player of field 0 perceives, as its agent wants it."""
    return Perceived(
        int(seen.episode[0]),
        int(seen.outcome[0]),
        bool(seen.decision_due[0, player]),
        View(
            seen.position[0, player],
            seen.age[0, player],
            seen.cycles_to_ball[0, player],
            bool(seen.ball_kickable[0, player]),
            int(seen.cycle[0]),
        ),
    )


def simple_requests(seen: Belief, task: Task) -> tuple[np.ndarray, np.ndarray, list[list[float]]]:
    """What players of field 0 ask for: with the ball they pass to the next keeper, now and then."""
    num, keepers = task.num_players, task.num_keepers
    action = np.full(num, Action.GO_TO_BALL)
    target = np.zeros(num, dtype=np.int64)
    values: list[list[float]] = [[] for _ in range(num)]
    for player in range(keepers):
        cycles = seen.cycles_to_ball[0, player, :keepers]
        if seen.ball_kickable[0, player]:
            passes = seen.cycle[0] % 8 == 0
            action[player] = Action.PASS_BALL if passes else Action.HOLD_BALL
            target[player] = (player + 1) % keepers if passes else 0
            values[player] = [float(seen.cycle[0] + k) for k in range(keepers)]
        elif cycles.argmin() != player:
            action[player] = Action.GET_OPEN
    return action, target, values


def in_play(world: World) -> bool:
    """Whether field 0's episode is running."""
    return bool(world.belief.outcome[0] == Outcome.IN_PLAY)
