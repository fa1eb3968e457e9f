"""The discs of all fields in one pymunk space; the only file that imports pymunk."""

from __future__ import annotations

import math

import numpy as np
import pymunk.batch

FIELDS_A_ROW = 16  # fields of one space lie in rows of so many


class Bodies:
    """The discs of all fields in one pymunk space.

    Attributes:
        motion: (num_fields, num_objects, 4) float64: x, y [m] with the field's place added,
            vx, vy [m/cycle]; written by the caller before `move`, read after it.
        place: (num_fields, 2) where each field's origin lies in the space [m].
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
        self.place = spacing * np.stack([index % FIELDS_A_ROW, index // FIELDS_A_ROW], axis=1)
        self.motion = np.zeros((num_fields, len(radius), 4))
        self.motion[:, :, :2] = self.place[:, None, :]
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
        self._input.set_float_buf(self.motion.data.cast("B"))

    def _add(self, radius: float) -> pymunk.Body:
        body = pymunk.Body(1.0, 1.0)
        self._space.add(body, pymunk.Circle(body, radius))
        return body

    def move(self) -> np.ndarray:
        """Move every disc by its velocity.

        `motion` holds the new positions afterwards.

        Returns:
            Numbers of the fields (a few may stand more than once) in which discs may touch.
        """
        pymunk.batch.set_space_bodies(self._space, _MOTION, self._input)
        self._space.step(1.0)
        self._output.clear()
        pymunk.batch.get_space_bodies(self._space, pymunk.batch.BodyFields.POSITION, self._output)
        moved = np.frombuffer(self._output.float_buf())
        self.motion[:, :, :2] = moved.reshape(*self.motion.shape[:2], 2)
        self._contacts.clear()
        pymunk.batch.get_space_arbiters(
            self._space, pymunk.batch.ArbiterFields.BODY_A_ID, self._contacts
        )
        ids = np.frombuffer(self._contacts.int_buf(), dtype=np.int64)
        return self._field_of_sorted[np.searchsorted(self._sorted_ids, ids)]


_MOTION = pymunk.batch.BodyFields.POSITION | pymunk.batch.BodyFields.VELOCITY
