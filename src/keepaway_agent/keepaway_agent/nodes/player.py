"""The node of one player, keeper or taker: wiring around `agent.Agent`.

The node's name is the player's name, "keeper_1"; its topics and services begin with it. It learns
from the latched `match` what is played, reports on its `status` that it is ready until the first
perception comes, and answers perceptions.
"""

import gc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import attrs
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.errors import AgentError, WeightsError
from keepaway_agent.files import path_within
from keepaway_agent.learning.weights import LearnedWeights, load_weights, save_weights
from keepaway_agent.nodes import conversions
from keepaway_agent.nodes.parameters import declare_settings, warn_of_unknown
from keepaway_agent.nodes.qos import ANSWERS, MATCHES_KEPT, PERCEPTIONS, STATUSES
from keepaway_agent.nodes.running import run_node
from keepaway_agent.playing.agent import Agent, AgentConfig, Perceived, WeightsFiles, check_config
from keepaway_agent.settings import setting
from keepaway_agent.version import code_version
from keepaway_msgs.msg import ActionRequest, AgentStatus, Match, Perception
from keepaway_msgs.srv import LoadWeights, SaveWeights

ANNOUNCEMENT_PERIOD = (
    0.5  # [s] a first message may be lost although the nodes have found each other
)
PATIENCE = 0.25  # [s] at most, from the signal to the end
LOG_PERIOD = 5.0  # [s] the same complaint is not made more often


@attrs.frozen
class PlayerSettings:
    """A player's parameters as a process among others."""

    match_id: int = setting(
        0, "the number of the only match that it joins; 0: the first one", "", f"[0, {2**63 - 1}]"
    )
    weights_dir: str = setting(
        ".", "folder in which its services may read and write weights, and nowhere else"
    )


SETTINGS = (AgentConfig, WeightsFiles, PlayerSettings)
"""All of a player's parameters."""


class PlayerNode(Node):
    """One player of a match, alive before and after it.

    Attributes:
        agent: the player in the match that is on; None until there is one.
    """

    def __init__(self, role: Role, **node_options: Any) -> None:
        """Wait for a match.

        Args:
            role: its team.
            node_options: for `rclpy.node.Node`.

        Raises:
            AgentError: parameters that make no player, or weights that cannot be read.
        """
        super().__init__(f"{role.name.lower()}_1", **node_options)
        self.agent: Agent | None = None
        self._role = role
        self._match_id, self._other_match = 0, Match()
        self._config = declare_settings(self, AgentConfig)
        check_config(role, self._config)
        files = declare_settings(self, WeightsFiles)
        self._settings = declare_settings(self, PlayerSettings)
        warn_of_unknown(self, SETTINGS)
        self._save_every = files.save_every
        self._weights_path = Path(files.save_weights).absolute() if files.save_weights else None
        self._start_weights = self._weights_to_start_from(files)
        name = self.get_name()
        self._requests = self.create_publisher(ActionRequest, f"{name}/action_request", ANSWERS)
        self._status = self.create_publisher(AgentStatus, f"{name}/status", STATUSES)
        self.create_subscription(Match, "match", self._on_match, MATCHES_KEPT)
        self.create_subscription(
            Perception, f"{name}/perception", self._on_perception, PERCEPTIONS, raw=True
        )
        self.create_service(SaveWeights, f"{name}/save_weights", self._on_save)
        self.create_service(LoadWeights, f"{name}/load_weights", self._on_load)
        self._is_announcing = True
        self._announcement = self.create_timer(ANNOUNCEMENT_PERIOD, self._announce)
        self._reconsidering = self.create_timer(ANNOUNCEMENT_PERIOD, self._reconsider)
        self._reconsidering.cancel()  # until there is another match

    def save(self) -> None:
        """Write what it has learned, to the file of the parameter `save_weights`, if it is set.

        Raises:
            WeightsError: the file cannot be written.
        """
        if self.agent and self._weights_path:
            save_weights(self._weights_path, self._learned(), overwrite=True)

    def _learned(self) -> LearnedWeights:
        if self.agent is None:
            raise AgentError("no match yet, so nothing has been learned")
        return self.agent.learned(self.get_name())

    def _weights_to_start_from(self, files: WeightsFiles) -> LearnedWeights | None:
        """Its own saved ones to resume from, or others, or none."""
        own = self._weights_path
        if own is None or not own.exists():
            if own and files.resume:
                self.get_logger().warning(f"resume: there is no {own} to resume from")
            return load_weights(Path(files.load_weights)) if files.load_weights else None
        if not files.resume:
            raise AgentError(f"save_weights={own}: exists already; resume:=true resumes from it")
        return load_weights(own)

    def _on_match(self, match: Match) -> None:
        """Join a new match, but no other one while its own match's simulator publishes."""
        wanted = self._settings.match_id
        is_another = self._match_id not in (0, match.match_id)
        if wanted and match.match_id != wanted:
            self.get_logger().warning(
                f"another simulator publishes `match` here ({match.task}, number"
                f" {match.match_id}): ignored, match_id is {wanted}"
            )
        elif is_another and self.count_publishers("match") > 1:
            self._other_match = match
            self._reconsidering.reset()
            self.get_logger().warning(
                f"another simulator publishes `match` here ({match.task}, number"
                f" {match.match_id}): ignored while that of match {self._match_id} is there"
            )
        else:
            self._join(match)

    def _reconsider(self) -> None:
        """Join the other match once only its simulator is left."""
        if self.count_publishers("match") < 2:
            self._reconsidering.cancel()
            self._join(self._other_match)

    def _join(self, match: Match) -> None:
        """Take the own place in a match, with what was learned before."""
        name = self.get_name()
        if name not in match.player_names:
            self.get_logger().error(
                f"no place for {name} in a match of {', '.join(match.player_names)}"
            )
            return
        try:
            facts, index = conversions.match_facts(match), match.player_names.index(name)
            agent = Agent(facts, index, self._config)
        except KeyboardInterrupt:  # it was asked to end while it compiled; whoever spins knows
            return
        if agent.role != self._role:
            raise AgentError(f"{name} is a {agent.role.name.lower()}'s name in this match")
        has_learned = self.agent and self.agent.has_learner
        known = self._learned() if has_learned else self._start_weights
        if known:
            agent.use(known)
        elif self._config.policy == "greedy":
            self.get_logger().warning("greedy without load_weights: it will choose at random")
        self.agent, self._match_id = agent, match.match_id
        self.get_logger().info(
            f"plays {match.task} as {self._config.policy}, seed {match.seed}, from episode"
            f" {match.first_episode} on"
        )
        self._announce()

    def _announce(self) -> None:
        agent = self.agent
        self._status.publish(
            AgentStatus(
                player_index=agent.index if agent else 0,
                name=self.get_name(),
                policy=self._config.policy,
                learning=agent.learns if agent else False,
                ready=agent is not None,
                episodes=agent.episodes if agent else 0,
                simulated_hours=agent.hours if agent else 0.0,
                code_version=code_version(),
                match_id=self._match_id,
            )
        )

    def _on_perception(self, data: bytes) -> None:
        agent = self.agent
        if agent is None:
            return
        try:
            perceived = conversions.read_perception(
                data, agent.facts.num_players, agent.index, self._match_id
            )
        except AgentError as error:
            episode, cycle = agent.moment
            self.get_logger().warning(
                f"after episode {episode} cycle {cycle}: ignored: {error}",
                throttle_duration_sec=LOG_PERIOD,
            )
            return
        num_ended = agent.episodes + agent.cut_off
        decision = agent.perceive(perceived)
        if decision:
            self._requests.publish(
                conversions.write_request(agent.index, perceived, decision, self._match_id)
            )
        if agent.episodes + agent.cut_off > num_ended:
            self._after_episode(agent, perceived)
        if self._is_announcing:
            self._is_announcing = False
            self._announcement.cancel()

    def _after_episode(self, agent: Agent, perceived: Perceived) -> None:
        if perceived.outcome == Outcome.IN_PLAY:
            self.get_logger().warning(
                f"episode {perceived.episode} cycle {perceived.view.cycle}: the end of the episode"
                " before was never perceived"
            )
        self._announce()
        if self._save_every > 0 and agent.episodes % self._save_every == 0:
            try:
                self.save()
            except WeightsError as error:  # the disk may have room again next time
                self.get_logger().error(f"after episode {perceived.episode}: {error}")

    def _path_of(self, asked: str) -> Path:
        """The file that a service may use: the own one, or one in `weights_dir`.

        Raises:
            AgentError: there is none, or it is elsewhere.
        """
        if not asked:
            if self._weights_path is None:
                raise AgentError("no path was given, and save_weights is not set")
            return self._weights_path
        return path_within(Path(self._settings.weights_dir), asked)

    def _on_save(
        self, request: SaveWeights.Request, response: SaveWeights.Response
    ) -> SaveWeights.Response:
        try:
            path = self._path_of(request.path)
            save_weights(path, self._learned(), overwrite=path == self._weights_path)
        except AgentError as error:
            response.message = str(error)
            return response
        response.success, response.path = True, str(path)
        response.message = f"{self.get_name()} saved its weights"
        return response

    def _on_load(
        self, request: LoadWeights.Request, response: LoadWeights.Response
    ) -> LoadWeights.Response:
        try:
            path = self._path_of(request.path)
            if self.agent is None:
                raise AgentError("no match yet, so it is not known which weights would fit")
            self.agent.use(load_weights(path))
        except AgentError as error:
            response.message = str(error)
            return response
        response.success, response.path = True, str(path)
        response.message = f"{self.get_name()} continues from them"
        return response


def main(role: Role, args: list[str] | None = None) -> None:
    """Run one player until a signal asks it to end (SIGINT, SIGTERM); then its weights are saved.

    Raises:
        SystemExit: it cannot play.
    """
    run_node(role.name.lower(), partial(_play, role), SETTINGS, AgentError, args)


def _play(role: Role, must_end: Callable[[], bool]) -> None:
    player = PlayerNode(role)
    executor = EventsExecutor()  # the quick one
    executor.add_node(player)
    gc.freeze()  # nor what has been compiled
    try:
        while not must_end():
            executor.spin_once(timeout_sec=PATIENCE)
    finally:  # a match in which it cannot play is no reason to forget what it knows
        player.save()
