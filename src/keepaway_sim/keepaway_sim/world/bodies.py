"""The discs of all fields in one pymunk space; the only file that imports pymunk."""

from __future__ import annotations

import math

import numpy as np
import pymunk.batch

from keepaway_sim.world.state import Discs

FIELDS_A_ROW = 16  # fields of one space lie in rows of so many


class Bodies:
    """The discs of all fields in one pymunk space.

    Attributes:
        discs: their arrays (`Discs`); `motion` is written by the caller before `move`, with the
            field's place added to every position, and read after it.
    """

    def __init__(self, num_fields: int, radius: np.ndarray, field_side: float) -> None:
        """Put the discs of every field into a space.

        Args:
            num_fields: how many fields.
            radius: (num_objects,) radii of one field's discs [m].
            field_side: the longer side of a field [m].
        """
        spacing = 2.0 ** math.ceil(math.log2(2.0 * field_side + 64.0))
        index = np.arange(num_fields)
        place = spacing * np.stack([index % FIELDS_A_ROW, index // FIELDS_A_ROW], axis=1)
        motion = np.zeros((num_fields, len(radius), 4))
        motion[:, :, :2] = place[:, None, :]
        self.discs = Discs(motion, place, radius, np.zeros(num_fields, dtype=np.bool_))
        self._space = pymunk.Space()
        self._space.iterations = 1
        self._space.collision_bias = 1.0  # pymunk itself pushes nothing apart
        self._space.use_spatial_hash(2.0, 10 * num_fields * len(radius))
        self._bodies = [self._add(size) for _ in range(num_fields) for size in radius]
        ids = np.array([body.id for body in self._bodies], dtype=np.int64)
        order = np.argsort(ids)
        self._sorted_ids, self._field_of_sorted = ids[order], order // len(radius)
        self._input, self._output = pymunk.batch.Buffer(), pymunk.batch.Buffer()
        self._contacts = pymunk.batch.Buffer()
        self._input.set_float_buf(motion.data.cast("B"))

    def _add(self, radius: float) -> pymunk.Body:
        body = pymunk.Body(1.0, 1.0)
        self._space.add(body, pymunk.Circle(body, radius))
        return body

    def move(self) -> None:
        """Move every disc by its velocity.

        `motion` holds the new positions afterwards, `touched` says where discs may touch.
        """
        motion, touched = self.discs.motion, self.discs.touched
        pymunk.batch.set_space_bodies(self._space, _MOTION, self._input)
        self._space.step(1.0)
        self._output.clear()
        pymunk.batch.get_space_bodies(self._space, pymunk.batch.BodyFields.POSITION, self._output)
        moved = np.frombuffer(self._output.float_buf())
        motion[:, :, :2] = moved.reshape(*motion.shape[:2], 2)
        self._contacts.clear()
        pymunk.batch.get_space_arbiters(
            self._space, pymunk.batch.ArbiterFields.BODY_A_ID, self._contacts
        )
        ids = np.frombuffer(self._contacts.int_buf(), dtype=np.int64)
        touched[:] = False
        touched[self._field_of_sorted[np.searchsorted(self._sorted_ids, ids)]] = True


_MOTION = pymunk.batch.BodyFields.POSITION | pymunk.batch.BodyFields.VELOCITY
