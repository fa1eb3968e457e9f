"""One player as an object: it perceives, decides, learns. No ROS: nodes are wiring around it.

The rules are those of `policies`; this keeps what one player needs from cycle to cycle: its
learner, its random numbers, and what it answered last, because messages may come twice or never.
"""

from dataclasses import dataclass
from typing import NamedTuple

import attrs
import numpy as np

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.compiled import Kernel
from keepaway_agent.errors import AgentError
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.learning.weights import LearnedWeights, check_fits
from keepaway_agent.playing import policies
from keepaway_agent.playing.policies import View, make_player
from keepaway_agent.settings import group, setting

POLICY_STREAM = 1
"""Second entry of a player's spawn key; 0 is the world's."""


@dataclass(frozen=True)
class MatchFacts:
    """What a player must know of the match it plays in."""

    num_keepers: int
    num_takers: int
    field_length: float  # [m]
    field_width: float  # [m]
    cycle_time: float  # [s]
    seed: int
    code_version: str = ""
    first_episode: int = 0  # more than 0 where a simulator resumes a match begun before

    @property
    def num_players(self) -> int:
        """Keepers and takers together."""
        return self.num_keepers + self.num_takers

    def role(self, index: int) -> Role:
        """The team of a player given by its index in match order."""
        return Role.KEEPER if index < self.num_keepers else Role.TAKER


@attrs.frozen
class AgentConfig:
    """How a player plays and learns."""

    policy: str = setting("hand", "random, hold (keepers), hand, learn or greedy")
    learner: LearnerConfig = group(LearnerConfig)
    decision_interval: int = setting(
        policies.TAKER_DECISION_INTERVAL, "between a taker's choices", "cycles", "[1, 1000]"
    )


@attrs.frozen
class WeightsFiles:
    """Where a player's weights come from and go to."""

    load_weights: str = setting("", "file to start from; empty: know nothing")
    save_weights: str = setting("", "file to write at the end; empty: none")
    save_every: int = setting(
        100, "and in between, every N episodes; 0: at the end only", "episodes", "[0, 1000000000]"
    )
    resume: bool = setting(False, "continue from save_weights if that file exists")


def check_config(role: Role, config: AgentConfig) -> None:
    """Refuse settings that make no player of this role, before there is a match.

    Raises:
        AgentError: names the setting, and what to give instead.
    """
    index = 0 if role == Role.KEEPER else 2
    make_player(index, 2, config.policy, config.learner.ordering, config.decision_interval)


class Decision(NamedTuple):
    """What a player asks for, and what its learner expected of each choice before it chose."""

    action: int
    target: int  # index of the receiver or of the marked keeper
    values: np.ndarray  # (num_actions,) [cycles]; empty where no learner chose


class Perceived(NamedTuple):
    """A perception, for the player whose it is."""

    episode: int  # counted from 0 in a match
    outcome: int  # IN_PLAY, or why the episode ended with this perception
    decision_due: bool
    view: View


class Agent:
    """One player of a match.

    Attributes:
        facts, index, config: the match, the place in match order, how it plays.
        learners: its one learner (`sarsa.Learners`), also when its policy does not learn.
        tiling: of the learner's state variables.
        has_learner: whether its policy asks the learner.
        episodes, hours: what it has played to the end [simulated h], loaded weights' included.
        cut_off: episodes that taught nothing: aborted, or their end was never perceived.
        moment: episode and cycle that it perceived last.
    """

    def __init__(self, facts: MatchFacts, index: int, config: AgentConfig | None = None) -> None:
        """Take a place in a match.

        Raises:
            AgentError: a place that the match has not, or settings that do not fit the role.
        """
        if not 0 <= index < facts.num_players:
            raise AgentError(f"player {index}: this match has players 0..{facts.num_players - 1}")
        self.facts, self.index, self.config = facts, index, config or AgentConfig()
        self.tiling = make_tiling(
            self.role,
            facts.num_keepers,
            facts.num_takers,
            facts.field_length,
            facts.field_width,
            self.config.learner.tile_widths,
        )
        self.learners = sarsa.make_learners(1, facts.num_keepers, self.tiling, self.config.learner)
        self._player = make_player(
            index,
            facts.num_keepers,
            self.config.policy,
            self.config.learner.ordering,
            self.config.decision_interval,
        )
        self._order = np.zeros(facts.num_players, dtype=np.int64)
        self._random = policy_generator(facts.seed, index, first_episode=facts.first_episode)
        self._uniforms = self._random.random(sarsa.UNIFORMS_PER_CHOICE)
        self.has_learner = self._player.policy in (policies.LEARN, policies.GREEDY)
        self.episodes, self.hours, self.cut_off = 0, 0.0, 0
        self.moment = (-1, 0)
        self._in_play = False
        self._answer: Decision | None = None
        self._compile()

    @property
    def learns(self) -> bool:
        """Whether its weights change while it plays."""
        return self._player.policy == policies.LEARN

    @property
    def role(self) -> Role:
        """Its team."""
        return self.facts.role(self.index)

    def use(self, weights: LearnedWeights) -> None:
        """Continue from weights that were learned before.

        Raises:
            WeightsError: weights for something else than this player does here.
        """
        teams = (self.facts.num_keepers, self.facts.num_takers)
        check_fits(weights, self.role, *teams, self.tiling, self.config.learner.ordering)
        sarsa.tiles_of(self.learners, 0)[:] = weights.values
        self.episodes, self.hours = weights.episodes, weights.hours

    def learned(self, name: str) -> LearnedWeights:
        """What it has learned so far, under the player's name."""
        facts = self.facts
        return LearnedWeights(
            values=sarsa.tiles_of(self.learners, 0).copy(),
            role=self.role,
            num_keepers=facts.num_keepers,
            num_takers=facts.num_takers,
            field_length=facts.field_length,
            field_width=facts.field_width,
            tiling=self.tiling,
            ordering=self.config.learner.ordering,
            sarsa=self.config.learner.sarsa,
            episodes=self.episodes,
            hours=self.hours,
            seed=facts.seed,
            player=name,
            code_version=facts.code_version,
            created_by=f"{self.role.name.lower()} node",
        )

    def perceive(self, perceived: Perceived) -> Decision | None:
        """Answer a perception; None where none is due, or where it is older than the last one.

        One that comes a second time gets the same answer again, and teaches nothing.
        """
        moment = (perceived.episode, perceived.view.cycle)
        if moment <= self.moment:
            return self._answer if moment == self.moment else None
        if self._in_play and perceived.episode != self.moment[0]:
            self._end_episode(self.moment[1], Outcome.ABORTED)
        self.moment, self._in_play = moment, perceived.outcome == Outcome.IN_PLAY
        self._answer = None
        if not self._in_play:
            self._end_episode(perceived.view.cycle, perceived.outcome)
        elif perceived.decision_due:
            self._answer = self._decide(perceived.view)
        else:
            self._keep_passing(perceived.view.cycle)
        return self._answer

    def _decide(self, view: View) -> Decision:
        action, target, chose = self._rule(_as_compiled(view), self._uniforms, self._order)
        if not chose:
            return Decision(int(action), int(target), _NO_VALUES)
        self._uniforms = self._random.random(sarsa.UNIFORMS_PER_CHOICE)
        values = self.learners.values[0].copy() if self.has_learner else _NO_VALUES
        return Decision(int(action), int(target), values)

    def _end_episode(self, cycle: int, outcome: int) -> None:
        self._finish(cycle, int(outcome))
        if outcome == Outcome.ABORTED:
            self.cut_off += 1
        else:
            self.episodes += 1
            self.hours += cycle * self.facts.cycle_time / 3600

    def _compile(self) -> None:
        """Compile what it decides by, so that the first decision of the match is not late."""
        keeps = self.role == Role.KEEPER
        rule = policies.keeper_decision if keeps else policies.taker_decision
        num = self.facts.num_players
        ages = np.zeros(num + 1, dtype=np.int32)
        nothing = View(np.zeros((num + 1, 2)), ages, ages[:-1], False, 0)
        self._rule = Kernel(rule, self.learners, 0, self._player)
        self._rule.compile_for(nothing, self._uniforms, self._order)
        self._finish = Kernel(policies.end_episode, self.learners, 0, self._player)
        self._finish.compile_for(0, int(Outcome.ABORTED))
        self._keep_passing = Kernel(policies.keep_passing, self.learners, 0)
        self._keep_passing.compile_for(0)


def _as_compiled(view: View) -> View:
    """The same view as the machine code takes it, whatever kinds of numbers it was made of."""
    return View(
        np.ascontiguousarray(view.position, dtype=np.float64),
        np.ascontiguousarray(view.age, dtype=np.int32),
        np.ascontiguousarray(view.cycles_to_ball, dtype=np.int32),
        view.ball_kickable,
        view.cycle,
    )


_NO_VALUES = np.empty(0)


def policy_generator(
    seed: int, index: int, trial: int = 0, first_episode: int = 0
) -> np.random.Generator:
    """The random numbers of a player's policy; its own in every trial and every match.

    Those of a match that is resumed from `first_episode` are not those of its beginning again.
    """
    key = (trial, POLICY_STREAM, index, *([first_episode] if first_episode else []))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
