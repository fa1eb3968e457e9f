"""World: any number of independent keepaway fields, stepped together, one 0.1 s cycle a call.

A field's result depends on its own seed only, never on which fields run beside it. The simulator
node plays a World of one field, the trainer Worlds of hundreds; there is no other code path.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.world.bodies import Bodies
from keepaway_sim.world.compiled import Kernel, prepare
from keepaway_sim.world.config import Config
from keepaway_sim.world.constants import pack
from keepaway_sim.world.cycle import act, settle
from keepaway_sim.world.geometry import TWO_PI
from keepaway_sim.world.state import Belief, Truth, make_fields
from keepaway_sim.world.streams import RandomStreams, StreamSnapshot


class FieldSnapshot(NamedTuple):
    """All there is of a field at one moment; see `World.snapshot`."""

    task: Task
    config: Config
    rows: list[np.ndarray]  # of the arrays of `Fields`
    random: StreamSnapshot


class World:
    """`num_fields` keepaway fields in lock-step.

    Attributes:
        task, config: what is played and how.
        fields: every array of it (`Fields`), updated in place.
    """

    def __init__(
        self, task: Task, config: Config, num_fields: int = 1, *, is_stepped: bool = True
    ) -> None:
        """Lay out the fields; each is idle until `start` gives it a seed.

        Args:
            task, config: what is played and how.
            num_fields: side by side.
            is_stepped: compile what `step` calls now. Who compiles it together with functions of
                its own (`calls`), or plays cycles by those alone, needs none of it here.

        Raises:
            KeepawayError: `num_fields` is not positive.
        """
        if num_fields < 1:
            raise KeepawayError(f"num_fields={num_fields}: give at least 1")
        self.task, self.config, self.num_fields = task, config, num_fields
        num = task.num_players
        radius = np.array([config.physics.player_size] * num + [config.physics.ball_size])
        self._bodies = Bodies(num_fields, radius, max(task.field_length, task.field_width))
        self._streams = RandomStreams(num_fields, reserve=num * (num + 12) + 16)
        self.fields = make_fields(pack(task, config), self._bodies.discs, self._streams.draws)
        self._everywhere = np.ones(num_fields, dtype=np.bool_)
        self._act, self._settle = Kernel(act, self.fields), Kernel(settle, self.fields)
        if is_stepped:
            prepare(*self.calls)

    @property
    def calls(self) -> list[tuple[Any, tuple[Any, ...]]]:
        """What `step` calls, for `prepare`; the longest to compile comes first."""
        requests = self.truth.action, self.truth.target
        return [
            (self._settle, (self._everywhere,)),
            (self._act, (self._everywhere, *requests)),
        ]

    @property
    def truth(self) -> Truth:
        """What is so on every field, updated in place."""
        return self.fields.truth

    @property
    def belief(self) -> Belief:
        """What every player believes, updated in place."""
        return self.fields.belief

    @property
    def commands(self) -> np.ndarray:
        """(F, P, 3) every player's last command: kind (`state.DASH` ..), power, angle [rad]."""
        return self.fields.memory.command

    def start(self, field: int, seed: np.random.SeedSequence) -> None:
        """Give a field a fresh trial with its own random numbers, and kick off.

        Raises:
            KeepawayError: no such field.
        """
        self.seed(field, seed)
        self._settle(np.arange(self.num_fields) == field)

    def seed(self, field: int, seed: np.random.SeedSequence) -> None:
        """Give a field a fresh trial with its own random numbers; its next cycle kicks off.

        Raises:
            KeepawayError: no such field.
        """
        self._check_field(field)
        self._streams.seed(field, np.random.default_rng(seed))
        draws, truth, belief = self.fields.random, self.truth, self.belief
        num = self.task.num_players
        truth.yaw[field] = TWO_PI * (draws.uniforms[field, :num] - 0.5)
        draws.cursor[field] = num
        belief.body[field] = truth.yaw[field, :, None]
        belief.neck[field], belief.position[field] = 0.0, 0.0
        self.fields.memory.self_error[field] = self.fields.memory.seen[field] = 0.0
        truth.time[field], truth.running[field] = -1, True  # the kick-off takes it to 0
        belief.episode[field], belief.outcome[field] = -1, Outcome.ABORTED

    def stop(self, field: int) -> None:
        """Let a field rest: it is not simulated until it is started again."""
        self.truth.running[field] = False
        self.belief.decision_due[field] = False

    def abort(self, field: int | np.ndarray) -> None:
        """End the episode of a field, or of (num_fields,) bool ones; the next step kicks off."""
        self.belief.outcome[field] = Outcome.ABORTED
        self.belief.decision_due[field] = False

    def step(
        self, action: np.ndarray, target: np.ndarray, playing: np.ndarray | None = None
    ) -> None:
        """Play one cycle on every running field.

        Where a decision is due the request comes into force; elsewhere the last one holds. A
        field whose episode ended kicks off the next one instead.

        Args:
            action, target: (num_fields, num_players) int64; `target` is the receiving or the
                marked keeper's index, ignored for other actions.
            playing: (num_fields,) bool, on which of the running fields; on all without it. On
                the others time stands still.

        Raises:
            KeepawayError: a request that its player cannot carry out, or arrays of another
                shape or kind; nothing was played.
        """
        action, target = self._checked(action), self._checked(target)
        playing = self._everywhere if playing is None else np.ascontiguousarray(playing, np.bool_)
        if playing.shape != self._everywhere.shape:
            raise KeepawayError(f"playing of shape {playing.shape}: give {self._everywhere.shape}")
        self._streams.refill()
        illegal = self._act(playing, action, target)
        if illegal >= 0:
            self._refuse(illegal, action, target)
        self._bodies.move()
        self._settle(playing)

    @property
    def streams(self) -> RandomStreams:
        """The random numbers, one stream for each field."""
        return self._streams

    @property
    def bodies(self) -> Bodies:
        """The discs, which are moved between `begin_cycle` and `end_cycle`."""
        return self._bodies

    def snapshot(self, field: int) -> FieldSnapshot:
        """Take down all there is of a field, random numbers included; it can be pickled.

        Raises:
            KeepawayError: no such field.
        """
        self._check_field(field)
        rows = [array[field].copy() for array in self._arrays]
        return FieldSnapshot(self.task, self.config, rows, self._streams.snapshot(field))

    def restore(self, field: int, snapshot: FieldSnapshot) -> None:
        """Put a field back to where it was; from there the same requests give the same bits.

        Args:
            field: any of this world; it need not be the one that the snapshot is of.
            snapshot: of this world or another one of the same task and configuration.

        Raises:
            KeepawayError: no such field, or a snapshot of another task or configuration.
        """
        self._check_field(field)
        if (snapshot.task, snapshot.config) != (self.task, self.config):
            raise KeepawayError(
                f"a snapshot of another world ({snapshot.task}, {snapshot.config}):"
                f" this one is {self.task}, {self.config}"
            )
        for array, row in zip(self._arrays, snapshot.rows, strict=True):
            array[field] = row
        self._streams.restore(field, snapshot.random)

    @functools.cached_property
    def _arrays(self) -> list[np.ndarray]:
        """All arrays with a row for each field that outlive a cycle."""
        w = self.fields
        return [*w.truth, *w.belief, *w.memory, *w.phantoms, *w.speech]

    def _check_field(self, field: int) -> None:
        if not 0 <= field < self.num_fields:
            raise KeepawayError(f"field={field}: this world has fields 0..{self.num_fields - 1}")

    def _checked(self, request: np.ndarray) -> np.ndarray:
        """The requests as the compiled code takes them."""
        if request.shape != self.truth.action.shape or request.dtype.kind not in "iu":
            given, wanted = f"{request.shape} {request.dtype}", self.truth.action.shape
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
