"""Where the records in a chunk of an MCAP file are, found by compiled code."""

from __future__ import annotations

import numpy as np

from keepaway_sim.world.compiled import compiled, compiled_apart


def index_records(
    data: np.ndarray, is_loose: bool = False
) -> tuple[np.ndarray, np.ndarray, int, bool]:
    """Where the records in a chunk are, or those that stand outside chunks.

    Args:
        data: (n,) uint8.
        is_loose: they stand outside chunks.

    Returns:
        (n, 4) int64 of messages: channel, log time, first and last byte of the payload;
        (m, 3) int64 of schemas and channels: opcode, first and last byte;
        where the first record begins that was not read;
        whether the records up to there are whole. Outside chunks, reading ends with a record of
        another kind, or with one that is not all in the data.
    """
    num_messages, num_definitions, end, is_whole = _count(data, is_loose)
    messages = np.empty((num_messages, 4), np.int64)
    definitions = np.empty((num_definitions, 3), np.int64)
    _locate(data, end, messages, definitions)
    return messages, definitions, end, is_whole


@compiled_apart
def _count(data, is_loose):
    """How many messages, and schemas and channels there are; up to where; is it all whole?"""
    num_messages, num_definitions, end, is_whole = 0, 0, 0, True
    while end + 9 <= len(data):
        opcode, length = data[end], _unsigned(data, end + 1, 8)
        if is_loose and (opcode < 3 or opcode > 5):
            break
        if length < 0 or length > len(data) - end - 9 or (opcode == 5 and length < 22):
            is_whole = is_loose
            break
        num_messages += opcode == 5
        num_definitions += opcode == 3 or opcode == 4
        end += 9 + length
    return num_messages, num_definitions, end, is_whole


@compiled_apart
def _locate(data, end, messages, definitions):
    """Fill in the arrays for the records before `end`."""
    position, m, d = 0, 0, 0
    while position < end and position + 9 <= len(data):
        opcode, body = data[position], position + 9
        position = body + _unsigned(data, position + 1, 8)
        if opcode == 5:
            messages[m, 0] = _unsigned(data, body, 2)
            messages[m, 1] = _unsigned(data, body + 6, 8)
            messages[m, 2], messages[m, 3] = body + 22, position
            m += 1
        elif opcode == 3 or opcode == 4:
            definitions[d, 0], definitions[d, 1], definitions[d, 2] = opcode, body, position
            d += 1


@compiled
def _unsigned(data, start, size):
    value = np.int64(0)
    for k in range(size):
        value |= np.int64(data[start + k]) << (8 * k)
    return value
