"""The conformance kit's script, and its judge on logs of agents that break one rule each."""

from collections.abc import Callable

import pytest

from keepaway_agent.actions import Action
from keepaway_agent.checks.conformance import (
    ASKED,
    CHAPTERS,
    LEAVES,
    LEGAL,
    READY,
    Exchange,
    Garbage,
    Pause,
    Request,
    ScriptedMatch,
    Shown,
    script,
)
from keepaway_agent.checks.judge import answer_times, is_legal, judge, report
from keepaway_agent.errors import AgentError


def answer(shown: Shown) -> Request:
    return Request(shown.player, shown.episode, shown.cycle, Action.GO_TO_BALL, 0, [])


def well_behaved(name: str = "keeper_2") -> list[Exchange]:
    """The log of an agent that does everything right."""
    log = []
    for step in script(name):
        exchange = Exchange(step, ready=isinstance(step, ScriptedMatch))
        if isinstance(step, Shown) and step.due and not step.is_garbage:
            exchange.requests, exchange.answer_time = [answer(step)], 0.001
        log.append(exchange)
    return log


def broken(log: list[Exchange]) -> set[str]:
    return {verdict.rule for verdict in judge(log, "keeper_2", 0) if not verdict.holds}


def due(log: list[Exchange], chapter: str = "answers") -> Exchange:
    """The third exchange of a chapter in which an answer was due."""
    return [
        each
        for each in log
        if each.answer_time is not None
        and isinstance(each.step, Shown)
        and each.step.chapter == chapter
    ][2]


def test_the_script_has_something_of_every_chapter_and_is_the_same_for_a_seed() -> None:
    first, second = (list(script("taker_1", seed=4)) for _ in range(2))
    shown = [step for step in first if isinstance(step, Shown)]
    assert {step.chapter for step in shown if step.due} == set(CHAPTERS)
    assert {ScriptedMatch, Shown, Garbage, Pause} == {type(step) for step in first}
    again = [step for step in second if isinstance(step, Shown)]
    assert [(s.moment, s.due, s.stamp) for s in shown] == [
        (s.moment, s.due, s.stamp) for s in again
    ]
    assert max(abs(s.position).max() for s in shown if not s.is_garbage) < 65


def test_the_script_for_one_size_has_no_other() -> None:
    matches = {
        step for step in script("keeper_1", one_size=True) if isinstance(step, ScriptedMatch)
    }
    assert matches == {ScriptedMatch(3, 2)}


def test_a_name_that_does_not_play_is_refused() -> None:
    with pytest.raises(AgentError, match="'keeper_4': choose one of keeper_1"):
        list(script("keeper_4"))


@pytest.mark.parametrize(
    ("player", "legal"),
    [
        (0, {(0, 0), (1, 1), (1, 2), (2, 0), (3, 0)}),
        (4, {(3, 0), (4, 0), (4, 1), (4, 2)}),
    ],
)
def test_keepers_and_takers_may_ask_for_different_things(
    player: int, legal: set[tuple[int, int]]
) -> None:
    with_target = [(action, target) for action in (1, 4) for target in range(6)]
    asked = [(0, 0), (2, 0), (3, 0), (9, 0), *with_target]
    assert {each for each in asked if is_legal(*each, player=player, num_keepers=3)} == legal


def test_every_sentence_holds_for_a_good_agent() -> None:
    log = well_behaved()
    assert broken(log) == set()
    text = report(judge(log, "keeper_2", 0), answer_times(log))
    assert "FAILS" not in text
    assert "median answer time 1.00 ms" in text
    assert text.endswith("14 of 14 sentences hold")


def silent(exchange: Exchange) -> None:
    exchange.requests, exchange.answer_time = [], None


def as_another(exchange: Exchange) -> None:
    exchange.requests = [request._replace(player=0) for request in filter(None, exchange.requests)]


def illegal(exchange: Exchange) -> None:
    exchange.requests = [request._replace(action=4) for request in filter(None, exchange.requests)]


def infinite(exchange: Exchange) -> None:
    values = [float("inf")]
    exchange.requests = [
        request._replace(action_values=values) for request in filter(None, exchange.requests)
    ]


def no_request(exchange: Exchange) -> None:
    exchange.requests.append(None)


def early(exchange: Exchange) -> None:
    exchange.requests += [
        request._replace(cycle=1000) for request in filter(None, exchange.requests)
    ]


@pytest.mark.parametrize(
    ("offend", "rule"),
    [
        (silent, "answers"),
        (as_another, ASKED),
        (early, ASKED),
        (no_request, ASKED),
        (illegal, LEGAL),
        (infinite, LEGAL),
    ],
)
def test_one_offence_breaks_one_sentence(offend: Callable[[Exchange], None], rule: str) -> None:
    log = well_behaved()
    offend(due(log))
    assert broken(log) == {rule}


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_silence_is_held_against_its_chapter(chapter: str) -> None:
    log = well_behaved()
    silent(due(log, chapter))
    assert broken(log) == {chapter}


def test_speaking_in_a_pause_is_noticed() -> None:
    log = well_behaved()
    pause = next(each for each in log if isinstance(each.step, Pause))
    pause.requests.append(answer(next(s for s in script("keeper_2") if isinstance(s, Shown))))
    assert broken(log) == {"pause"}


def test_an_agent_that_never_says_it_is_ready_or_does_not_end_fails() -> None:
    log = well_behaved()
    log[0].ready = False
    assert broken(log) == {READY}
    for code in (None, 1, -15):
        assert {v.rule for v in judge(well_behaved(), "keeper_2", code) if not v.holds} == {LEAVES}


def test_an_agent_that_says_nothing_at_all_does_not_pass_by_default() -> None:
    silent_log = [Exchange(step) for step in script("keeper_2")]
    assert broken(silent_log) == {READY, ASKED, LEGAL, *CHAPTERS}
