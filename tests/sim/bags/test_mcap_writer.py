"""Messages packed in one go make the file that the MCAP library makes."""

import io
import random

import pytest
from mcap.writer import CompressionType, Writer

from keepaway_sim.bags.mcap_writer import FastWriter


def written(kind: type[Writer], num_messages: int, compression: CompressionType) -> bytes:
    """A file of two channels, with chunks of all lengths and times in no order."""
    random.seed(num_messages)
    stream = io.BytesIO()
    writer = kind(stream, chunk_size=2000, compression=compression)
    writer.start(profile="ros2", library="test")
    schema = writer.register_schema("a/msg/B", "ros2msg", b"int32 x")
    channels = [writer.register_channel(topic, "cdr", schema, {}) for topic in ("/a", "/b")]
    for number in range(num_messages):
        data, time = random.randbytes(random.randrange(300)), random.randrange(2**50)
        writer.add_message(random.choice(channels), time, data, random.randrange(2**50), number)
        if random.random() < 0.02:
            writer.flush()
    writer.add_metadata("info", {"seed": str(num_messages)})
    writer.finish()
    return stream.getvalue()


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("num_messages", [0, 1, 7, 500])
def test_the_file_is_equal_to_the_librarys(num_messages: int, compression: CompressionType) -> None:
    expected = written(Writer, num_messages, compression)
    assert written(FastWriter, num_messages, compression) == expected
