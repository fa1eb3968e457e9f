"""A bag of one or more MCAP files, read in the order of time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from keepaway_sim.bags.blocks import Block, Piece
from keepaway_sim.bags.chunks import Run
from keepaway_sim.bags.files import bag_files
from keepaway_sim.bags.mcap_reader import McapFile
from keepaway_sim.bags.merging import merged
from keepaway_sim.bags.topics import Batch, Recorded, Topic
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire import cdr

_MOST_FILES = 10_000
_ROWS_AT_ONCE = 10_000


class Place(NamedTuple):
    """Chunks of a file that are read together."""

    file: McapFile
    run: Run


Choice = Callable[[int, bytes, np.ndarray], np.ndarray]
"""Which of a place's rows are wanted, (n,) bool: by its number, its bytes and (n, 4) rows."""


class BagReader:
    """Reads a bag, also one whose writer was killed: up to its last whole chunk.

    Messages come in the order of their log times, wherever they stand in the files. Memory does
    not grow with the bag (see `merging`).

    Attributes:
        path: what was opened.
        info: what made the bag.
        topics: by name.
        counts: messages by topic name.
        complete: whether the writer finished it.
        missing_files: names of files that metadata.yaml lists, and that are not there.
        problems: what is wrong with its files, in words.
        places: all its messages, in the order of the files.
        start_time, end_time: of its messages [ns]; both 0 without messages.
    """

    def __init__(self, path: Path | str, tolerant: bool = False) -> None:
        """Open a bag's folder, or an MCAP file by itself.

        Args:
            path: of the bag.
            tolerant: pass over damaged chunks; they are among the problems.

        Raises:
            KeepawayError: there is no bag.
        """
        self.path = Path(path)
        found = bag_files(self.path)
        if len(found.paths) > _MOST_FILES:
            raise KeepawayError(f"{path}: {len(found.paths):,} files, more than {_MOST_FILES:,}")
        self.info: dict[str, str] = {}
        self.topics: dict[str, Topic] = {}
        self.counts: dict[str, int] = {}
        self.missing_files, self.problems = found.missing, found.problems
        self._layouts: dict[tuple[int, int], tuple[dict[str, int], np.dtype[np.void]]] = {}
        self._kinds: list[Topic] = []
        self._numbers: dict[tuple[str, ...], int] = {}
        self._files = [McapFile(file, tolerant) for file in found.paths]
        for file in self._files:
            self._add(file)
        if found.message_count not in (None, self.message_count) and not found.missing:
            self.problems.append(
                f"metadata.yaml counts {found.message_count:,} messages,"
                f" the files have {self.message_count:,}"
            )
        self.complete = all(file.complete for file in self._files)
        self.places = [Place(file, run) for file in self._files for run in file.runs]
        self.start_time = min((place.run.start_time for place in self.places), default=0)
        self.end_time = max((place.run.end_time for place in self.places), default=0)

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return sum(self.counts.values())

    @property
    def kinds(self) -> list[Topic]:
        """What a block's numbers of topics stand for; two of one name differ in their types."""
        return self._kinds

    def of_type(self, message_type: str) -> list[str]:
        """The names of the topics that carry this type, in the order of their registration."""
        return [t.name for t in self.topics.values() if t.message_type == message_type]

    def codec(self, topic: str) -> cdr.Codec:
        """How to read a topic's messages, by the definition that the bag itself carries.

        Raises:
            KeepawayError: it has none that can be read, or more than one.
        """
        return self.codec_of(self.number(topic))

    def number(self, topic: str) -> int:
        """A topic's number in blocks.

        Raises:
            KeepawayError: it has messages of two types.
        """
        numbers = [number for number, kind in enumerate(self._kinds) if kind.name == topic]
        if len(numbers) > 1:
            types = " and ".join(self._kinds[n].message_type or "no type" for n in numbers)
            raise KeepawayError(f"{self.path}: {topic} carries {types}, or two versions of it")
        return numbers[0]

    def codec_of(self, number: int) -> cdr.Codec:
        """How to read the messages of a topic, by its number in blocks.

        Raises:
            KeepawayError: it has no definition that can be read.
        """
        topic = self._kinds[number]
        if not topic.is_ros:
            how = f"{topic.schema_encoding or 'no schema'}, {topic.encoding}"
            raise KeepawayError(f"{self.path}: {topic.name} is not ROS 2's ({how})")
        try:
            return cdr.codec(topic.message_type, topic.definition)
        except (ValueError, RecursionError) as error:
            raise KeepawayError(f"{self.path}: {topic.name}: {error}") from error

    def load(self, place: Place) -> Block:
        """The messages of one place, with their log times as keys.

        Raises:
            KeepawayError: it is damaged.
        """
        data, rows = place.file.unpack(place.run)
        rows = rows.copy()
        rows[:, 0] = self._renumbered(place.file, rows[:, 0])
        return Block(data, rows, rows[:, 1])

    def blocks(
        self,
        topics: Collection[str] | None = None,
        start: int | None = None,
        end: int | None = None,
        chosen: Choice | None = None,
    ) -> Iterator[Block]:
        """The messages of these topics (or of all) with start <= log_time < end [ns], in order.

        Args:
            topics: their names.
            start, end: of their log times [ns].
            chosen: which of a place's rows are wanted at all.

        Raises:
            KeepawayError: a damaged chunk.
        """
        low = -(2**63) if start is None else start
        high = 2**63 - 1 if end is None else end - 1
        wanted = None if topics is None else self._numbers_of(topics)

        def load(number: int) -> Block:
            block = self.load(self.places[number])
            own = (block.keys >= low) & (block.keys <= high)
            if wanted is not None:
                own &= np.isin(block.rows[:, 0], wanted)
            if chosen is not None:
                own &= chosen(number, block.data, block.rows)
            return Block(block.data, block.rows[own], block.keys[own])

        pieces = [
            Piece(run.start_time, run.end_time, run.size, number)
            for number, (file, run) in enumerate(self.places)
            if run.end_time >= low and run.start_time <= high
            if topics is None or file.may_have(run, topics)
        ]
        return merged(pieces, load)

    def stored(self) -> Iterator[Block]:
        """All messages as they stand in the files, which may be another order than of time.

        Raises:
            KeepawayError: a damaged chunk.
        """
        return map(self.load, self.places)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start: int | None = None,
        end: int | None = None,
        chosen: Choice | None = None,
    ) -> Iterator[Recorded]:
        """The same, message by message."""
        names = [(topic.name, topic.message_type) for topic in self._kinds]
        for data, rows, _ in self.blocks(topics, start, end, chosen):
            for number, log_time, first, last in each(rows):
                name, message_type = names[number]
                yield Recorded(name, message_type, log_time, data[first:last])

    def batches(
        self,
        topics: Collection[str],
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Batch]:
        """The same messages, many at once: topic by topic, in order within each topic.

        Raises:
            KeepawayError: a message with strings or messages in sequences, which has no dtype.
        """
        for data, rows, _ in self.blocks(topics, start, end):
            raw = np.frombuffer(data, np.uint8)
            for number in np.unique(rows[:, 0]).tolist():
                for same in _runs_of_equal_size(rows[rows[:, 0] == number]):
                    yield from self._batches_of_run(number, raw, same)

    def attachments(self) -> Iterator[tuple[str, bytes]]:
        """Name and contents of every attached file."""
        for file in self._files:
            yield from file.attachments()

    def _add(self, file: McapFile) -> None:
        self.info.update(file.info)
        self.problems += file.damaged
        for channel, topic in file.topics.items():
            name, message_type, definition, _, _, *encodings = topic
            key = (name, message_type, definition, *encodings)
            if key not in self._numbers:
                self._numbers[key] = len(self._kinds)
                self._kinds.append(topic)
            self.topics.setdefault(topic.name, topic)
            count = file.counts.get(channel, 0)
            self.counts[topic.name] = self.counts.get(topic.name, 0) + count

    def _numbers_of(self, topics: Collection[str]) -> list[int]:
        return [number for number, topic in enumerate(self._kinds) if topic.name in topics]

    def _renumbered(self, file: McapFile, channels: np.ndarray) -> np.ndarray:
        """The bag's numbers of topics for a file's channels."""
        table = np.full(2**16, -1)
        for channel in np.unique(channels).tolist():
            name, message_type, definition, _, _, *encodings = file.topics[channel]
            table[channel] = self._numbers[name, message_type, definition, *encodings]
        numbers: np.ndarray = table[channels]
        return numbers

    def _batches_of_run(self, number: int, raw: np.ndarray, index: np.ndarray) -> Iterator[Batch]:
        """Messages of one size may still differ in where they have it: split until they do not."""
        topic = self._kinds[number].name
        size = int(index[0, 3] - index[0, 2])
        rows = raw[index[:, 2, None] + np.arange(size)]
        while len(index):
            lengths, dtype = self._layout(number, rows[0])
            data = rows.view(dtype)[:, 0]
            alike = np.ones(len(index), dtype=bool)
            for name, length in lengths.items():
                alike &= data[f"{name}.length"] == length
            count = len(index) if alike.all() else int(np.argmin(alike))
            yield Batch(topic, index[:count, 1], data[:count])
            index, rows = index[count:], rows[count:]

    def _layout(self, number: int, message: np.ndarray) -> tuple[dict[str, int], np.dtype[np.void]]:
        """The lengths of a message's sequences and so its type; mostly as the last of its size."""
        key = number, len(message)
        if key in self._layouts:
            lengths, dtype = self._layouts[key]
            first = message.view(dtype)[0]
            if all(first[f"{name}.length"] == length for name, length in lengths.items()):
                return lengths, dtype
        codec = self.codec_of(number)
        lengths = codec.lengths(codec.decode(message.tobytes()))
        self._layouts[key] = lengths, codec.dtype(lengths, len(message))
        return self._layouts[key]


def is_bag(path: Path | str) -> bool:
    """Is it a bag's folder, or an MCAP file by itself?"""
    path = Path(path)
    if path.is_file():
        return path.suffix in (".mcap", ".zstd")
    return any(path.glob("*.mcap")) or any(path.glob("*.mcap.zstd"))


def _runs_of_equal_size(index: np.ndarray) -> list[np.ndarray]:
    """Split rows (channel, time, first, last) where the number of bytes changes."""
    sizes = index[:, 3] - index[:, 2]
    return np.split(index, np.flatnonzero(np.diff(sizes)) + 1)


def each(rows: np.ndarray) -> Iterator[list[int]]:
    """Rows one by one, as whole numbers."""
    for first in range(0, len(rows), _ROWS_AT_ONCE):
        yield from rows[first : first + _ROWS_AT_ONCE].tolist()
