"""A bag whose recorder was killed, or that is damaged, written again whole."""

from __future__ import annotations

from pathlib import Path

from keepaway_sim.bags.reader import BagReader, each
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError


def repair(path: Path | str, output: Path | str) -> BagReader:
    """Write a whole bag of everything that can be read of one that is not.

    Takes no more memory than reading does (see `merging`), whatever the files claim.

    Returns:
        The new bag, opened; what could not be rescued is among its problems.

    Raises:
        KeepawayError: no message can be read, or the output exists.
    """
    broken = BagReader(path, tolerant=True)
    if not broken.message_count:
        raise KeepawayError("; ".join([f"{path}: no message can be rescued", *broken.problems]))
    left_out: dict[str, int] = {}
    with BagWriter(output, broken.info) as whole:
        for topic in broken.topics.values():
            whole.copy_topic(topic)
        for name, data in broken.attachments():
            whole.attach(name, data)
        for data, rows, _ in broken.stored():
            for number, time, first, last in each(rows):
                kind = broken.kinds[number]
                if kind.message_type != broken.topics[kind.name].message_type:
                    left_out[kind.name] = left_out.get(kind.name, 0) + 1
                    continue
                whole.write(kind.name, kind.message_type, data[first:last], time)
    made = BagReader(output)
    made.problems += [problem for problem in broken.problems if "chunk" in problem]
    made.problems += [
        f"{n} messages of {name}, of two types, are left out" for name, n in left_out.items()
    ]
    return made
