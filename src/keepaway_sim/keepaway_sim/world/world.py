"""World: any number of independent keepaway fields, stepped together, one 0.1 s cycle a call.

A field's result depends on its own seed only, never on which fields run beside it. The simulator
node plays a World of one field, the trainer Worlds of hundreds; there is no other code path.
"""

from __future__ import annotations

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.world import bodies, state
from keepaway_sim.world.compiled import entry_point
from keepaway_sim.world.config import Config
from keepaway_sim.world.constants import pack
from keepaway_sim.world.cycle import act, settle, start
from keepaway_sim.world.state import make_state
from keepaway_sim.world.streams import RandomStreams


class World:
    """`num_fields` keepaway fields in lock-step.

    Attributes:
        task, config: what is played and how.
        perceptions: what every player believes (`vision.Perceptions`), updated in place.
        state: the truth (`State`), updated in place.
    """

    def __init__(self, task: Task, config: Config, num_fields: int = 1) -> None:
        """Lay out the fields; each is idle until `start` gives it a seed.

        Raises:
            KeepawayError: `num_fields` is not positive.
        """
        if num_fields < 1:
            raise KeepawayError(f"num_fields={num_fields}: give at least 1")
        self.task, self.config, self.num_fields = task, config, num_fields
        num = task.num_players
        self._constants = pack(task, config)
        self.perceptions = state.make_perceptions(num_fields, num)
        self._memory = state.make_memory(self._constants, num_fields)
        self._speech = state.make_speech(num_fields, num)
        self.state = make_state(num_fields, num)
        self._radius = np.full(num + 1, config.physics.player_size)
        self._radius[num] = config.physics.ball_size
        side = max(task.field_length, task.field_width)
        self._bodies = bodies.Bodies(num_fields, self._radius, side)
        self._streams = RandomStreams(num_fields, reserve=num * (num + 12) + 16)
        self._touched = np.zeros(num_fields, dtype=np.bool_)
        self._compile()

    def _compile(self) -> None:
        """Bring together what the compiled functions work on; no array is ever replaced."""
        num = self.task.num_players
        collide = np.zeros((num + 1, 2)), np.zeros(num + 1), np.zeros(num + 1, dtype=np.bool_)
        world = self._constants, self.state, self.perceptions, self._memory, self._speech
        places = self._bodies.motion, self._bodies.place
        random = self._streams.uniforms, self._streams.cursor
        self._for_start = *world, *random
        self._for_act = *world, *places, collide[0], *random
        self._for_settle = *world, *places, self._radius, self._touched, collide, *random
        nothing = np.zeros((self.num_fields, num), dtype=np.int64)
        self._act = entry_point(act, *self._for_act, nothing, nothing)
        self._settle = entry_point(settle, *self._for_settle)

    @property
    def commands(self) -> np.ndarray:
        """(F, P, 3) every player's last command: kind (`vision.DASH` ..), power, angle [rad]."""
        return self._memory.command

    def start(self, field: int, seed: np.random.SeedSequence) -> None:
        """Give a field a fresh trial with its own random numbers, and kick off.

        Raises:
            KeepawayError: no such field.
        """
        if not 0 <= field < self.num_fields:
            raise KeepawayError(f"field={field}: this world has fields 0..{self.num_fields - 1}")
        self._streams.seed(field, np.random.default_rng(seed))
        start(*self._for_start, field)

    def stop(self, field: int) -> None:
        """Let a field rest: it is not simulated until it is started again."""
        self.state.running[field] = False
        self.perceptions.decision_due[field] = False
        self._bodies.motion[field, :, 2:] = 0.0

    def abort(self, field: int) -> None:
        """End a field's episode from outside; its next step kicks off a new one."""
        self.perceptions.outcome[field] = Outcome.ABORTED
        self.perceptions.decision_due[field] = False

    def step(self, action: np.ndarray, target: np.ndarray) -> None:
        """Play one cycle on every running field.

        Where a decision is due the request comes into force; elsewhere the last one holds. A
        field whose episode ended kicks off the next one instead.

        Args:
            action, target: (num_fields, num_players) int64; `target` is the receiving or the
                marked keeper's index, ignored for other actions.

        Raises:
            KeepawayError: a request that its player cannot carry out, or arrays of another
                shape or kind; nothing was played.
        """
        action, target = self._checked(action), self._checked(target)
        self._streams.refill()
        illegal = self._act(*self._for_act, action, target)
        if illegal >= 0:
            self._refuse(illegal, action, target)
        touched = self._bodies.move()
        self._touched[:] = False
        self._touched[touched] = True
        self._settle(*self._for_settle)

    def _checked(self, request: np.ndarray) -> np.ndarray:
        """The requests as the compiled code takes them."""
        if request.shape != self.state.action.shape or request.dtype.kind not in "iu":
            given, wanted = f"{request.shape} {request.dtype}", self.state.action.shape
            raise KeepawayError(f"requests of shape {given}: give whole numbers of shape {wanted}")
        return np.ascontiguousarray(request, dtype=np.int64)

    def _refuse(self, illegal: int, action: np.ndarray, target: np.ndarray) -> None:
        field, player = divmod(illegal, self.task.num_players)
        name = self.task.player_names[player]
        raise KeepawayError(
            f"{name} on field {field} cannot carry out action={action[field, player]}"
            f" target={target[field, player]}: keepers hold, pass to another keeper, get open"
            " or go to the ball; takers go to the ball or mark a keeper"
        )
