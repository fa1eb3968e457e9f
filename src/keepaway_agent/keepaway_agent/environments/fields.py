"""Fields of a World on which keepers' choices are made from outside."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.spaces import Box

from keepaway_agent.actions import NO_TARGET, Action, Outcome, Role
from keepaway_agent.compiled import Kernel
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.features import ORDERINGS, keeper_features, keeper_state, rank_players
from keepaway_agent.learning.sarsa import UNIFORMS_PER_CHOICE
from keepaway_agent.playing.policies import make_player
from keepaway_agent.training.deciding import Deciders, decide_all
from keepaway_agent.training.trial import child_seed
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config
from keepaway_sim.world.streams import RandomStreams
from keepaway_sim.world.world import World


class Fields:
    """Fields of one World on which keepers' choices are made from outside.

    Attributes:
        task: what is played.
        choosing: (num_fields, num_keepers) bool, who has a choice to make now.
        cycle: (num_fields,) cycles since kick-off.
    """

    def __init__(
        self,
        task: str = "3v2",
        num_fields: int = 1,
        taker_policy: str = "hand",
        config: Config | None = None,
        ordering: str = "ball",
    ) -> None:
        """Lay out the fields.

        Args:
            task: keepers v takers.
            num_fields: played side by side.
            taker_policy: hand or random.
            config: of the world.
            ordering: what ranks players, ball or k1.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        self.task = Task.parse(task)
        self._world = World(self.task, config or Config(), num_fields)
        n, num_players = self.task.num_keepers, self.task.num_players
        shape = (num_fields, num_players)
        self.choosing = np.zeros((num_fields, n), dtype=np.bool_)
        self.cycle = self._world.belief.cycle
        self._keeper = make_player(0, n, "hold", ordering)
        self._taker = make_player(n, n, taker_policy)
        policy = np.full(shape, self._keeper.policy)
        policy[:, n:] = self._taker.policy
        keepers, takers = (
            sarsa.make_learners(
                num_fields * size, n, make_tiling(role, n, self.task.num_takers), None
            )
            for role, size in ((Role.KEEPER, n), (Role.TAKER, self.task.num_takers))
        )
        self._ordering = ORDERINGS[ordering]
        self._streams = RandomStreams(num_fields * num_players, UNIFORMS_PER_CHOICE, block=512)
        self._deciders = Deciders(
            belief=self._world.belief,
            keepers=keepers,
            takers=takers,
            policy=policy,
            keeper=self._keeper,
            taker=self._taker,
            random=self._streams.draws,
            order=np.zeros(num_players, dtype=np.int64),
            action=np.zeros(shape, dtype=np.int64),
            target=np.zeros(shape, dtype=np.int64),
            chose=np.zeros(shape, dtype=np.bool_),
        )
        self._decide_all = Kernel(decide_all, self._deciders)

    @property
    def is_over(self) -> np.ndarray:
        """(num_fields,) whether the episode has ended; the next cycle kicks off a new one."""
        over: np.ndarray = self._world.belief.outcome != Outcome.IN_PLAY
        return over

    def start(self, field: int, seed: np.random.SeedSequence) -> None:
        """Begin anew on a field, with all random numbers from this seed."""
        first = field * self.task.num_players
        for player in range(self.task.num_players):
            generator = np.random.default_rng(child_seed(seed, 1, player))
            self._streams.seed(first + player, generator)
        self._world.start(field, child_seed(seed, 0))
        self._look(np.arange(len(self.cycle)) == field)

    def abort(self) -> None:
        """End the episodes of all fields; the next cycle kicks off new ones."""
        for field in np.flatnonzero(~self.is_over):
            self._world.abort(int(field))
        self.choosing[:] = False

    def choose(self, field: int, keeper: int, choice: int) -> None:
        """Make a keeper's choice: 0 to hold, k to pass to K(k+1)."""
        action, target = Action.HOLD_BALL, NO_TARGET
        if choice:
            self._rank(field, keeper)
            action, target = Action.PASS_BALL, int(self._deciders.order[choice])
        self._deciders.action[field, keeper], self._deciders.target[field, keeper] = action, target

    def step(self, moving: np.ndarray) -> None:
        """Play a cycle on the fields of (num_fields,) `moving`; time stands still on the others."""
        self._world.step(self._deciders.action, self._deciders.target, moving)
        self._look(moving)

    def observe(self, field: int, keeper: int, into: np.ndarray) -> None:
        """Write a keeper's state variables, itself being K1, into (4n + 2m - 3,) `into`."""
        self._rank(field, keeper)
        position = self._world.belief.position[field, keeper]
        keeper_state(position, self._deciders.order, self.task.num_keepers, into)

    def _rank(self, field: int, keeper: int) -> None:
        position = self._world.belief.position[field, keeper]
        num_keepers = self.task.num_keepers
        rank_players(position, num_keepers, keeper, -1, self._ordering, self._deciders.order)

    def _look(self, moved: np.ndarray) -> None:
        """Let every player answer by rule where time went by, and find out who has a choice."""
        self._streams.refill()
        self._decide_all(moved)
        self.choosing[moved] = self._deciders.chose[moved, : self.task.num_keepers]


def observation_space(task: Task) -> Box:
    """Of a keeper's state variables: metres up to the field's diagonal, angles up to pi."""
    diagonal = math.hypot(task.field_length, task.field_width)
    features = keeper_features(task.num_keepers, task.num_takers)
    high = [math.pi if feature.kind == "min_angle" else diagonal for feature in features]
    return Box(np.zeros(len(high), np.float32), np.array(high, np.float32), dtype=np.float32)
