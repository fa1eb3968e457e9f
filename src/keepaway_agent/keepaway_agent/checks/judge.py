"""The sentences of the agent contract, held against what an agent answered."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from keepaway_agent.actions import Action, Role
from keepaway_agent.checks.conformance import (
    ASKED,
    CHAPTERS,
    LEAVES,
    LEGAL,
    MOST_ACTION_VALUES,
    READY,
    Exchange,
    Pause,
    ScriptedMatch,
    Shown,
)


class Verdict(NamedTuple):
    """Whether a sentence of the contract holds."""

    rule: str
    sentence: str
    holds: bool
    evidence: str


def is_legal(action: int, target: int, player: int, num_keepers: int) -> bool:
    """Whether a player may ask for this.

    >>> is_legal(Action.PASS_BALL, 0, player=0, num_keepers=3)
    False
    """
    role = Role.KEEPER if player < num_keepers else Role.TAKER
    if action == Action.GO_TO_BALL:
        return True
    if action == Action.MARK_KEEPER:
        return role == Role.TAKER and target < num_keepers
    if action == Action.PASS_BALL:
        return role == Role.KEEPER and target < num_keepers and target != player
    return role == Role.KEEPER and action in (Action.HOLD_BALL, Action.GET_OPEN)


def judge(log: Sequence[Exchange], name: str, exit_code: int | None) -> list[Verdict]:
    """Sentence by sentence, whether the contract holds.

    Args:
        log: of the whole script.
        name: of the player.
        exit_code: with which the agent ended on the signal; None: it did not, and was killed.
    """
    said = [each.ready for each in log if isinstance(each.step, ScriptedMatch)]
    left = "did not end and was killed" if exit_code is None else f"exit code {exit_code}"
    return [
        Verdict(
            READY,
            "reports that it is ready for every match, with its own name and index",
            all(said),
            f"{sum(said)} of {len(said)} matches",
        ),
        *(_judge_chapter(log, chapter) for chapter in CHAPTERS if _due(log, chapter)),
        _judge_requests(log, name),
        _judge_legality(log),
        Verdict(LEAVES, "ends on SIGTERM with exit code 0", exit_code == 0, left),
    ]


def answer_times(log: Sequence[Exchange]) -> list[float]:
    """Seconds from saying a perception to hearing its answer, in order."""
    return [each.answer_time for each in log if each.answer_time is not None]


def report(verdicts: Sequence[Verdict], times: Sequence[float]) -> str:
    """The verdicts as a table, with how quick the agent was."""
    width = max(len(each.sentence) for each in verdicts)
    rows = [
        f"{'holds' if each.holds else 'FAILS'}  {each.sentence:{width}}  {each.evidence}"
        for each in verdicts
    ]
    if times:
        late = sorted(times)[int(0.95 * len(times))]
        median = statistics.median(times)
        rows.append(f"median answer time {1e3 * median:.2f} ms, 95 % within {1e3 * late:.2f} ms")
    num_held = sum(each.holds for each in verdicts)
    return "\n".join([*rows, f"{num_held} of {len(verdicts)} sentences hold"])


def _due(log: Sequence[Exchange], chapter: str) -> list[Exchange]:
    """A chapter's exchanges in which an answer was due."""
    return [
        each
        for each in log
        if isinstance(each.step, Shown)
        and each.step.due
        and not each.step.is_garbage
        and each.step.chapter == chapter
    ]


def _judge_chapter(log: Sequence[Exchange], chapter: str) -> Verdict:
    due = _due(log, chapter)
    num_answered = sum(each.answer_time is not None for each in due)
    evidence = f"{num_answered} of {len(due)} answered"
    holds = num_answered == len(due)
    if chapter == "pause":
        spoken = sum(len(each.requests) for each in log if isinstance(each.step, Pause))
        holds, evidence = holds and not spoken, f"{evidence}, {spoken} published in the pause"
    return Verdict(chapter, CHAPTERS[chapter], holds, evidence)


def _judge_requests(log: Sequence[Exchange], name: str) -> Verdict:
    """Whether every request is its own player's answer to a perception that was due."""
    wrong: list[str] = []
    total, index, moments = 0, -1, set[tuple[int, int]]()
    for each in log:
        if isinstance(each.step, ScriptedMatch):
            index, moments = each.step.player_names.index(name), set()
        elif isinstance(each.step, Shown) and each.step.due:
            moments.add(each.step.moment)
        total += len(each.requests)
        for request in each.requests:
            if request is None:
                wrong.append("bytes that are no ActionRequest")
            elif request.player != index:
                wrong.append(f"player_index {request.player}, not {index}")
            elif (request.episode, request.cycle) not in moments:
                wrong.append(f"episode {request.episode} cycle {request.cycle} was not due")
    return _verdict(ASKED, "publishes only answers to what was due, in its own name", total, wrong)


def _judge_legality(log: Sequence[Exchange]) -> Verdict:
    wrong: list[str] = []
    total, num_keepers = 0, 0
    for each in log:
        if isinstance(each.step, ScriptedMatch):
            num_keepers = each.step.num_keepers
        for request in filter(None, each.requests):
            total += 1
            if not is_legal(request.action, request.target, request.player, num_keepers):
                wrong.append(f"action {request.action} target {request.target}")
            elif len(request.action_values) > MOST_ACTION_VALUES:
                wrong.append(f"{len(request.action_values)} action values")
            elif not np.isfinite(request.action_values).all():
                wrong.append("action values that are not finite")
    return _verdict(LEGAL, "asks only for what its player may do", total, wrong)


def _verdict(rule: str, sentence: str, total: int, wrong: Sequence[str]) -> Verdict:
    evidence = f"{total - len(wrong)} of {total} requests"
    if wrong:
        evidence += f"; the first that is not: {wrong[0]}"
    return Verdict(rule, sentence, total > 0 and not wrong, evidence)
