"""A bag of one or more MCAP files, read in the order of time."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from keepaway_sim.bags.mcap_reader import MAGIC, Chunk, McapFile
from keepaway_sim.bags.topics import Batch, Recorded, Topic
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire import cdr


class BagReader:
    """Reads a bag, also one whose writer was killed: up to its last whole chunk.

    Messages come in the order in which they were written. Memory does not grow with the bag: one
    chunk is unpacked at a time.

    Attributes:
        path: what was opened.
        info: what made the bag.
        topics: by name.
        counts: messages by topic name.
        complete: whether the writer finished it.
        start_time, end_time: of its messages [ns]; both 0 without messages.
    """

    def __init__(self, path: Path | str) -> None:
        """Open a bag's folder, or an MCAP file by itself.

        Raises:
            KeepawayError: there is no bag.
        """
        self.path = Path(path)
        self.info: dict[str, str] = {}
        self.topics: dict[str, Topic] = {}
        self.counts: dict[str, int] = {}
        self._layouts: dict[tuple[str, int], tuple[dict[str, int], np.dtype[np.void]]] = {}
        self._files = [McapFile(file) for file in _mcap_files(self.path)]
        for file in self._files:
            self.info.update(file.info)
            for topic, count in file.contents():
                self.topics.setdefault(topic.name, topic)
                self.counts[topic.name] = self.counts.get(topic.name, 0) + count
        self.complete = all(file.complete for file in self._files)
        chunks = [chunk for file in self._files for chunk in file.chunks]
        self.start_time = min((chunk.start_time for chunk in chunks), default=0)
        self.end_time = max((chunk.end_time for chunk in chunks), default=0)

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return sum(self.counts.values())

    def of_type(self, message_type: str) -> list[str]:
        """The names of the topics that carry this type, in the order of their registration."""
        return [t.name for t in self.topics.values() if t.message_type == message_type]

    def codec(self, topic: str) -> cdr.Codec:
        """How to read a topic's messages, by the definition that the bag itself carries."""
        entry = self.topics[topic]
        return cdr.codec(entry.message_type, entry.definition)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Recorded]:
        """The messages of these topics (or of all) with start <= log_time < end [ns]."""
        for file, chunk in self._chunks(start, end):
            data, index = file.unpack(chunk)
            for channel, log_time, first, last in index.tolist():
                topic = file.topic(channel)
                if topics is not None and topic.name not in topics:
                    continue
                if (start is None or log_time >= start) and (end is None or log_time < end):
                    yield Recorded(topic.name, topic.message_type, log_time, data[first:last])

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
        for file, chunk in self._chunks(start, end):
            data, index = file.unpack(chunk)
            low = chunk.start_time if start is None else start
            high = chunk.end_time + 1 if end is None else end
            index = index[(index[:, 1] >= low) & (index[:, 1] < high)]
            raw = np.frombuffer(data, np.uint8)
            for channel in np.unique(index[:, 0]):
                topic = file.topic(int(channel))
                if topic.name in topics:
                    of_topic = index[index[:, 0] == channel]
                    for same in _runs_of_equal_size(of_topic):
                        yield from self._batches_of_run(topic.name, raw, same)

    def attachments(self) -> Iterator[tuple[str, bytes]]:
        """Name and contents of every attached file."""
        for file in self._files:
            yield from file.attachments()

    def _chunks(self, start: int | None, end: int | None) -> Iterator[tuple[McapFile, Chunk]]:
        for file in self._files:
            for chunk in file.chunks:
                if start is not None and chunk.end_time < start:
                    continue
                if end is not None and chunk.start_time >= end:
                    continue
                yield file, chunk

    def _batches_of_run(self, topic: str, raw: np.ndarray, index: np.ndarray) -> Iterator[Batch]:
        """Messages of one size may still differ in where they have it: split until they do not."""
        size = int(index[0, 3] - index[0, 2])
        rows = raw[index[:, 2, None] + np.arange(size)]
        while len(index):
            lengths, dtype = self._layout(topic, rows[0])
            data = rows.view(dtype)[:, 0]
            alike = np.ones(len(index), dtype=bool)
            for name, length in lengths.items():
                alike &= data[f"{name}.length"] == length
            count = len(index) if alike.all() else int(np.argmin(alike))
            yield Batch(topic, index[:count, 1], data[:count])
            index, rows = index[count:], rows[count:]

    def _layout(self, topic: str, message: np.ndarray) -> tuple[dict[str, int], np.dtype[np.void]]:
        """The lengths of a message's sequences and so its type; mostly as the last of its size."""
        key = self.topics[topic].message_type, len(message)
        if key in self._layouts:
            lengths, dtype = self._layouts[key]
            first = message.view(dtype)[0]
            if all(first[f"{name}.length"] == length for name, length in lengths.items()):
                return lengths, dtype
        codec = self.codec(topic)
        lengths = codec.lengths(codec.decode(message.tobytes()))
        self._layouts[key] = lengths, codec.dtype(lengths, len(message))
        return self._layouts[key]


def is_bag(path: Path | str) -> bool:
    """Is it a bag's folder, or an MCAP file by itself?"""
    path = Path(path)
    return path.suffix == ".mcap" if path.is_file() else any(path.glob("*.mcap"))


def _mcap_files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    listed = sorted(path.glob("*.mcap"), key=_file_number)
    if not listed:
        raise KeepawayError(f"{path}: no bag there (a folder with an .mcap file, or such a file)")
    # A writer that was killed, or found the disk full, may only just have begun its last file.
    return [file for file in listed if file.stat().st_size >= len(MAGIC)] or listed[:1]


def _file_number(path: Path) -> int:
    number = re.search(r"_(\d+)$", path.stem)
    return int(number[1]) if number else 0


def _runs_of_equal_size(index: np.ndarray) -> list[np.ndarray]:
    """Split rows (channel, time, first, last) where the number of bytes changes."""
    sizes = index[:, 3] - index[:, 2]
    return np.split(index, np.flatnonzero(np.diff(sizes)) + 1)
