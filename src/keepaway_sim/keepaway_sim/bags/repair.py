"""A bag whose recorder was killed, written again whole."""

from __future__ import annotations

from pathlib import Path

from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.writer import BagWriter


def repair(path: Path | str, output: Path | str) -> BagReader:
    """Write a whole bag of everything that can be read of an unfinished one.

    Returns:
        The new bag, opened.

    Raises:
        KeepawayError: nothing can be read, or the output exists.
    """
    broken = BagReader(path)
    with BagWriter(output, broken.info) as whole:
        for topic in broken.topics.values():
            whole.add_topic(*topic[:2], topic.qos, topic.definition, topic.type_hash)
        for name, data in broken.attachments():
            whole.attach(name, data)
        for message in broken.messages():
            whole.write(message.topic, message.message_type, message.data, message.log_time)
    return BagReader(output)
