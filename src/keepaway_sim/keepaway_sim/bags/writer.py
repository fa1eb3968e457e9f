"""Bags: what was said in a match, as MCAP files that any ROS 2 tool opens. Needs no ROS.

A bag is a folder like rosbag2's: `NAME/NAME_0.mcap`, in long recordings `NAME/NAME_1.mcap` and so
on (profile `ros2`, CDR messages, full `ros2msg` definitions, chunked and compressed), and
`NAME/metadata.yaml` (version 9). Times are simulated time [ns]. What made the bag (task, seed,
configuration, code version, policies) is in it too, as MCAP metadata "keepaway" and as rosbag2's
`custom_data`; weights may be attached.

Sources: https://mcap.dev/spec, https://mcap.dev/spec/registry, rosbag2's `metadata_io.cpp` and
`rosbag2_storage_mcap`.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from keepaway_sim.bags.mcap_writer import (
    CHUNK_SIZE,
    COMPRESSIONS,
    FILE_CHUNKS,
    McapFileWriter,
    Part,
    span,
    to_yaml,
)
from keepaway_sim.bags.topics import INFO, Qos, Topic, default_qos
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire import definitions


class BagWriter:
    """Writes one bag. Use it in a `with`: the bag is whole when it is left, however that happens.

    A file keeps an index of its chunks in memory until it is finished, so after `file_chunks` of
    them the bag continues in a next file, as rosbag2's do: memory does not grow with the bag, and
    files that are finished stay whole whatever happens later.

    Attributes:
        path: the bag's folder.
        topics: by name, those registered so far.
        message_count: messages written so far.
    """

    def __init__(
        self,
        path: Path | str,
        info: Mapping[str, str] | None = None,
        compression: str = "zstd",
        chunk_size: int = CHUNK_SIZE,
        flush_interval: float = 1.0,
        file_chunks: int = FILE_CHUNKS,
    ) -> None:
        """Make the bag's folder and begin its first file.

        Args:
            path: a folder that does not exist yet.
            info: what made the bag.
            compression: of the chunks: "zstd", "lz4" or "none".
            chunk_size: a chunk ends when it has this number of bytes,
            flush_interval: or after so long [s, wall time]: what is lost if the writer is killed.
                With `math.inf` equal messages make equal files.
            file_chunks: a file ends after about this number of chunks.

        Raises:
            KeepawayError: the folder exists, or there is no such compression.
        """
        self.path = Path(path)
        if compression not in COMPRESSIONS:
            raise KeepawayError(
                f"compression={compression!r}: choose from {', '.join(COMPRESSIONS)}"
            )
        try:
            self.path.mkdir(parents=True)
        except FileExistsError:
            raise KeepawayError(
                f"{self.path} exists already: choose another name, or remove it"
            ) from None
        except OSError as error:
            raise KeepawayError(f"{self.path} cannot be made: {error}") from error
        self.message_count = 0
        self._info: dict[str, str] = {}
        self.topics: dict[str, Topic] = {}
        self._counts: dict[str, int] = {}
        self._packing = chunk_size, COMPRESSIONS[compression], file_chunks
        self._finished: list[Part] = []
        self._is_open = True
        self._flush_interval, self._flushed = flush_interval, time.monotonic()
        self._file = self._next_file()
        self.add_info(**(info or {}))
        self.flush()

    def add_info(self, **entries: str) -> None:
        """Say more about what made the bag; written at once, later entries win.

        Errors as in `write`.
        """
        if entries:
            self._info.update(entries)
            with self._giving_up():
                self._file.add_metadata(INFO, entries)

    def add_topic(
        self,
        name: str,
        message_type: str,
        qos: Qos | None = None,
        definition: str | None = None,
        type_hash: str | None = None,
    ) -> None:
        """Register a topic, unless it is.

        Args:
            name: in full, "/keeper_1/perception".
            message_type: "keepaway_msgs/msg/Perception".
            qos: how its publisher offers it; latched for matches and agents' status by default.
            definition: its ros2msg text; by default that of the installed message.
            type_hash: its REP-2011 hash; by default that of the installed message.

        Raises:
            KeepawayError: registered with another type, or the message is not installed.
        """
        known = self.topics.get(name)
        if known is not None:
            if known.message_type != message_type:
                raise KeepawayError(f"{name} carries {known.message_type}, not {message_type}")
            return
        qos = qos or default_qos(message_type)
        if definition is None:
            definition = definitions.definition(message_type)
            type_hash = definitions.type_hash(message_type)
        self.copy_topic(Topic(name, message_type, definition, type_hash or "", qos))

    def copy_topic(self, topic: Topic) -> None:
        """Register a topic as another bag has it, of whatever type, unless one of its name is."""
        if topic.name not in self.topics:
            self.topics[topic.name], self._counts[topic.name] = topic, 0
            self._file.add_topic(topic)

    def write(self, topic: str, message_type: str, data: bytes, log_time: int) -> None:
        """Write one message.

        Args:
            topic: its name in full; registered by its first message.
            message_type: for example "keepaway_msgs/msg/Perception".
            data: CDR bytes.
            log_time: simulated time [ns].

        Raises:
            KeepawayError: the disk is full, or the like; this writer then writes no more, what it
                has written can be read, and `repair` makes a whole bag of it.
        """
        if topic not in self._counts:
            self.add_topic(topic, message_type)
        try:
            if self._file.room <= 0:
                self._finish_file()
                self._file = self._next_file()
            self._file.write(topic, log_time, data, self._counts[topic])
        except OSError as error:
            raise self._given_up(error) from error
        self._counts[topic] += 1
        self.message_count += 1
        if time.monotonic() - self._flushed > self._flush_interval:
            self.flush()

    def attach(self, name: str, data: bytes, media_type: str = "application/octet-stream") -> None:
        """Put a file into the bag, for example the weights that a player started from.

        Errors as in `write`.
        """
        with self._giving_up():
            self._file.attach(name, data, media_type)

    def flush(self) -> None:
        """End the chunk and give everything to the operating system; errors as in `write`."""
        with self._giving_up():
            self._file.flush()
        self._flushed = time.monotonic()

    def close(self) -> None:
        """Finish the file and write `metadata.yaml`; errors as in `write`.

        Nothing happens the second time, or after an error.
        """
        if not self._is_open:
            return
        text = to_yaml({"rosbag2_bagfile_information": self._metadata()})
        with self._giving_up():
            self._finish_file()
            (self.path / "metadata.yaml").write_text(text)
        self._is_open = False

    def discard(self) -> None:
        """Take the bag away again: there was nothing to record.

        Nothing happens after `close`, or after an error.
        """
        if not self._is_open:
            return
        self._is_open = False
        self._file.abandon()
        with self._giving_up():
            for part in (*self._finished, self._file.part):
                (self.path / part.name).unlink(missing_ok=True)
            self.path.rmdir()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _next_file(self) -> McapFileWriter:
        path = self.path / f"{self.path.name}_{len(self._finished)}.mcap"
        return McapFileWriter(path, *self._packing, self.topics.values())

    def _finish_file(self) -> None:
        self._file.add_metadata("rosbag2", {"serialized_metadata": to_yaml(self._metadata())})
        self._file.finish()
        self._finished.append(self._file.part)

    @contextlib.contextmanager
    def _giving_up(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._given_up(error) from error

    def _given_up(self, error: OSError) -> KeepawayError:
        """Let go of a file that cannot be written; what is still in memory is lost."""
        self._file.abandon()
        self._is_open = False
        return KeepawayError(
            f"{self.path} cannot be written any more: {error}; scripts/repair_bag.py makes a whole"
            " bag of what is there"
        )

    def _metadata(self) -> dict[str, Any]:
        """What rosbag2 says of a bag: here, of what was written so far."""
        parts = [*self._finished, self._file.part]
        written = [part for part in parts if part.message_count]
        start = min((part.start for part in written), default=0)
        end = max((part.end for part in written), default=0)
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **span(start, end, self.message_count),
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": topic.name,
                        "type": topic.message_type,
                        "serialization_format": topic.encoding,
                        "offered_qos_profiles": [topic.qos.to_dict()],
                        "type_description_hash": topic.type_hash,
                    },
                    "message_count": self._counts[topic.name],
                }
                for topic in self.topics.values()
            ],
            "compression_format": "",  # of whole files or messages; chunks are MCAP's own matter
            "compression_mode": "",
            "relative_file_paths": [part.name for part in parts],
            "files": [{"path": part.name, **span(*part[1:])} for part in parts],
            "custom_data": self._info or None,
            "ros_distro": "jazzy",
        }
