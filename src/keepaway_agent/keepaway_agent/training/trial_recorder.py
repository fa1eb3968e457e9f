"""Chosen episodes of a training, recorded while it runs, as a bag like a match's. No ROS."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path

from keepaway_agent.training.trial import Moment
from keepaway_sim.bags.field_recorder import FieldRecorder, world_info
from keepaway_sim.bags.writer import BagWriter


class TrialRecorder:
    """Writes one trial's bag: give it to the trial as its `watch`, and close it in the end.

    Attributes:
        path: folder of the bag.
    """

    def __init__(
        self,
        path: Path,
        seed: int,
        wanted: Callable[[int], bool] | None = None,
        info: Mapping[str, str] | None = None,
        attachments: Mapping[str, bytes] | None = None,
    ) -> None:
        """Be ready; the bag begins with the trial.

        Args:
            path: folder of the bag, that does not exist yet.
            seed: of the training.
            wanted: which episodes to record, by number; None: all.
            info: what else the bag contains about how it was made.
            attachments: files by name, for example the weights that players begin with.
        """
        self.path, self._seed, self._wanted = path, seed, wanted
        self._info, self._attachments = dict(info or {}), dict(attachments or {})
        self._bag: BagWriter | None = None
        self._recorder: FieldRecorder | None = None

    def __call__(self, moment: Moment) -> None:
        """Record a moment.

        Raises:
            KeepawayError: at the first one, if something is in the bag's place.
        """
        recorder = self._recorder or self._begin(moment)
        recorder.moment()
        recorder.requests(moment.action, moment.target, moment.values)

    def anew(self) -> TrialRecorder:
        """Another that records the same, beside what a process that was killed had begun."""
        numbered = (self.path.with_name(f"{self.path.name}_{n}") for n in itertools.count(2))
        free = next(path for path in numbered if not path.exists())
        return TrialRecorder(free, self._seed, self._wanted, self._info, self._attachments)

    def close(self) -> None:
        """Finish the bag, if it was begun."""
        if self._bag:
            self._bag.close()

    def _begin(self, moment: Moment) -> FieldRecorder:
        chosen = {} if self._wanted is None else {"episodes": "selected"}
        info = world_info(moment.world, self._seed, **chosen, **self._info)
        self._bag = BagWriter(self.path, info)
        for name, data in self._attachments.items():
            self._bag.attach(name, data)
        wanted = self._wanted or _every_episode
        self._recorder = FieldRecorder(self._bag, moment.world, moment.field, self._seed, wanted)
        return self._recorder


def _every_episode(number: int) -> bool:
    return True
