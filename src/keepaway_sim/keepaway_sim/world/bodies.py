"""The discs of all fields in pymunk spaces; the only file that imports pymunk.

Discs that touch nothing move by their velocity; so pymunk is asked only of the fields in which some
may touch. Every cycle those fields take the first *slots* of a space, whatever their numbers are.
"""

from __future__ import annotations

import math

import numpy as np
import pymunk.batch

from keepaway_sim.world.state import Discs

SLOTS_A_ROW = 16  # slots in a row of a space
CELL = 16.0  # [m] of the grid by which pymunk finds neighbours
SPACES = 8  # spaces of an eighth of the fields, two eighths..; smaller ones hold 1, 2, 4..


class Bodies:
    """The discs of all fields in pymunk spaces.

    Attributes:
        discs: their arrays (`Discs`); the caller writes which fields are asked for and how their
            discs move before `move`, and reads where they are after it.
    """

    def __init__(self, num_fields: int, radius: np.ndarray, field_side: float) -> None:
        """Make room for the discs of every field.

        Args:
            num_fields: how many fields.
            radius: (num_objects,) radii of one field's discs [m].
            field_side: the longer side of a field [m].
        """
        spacing = 2.0 ** math.ceil(math.log2(2.0 * field_side + 64.0))
        index = np.arange(num_fields)
        place = spacing * np.stack([index % SLOTS_A_ROW, index // SLOTS_A_ROW], axis=1)
        motion = np.zeros((num_fields, len(radius), 4))
        motion[:, :, :2] = place[:, None, :]
        self.discs = Discs(
            motion=motion,
            place=place,
            radius=radius,
            asked=np.zeros(num_fields, dtype=np.int64),
            num_asked=np.zeros(1, dtype=np.int64),
            slot=np.full(num_fields, -1, dtype=np.int64),
            touched=np.zeros(num_fields, dtype=np.bool_),
        )
        self._step = max(1, num_fields // SPACES)
        self._spaces: dict[int, _Space] = {}

    def move(self) -> None:
        """Move the discs of the fields that are asked for by their velocity.

        `motion` holds the new positions afterwards, `touched` says in which fields discs touch.
        """
        discs, num_asked = self.discs, int(self.discs.num_asked[0])
        discs.touched[:] = False
        if num_asked == 0:
            return
        size = self._size(num_asked)
        space = self._spaces.get(size) or self._spaces.setdefault(size, _Space(discs, size))
        discs.motion[num_asked:size, :, 2:] = 0.0  # empty slots rest
        touching = space.move()
        discs.touched[discs.asked[touching[touching < num_asked]]] = True

    def _size(self, num_asked: int) -> int:
        """Slots of the smallest space with room for N fields."""
        if num_asked <= self._step:
            return min(1 << (num_asked - 1).bit_length(), self._step)
        return min(-(-num_asked // self._step) * self._step, len(self.discs.place))


class _Space:
    """A pymunk space with the discs of the first `size` slots."""

    def __init__(self, discs: Discs, size: int) -> None:
        self._space = pymunk.Space()
        self._space.iterations = 1
        self._space.collision_bias = 1.0  # pymunk itself pushes nothing apart
        self._space.use_spatial_hash(CELL, 10 * size * len(discs.radius))
        self._bodies = [self._add(radius) for _ in range(size) for radius in discs.radius]
        ids = np.array([body.id for body in self._bodies], dtype=np.int64)
        order = np.argsort(ids)
        self._sorted_ids, self._slot_of_sorted = ids[order], order // len(discs.radius)
        self._motion = discs.motion[:size]
        self._input, self._output = pymunk.batch.Buffer(), pymunk.batch.Buffer()
        self._contacts = pymunk.batch.Buffer()
        self._input.set_float_buf(self._motion.data.cast("B"))

    def _add(self, radius: float) -> pymunk.Body:
        body = pymunk.Body(1.0, 1.0)
        self._space.add(body, pymunk.Circle(body, radius))
        return body

    def move(self) -> np.ndarray:
        """Move the discs; numbers of the slots (a few more than once) in which some touch."""
        pymunk.batch.set_space_bodies(self._space, _MOTION, self._input)
        self._space.step(1.0)
        self._output.clear()
        pymunk.batch.get_space_bodies(self._space, pymunk.batch.BodyFields.POSITION, self._output)
        moved = np.frombuffer(self._output.float_buf())
        self._motion[:, :, :2] = moved.reshape(*self._motion.shape[:2], 2)
        self._contacts.clear()
        pymunk.batch.get_space_arbiters(
            self._space, pymunk.batch.ArbiterFields.BODY_A_ID, self._contacts
        )
        ids = np.frombuffer(self._contacts.int_buf(), dtype=np.int64)
        slots: np.ndarray = self._slot_of_sorted[np.searchsorted(self._sorted_ids, ids)]
        return slots


_MOTION = pymunk.batch.BodyFields.POSITION | pymunk.batch.BodyFields.VELOCITY
