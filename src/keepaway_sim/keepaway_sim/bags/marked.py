"""A bag written again with markers for RViz and Foxglove."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.wire import field_messages, messages


def with_markers(path: Path | str, output: Path | str) -> BagReader:
    """Write a copy of a match's bag in which /markers show every cycle, for Foxglove and RViz.

    Raises:
        KeepawayError: no bag of a match, or the output exists.
    """
    match = MatchBag(path)
    reader, states, markers = match.reader, match.topic("field_state"), match.topic("markers")
    decode = reader.codec(states).decode
    with BagWriter(output, reader.info) as bag:
        for name, data in reader.attachments():
            bag.attach(name, data)
        for topic in reader.topics.values():
            bag.add_topic(*topic[:2], topic.qos, topic.definition, topic.type_hash)
        for message in reader.messages(reader.topics.keys() - {markers}):
            bag.write(message.topic, message.message_type, message.data, message.log_time)
            if message.topic == states:
                state = decode(message.data)
                position = np.array(state["positions"]).reshape(-1, 2)
                shown = field_messages.marker_array(
                    match.task, position, np.array(state["yaws"]), message.log_time
                )
                bag.write(markers, messages.MARKERS, shown, message.log_time)
    return BagReader(output)
