"""A bag written again with markers for RViz and Foxglove."""

from __future__ import annotations

from pathlib import Path

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.moments import Sorter
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.wire.field_messages import marker_array
from keepaway_sim.wire.messages import MARKERS


def with_markers(path: Path | str, output: Path | str, number: int | None = None) -> BagReader:
    """Write a copy of a match's bag in which /markers show every cycle, for Foxglove and RViz.

    The copy's log times are simulated, also where the bag's are the wall's.

    Args:
        path: the bag.
        output: the copy's folder.
        number: of the match whose markers are added, where the bag has several.

    Raises:
        KeepawayError: no bag of a match, or the output exists.
    """
    match = MatchBag(path, number)
    reader, states, markers = match.reader, match.topic("field_state"), match.topic("markers")
    sorter, topics = Sorter(reader, match.found), match.timeline.topics
    with BagWriter(output, reader.info) as bag:
        for name, data in reader.attachments():
            bag.attach(name, data)
        for topic in topics.values():
            bag.copy_topic(topic)
        for message in match.timeline.messages(topics.keys() - {markers}):
            bag.write(message.topic, message.message_type, message.data, message.log_time)
            if message.topic == states:
                state = sorter.state(message.data)
                position = state["positions"].reshape(-1, 2)
                shown = marker_array(match.task, position, state["yaws"], message.log_time)
                bag.write(markers, MARKERS, shown, message.log_time)
    return BagReader(output)
