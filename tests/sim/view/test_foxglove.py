"""Foxglove: every bag can be given markers, and the layout shows what is there."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from keepaway_sim.bags.marked import with_markers
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.wire.messages import MARKERS

LAYOUT = Path(__file__).resolve().parents[3] / "src/keepaway_sim/foxglove/keepaway.json"


@pytest.fixture(scope="module")
def marked(bag_3v2: Path, tmp_path_factory: pytest.TempPathFactory) -> BagReader:
    return with_markers(bag_3v2, tmp_path_factory.mktemp("marked") / "bag")


def panels(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


def test_markers_show_players_and_ball_where_they_were(marked: BagReader) -> None:
    bag = MatchBag(marked.path)
    track = bag.track(next(bag.episodes()))
    decode = marked.codec("/markers").decode
    for row, message in zip(range(30), marked.messages(["/markers"]), strict=False):
        markers = decode(message.data)["markers"]
        assert all(marker["header"]["frame_id"] == "field" for marker in markers)
        bodies = [m["pose"]["position"] for m in markers if m["ns"] in ("body", "ball")]
        ball, *players = [(place["x"], place["y"]) for place in bodies]
        assert [*players, ball] == [tuple(place) for place in track.position[row].tolist()]


def test_nothing_else_is_changed(marked: BagReader, bag_3v2: Path) -> None:
    topics = marked.topics.keys() - {"/markers"}
    assert list(marked.messages(topics)) == list(BagReader(bag_3v2).messages())
    assert marked.counts["/markers"] == marked.counts["/field_state"]
    assert marked.topics["/markers"].message_type == MARKERS


def test_the_layout_shows_topics_and_fields_that_a_bag_has(marked: BagReader) -> None:
    layout = json.loads(LAYOUT.read_text())
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    paths = re.findall(r'"(?:value|topicPath)": "(/[^"]+)"', LAYOUT.read_text())
    paths += list(layout["configById"]["3D!field"]["topics"])
    assert paths
    for path in paths:
        topic, _, field = path.partition(".")
        assert topic in marked.topics
        if field:
            name = field.split("[")[0]
            message = next(marked.messages([topic]))
            assert name in marked.codec(topic).decode(message.data)
