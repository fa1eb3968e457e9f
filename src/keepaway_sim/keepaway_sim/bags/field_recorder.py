"""One field of a World, recorded cycle by cycle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.task import Outcome
from keepaway_sim.version import code_version
from keepaway_sim.wire import messages
from keepaway_sim.wire.field_messages import FieldMessages
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    CLOCK,
    EPISODE,
    FIELD_STATE,
    MATCH,
    PERCEPTION,
    Request,
)
from keepaway_sim.world.world import World


class FieldRecorder:
    """Records one field of a World while it is played: the messages a simulator node would say.

    Call `moment` once after `World.start`, then `requests` before and `moment` after each
    `World.step`:

        with BagWriter(path, world_info(world, seed)) as bag:
            recorder = FieldRecorder(bag, world, field, seed, wanted={0, 500}.__contains__)
            recorder.moment()
            while ...:
                recorder.requests(action[field], target[field])
                world.step(action, target)
                recorder.moment()
    """

    def __init__(
        self,
        bag: BagWriter,
        world: World,
        field: int,
        seed: int,
        wanted: Callable[[int], bool] = lambda number: True,
    ) -> None:
        """Say what is played.

        Args:
            bag: where to.
            world, field: which field of which world.
            seed: of the match.
            wanted: which episodes to record, by number.
        """
        self._bag, self._world, self._field, self._seed = bag, world, field, seed
        self._say = FieldMessages(world, field)
        self._wanted = wanted
        self._names = world.task.player_names
        self._write("match", MATCH, self._say.match(seed, speed=0.0))

    def moment(self) -> None:
        """Record the truth and what every player perceives of it."""
        number = int(self._world.belief.episode[self._field])
        if not self._wanted(number):
            return
        self._write("clock", CLOCK, self._say.clock())
        self._write("field_state", FIELD_STATE, self._say.field_state())
        for name, data in zip(self._names, self._say.perceptions(), strict=True):
            self._write(f"{name}/perception", PERCEPTION, data)
        if self._world.belief.outcome[self._field] != Outcome.IN_PLAY:
            self._write("episode", EPISODE, self._say.episode(self._seed))

    def requests(self, action: np.ndarray, target: np.ndarray, action_values: Any = None) -> None:
        """Record what the players are about to do, where a decision is due.

        Args:
            action, target: (num_players,) int.
            action_values: for every player the values its learner saw, or an empty sequence.
        """
        seen, field = self._world.belief, self._field
        number, cycle = int(seen.episode[field]), int(seen.cycle[field])
        if not self._wanted(number):
            return
        for player in np.flatnonzero(seen.decision_due[field]).tolist():
            asked = Request(player, number, cycle, int(action[player]), int(target[player]))
            values = () if action_values is None else action_values[player]
            data = messages.action_request(asked, values)
            self._write(f"{self._names[player]}/action_request", ACTION_REQUEST, data)

    def _write(self, topic: str, message_type: str, data: bytes) -> None:
        self._bag.write(f"/{topic}", message_type, data, self._say.stamp_ns())


def world_info(world: World, seed: int, **more: str) -> dict[str, str]:
    """What a bag says of the world that made it."""
    return {
        "task": world.task.name,
        "field": world.task.field,
        "profile": world.config.profile,
        "seed": str(seed),
        "code_version": code_version(),
        **more,
    }
