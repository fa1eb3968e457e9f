"""A whole ROS graph in the test's own process: real nodes, real DDS, one executor."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from keepaway_agent.actions import Role
from keepaway_agent.learning.weights import LearnedWeights
from keepaway_agent.nodes.player import PlayerNode
from keepaway_agent.playing.agent import Agent, AgentConfig, MatchFacts
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, TrialResult, trial_seed
from keepaway_msgs.msg import Episode
from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.nodes.simulator import Simulator
from keepaway_sim.ros.publishing import ALL
from keepaway_sim.task import Task

PATIENCE = 900.0  # [s] for anything to happen; it is here to end a test, not to judge it

Played = list[tuple[int, int]]
"""Cycles and outcome of every episode."""


class Graph:
    """Nodes of one domain; everything happens in `spin`."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.executor = EventsExecutor(context=self.context)
        self.hook: Callable[[], None] = lambda: None
        self.simulator: Simulator
        self.players: dict[str, PlayerNode] = {}
        self.episodes: list[Episode] = []
        self.node = self.add(Node("spectator", context=self.context))
        self.node.create_subscription(Episode, "episode", self.episodes.append, ALL)

    def add(self, node: Any) -> Any:
        self.executor.add_node(node)
        return node

    def start_simulator(self, **parameters: object) -> Simulator:
        arguments = ros_arguments(parameters, "simulator")
        self.simulator = self.add(
            Simulator(context=self.context, cli_args=arguments, use_global_arguments=False)
        )
        return self.simulator

    def start_player(self, name: str, **parameters: object) -> PlayerNode:
        arguments = ros_arguments(parameters, name)
        player = PlayerNode(
            Role[name.partition("_")[0].upper()],
            context=self.context,
            cli_args=arguments,
            use_global_arguments=False,
        )
        self.players[name] = self.add(player)
        return player

    def start_players(self, task: str = "3v2", **keeper_parameters: object) -> None:
        for name in Task.parse(task).player_names:
            self.start_player(name, **(keeper_parameters if name.startswith("keeper") else {}))

    def spin(self, timeout: float) -> None:
        self.executor.spin_once(timeout)
        self.hook()

    def play(self, until: Callable[[], bool] = lambda: False) -> Played:
        """Play until all episodes are over, or `until` says so."""
        give_up = time.monotonic() + PATIENCE
        self.simulator.play(self.spin, lambda: until() or time.monotonic() > give_up)
        assert time.monotonic() < give_up, "the match did not end"
        self.spin_until(lambda: len(self.episodes) >= self.simulator.conductor.num_finished)
        return [(episode.cycles, episode.outcome) for episode in self.episodes]

    def spin_until(self, is_done: Callable[[], bool]) -> None:
        give_up = time.monotonic() + PATIENCE
        while not is_done():
            assert time.monotonic() < give_up, "it never happened"
            self.executor.spin_once(0.05)

    def call(self, service: type[Any], name: str, **request: object) -> Any:
        """Call a service from outside of the match."""
        client = self.node.create_client(service, name)
        self.spin_until(client.service_is_ready)
        future = client.call_async(service.Request(**request))
        self.spin_until(future.done)
        self.node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        if hasattr(self, "simulator"):
            self.simulator.close()
        nodes = list(self.executor.get_nodes())
        self.executor.shutdown()  # what it still holds would not be destroyed
        for node in nodes:
            node.destroy_node()
        self.context.shutdown()


def trained(episodes: int, seed: int = 0, policy: str = "hand", task: str = "3v2") -> TrialResult:
    """The same match played by the trainer."""
    trial = Trial(trial_seed(seed, 0), StopRule(max_episodes=episodes), keeper_policy=policy)
    return next(Trainer(TrainerConfig(Task.parse(task)), num_fields=1).run([trial]))


def played(trial: TrialResult) -> Played:
    return list(zip(trial.durations.tolist(), trial.outcomes.tolist(), strict=True))


def weights_of(num_keepers: int = 3, num_takers: int = 2) -> LearnedWeights:
    """Random weights of a keeper."""
    facts = MatchFacts(num_keepers, num_takers, 25.0, 25.0, 0.1, seed=1)
    agent = Agent(facts, 0, AgentConfig(policy="learn"))
    agent.learners.weights[:] = np.random.default_rng(2).normal(size=agent.learners.weights.shape)
    agent.episodes, agent.hours = 100, 0.5
    return agent.learned("keeper_1")
