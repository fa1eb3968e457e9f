"""Run every test of Gymnasium and PettingZoo that applies, by name, and write the table of them.

.venv/bin/python scripts/checks/environment_tests.py --write
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import itertools
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.env_match import check_environments_match

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # it imports old modules of its own
    from pettingzoo import test as zoo
    from pettingzoo.test.state_test import test_parallel_env, test_state, test_state_space

import keepaway_agent.environments
from keepaway_agent.environments import KeepawayAECEnv, keepaway_v0

PAGE = Path(__file__).resolve().parents[2] / "src/keepaway_agent/docs/environments.md"
BEGIN, END = "<!-- tests: begin -->", "<!-- tests: end -->"
BOTH = functools.partial(keepaway_v0.turn_based_env, teams="both")

Check = Callable[[], Any]


def _single(**settings: Any) -> Any:
    return gymnasium.make("keepaway_agent.environments:Keepaway-v0", **settings).unwrapped


def _render_test() -> None:
    zoo.render_test(lambda render_mode: keepaway_v0.env(render_mode=render_mode))


def _benchmark() -> None:
    """Its five seconds pass at once: what counts here is that it gets through."""
    with mock.patch("time.time", side_effect=itertools.count()):
        zoo.performance_benchmark(keepaway_v0.env())
        zoo.performance_benchmark(BOTH())


CHECKS: dict[str, tuple[str, Check]] = {
    "gymnasium `check_env`": ("`KeeperEnv`", lambda: check_env(_single())),
    "gymnasium `check_env`, with frames": (
        "`KeeperEnv`",
        lambda: check_env(_single(render_mode="rgb_array")),
    ),
    "gymnasium `check_environments_match`": (
        "`KeeperEnv`, twice",
        lambda: check_environments_match(_single(), _single(), 50),
    ),
    "pettingzoo `parallel_api_test`": (
        "`parallel_env`",
        lambda: zoo.parallel_api_test(keepaway_v0.parallel_env(), 300),
    ),
    "pettingzoo `parallel_seed_test`": (
        "`parallel_env`",
        lambda: zoo.parallel_seed_test(keepaway_v0.parallel_env, 100),
    ),
    "pettingzoo `max_cycles_test`": (
        "`parallel_env` and `env`",
        lambda: zoo.max_cycles_test(keepaway_v0),
    ),
    "pettingzoo `performance_benchmark`": ("`env`, `turn_based_env`", _benchmark),
    "pettingzoo `api_test`": ("`env`", lambda: zoo.api_test(keepaway_v0.env(), 200)),
    "pettingzoo `api_test`, turn by turn": (
        "`turn_based_env`",
        lambda: zoo.api_test(KeepawayAECEnv(), 200),
    ),
    "pettingzoo `api_test`, both teams": ("`turn_based_env`", lambda: zoo.api_test(BOTH(), 200)),
    "pettingzoo `seed_test`": ("`env`", lambda: zoo.seed_test(keepaway_v0.env, 50)),
    "pettingzoo `seed_test`, both teams": ("`turn_based_env`", lambda: zoo.seed_test(BOTH, 50)),
    "pettingzoo `render_test`": ("`env`", _render_test),
    "pettingzoo `test_state`": ("`env`", lambda: test_state(keepaway_v0.env(), 20)),
    "pettingzoo `test_state_space`": (
        "`env`",
        lambda: test_state_space(keepaway_v0.env()),
    ),
    "pettingzoo `test_parallel_env`": (
        "`parallel_env`",
        lambda: test_parallel_env(keepaway_v0.parallel_env()),
    ),
}
"""By name: what is tested, and the test."""

LEFT_OUT = {
    "pettingzoo `test_save_obs`": "saves observations as pictures: these are no pictures",
    "pettingzoo `bombardment_test`": "takes what `step` returns for an observation; it is None",
    "pettingzoo `manual_control_test`": "needs a person who plays by keyboard",
}
"""By name: why it does not apply."""


def outcome(check: Check) -> str:
    """Passed, with the warnings that it gave, or why not."""
    with warnings.catch_warnings(record=True) as given, _silence():
        warnings.simplefilter("always")
        try:
            check()
        except Exception as error:
            return f"**failed**: {type(error).__name__}: {error}"
    said = sorted({_plain(str(each.message)) for each in given if each.category is UserWarning})
    return "; ".join(["passed", *(f"warns: {words}" for words in said)])


def table() -> str:
    """All of them, as rows of Markdown."""
    rows = ["| test | of | outcome |", "|---|---|---|"]
    rows += [f"| {name} | {what} | {outcome(check)} |" for name, (what, check) in CHECKS.items()]
    rows += [f"| {name} | | does not apply: {why} |" for name, why in LEFT_OUT.items()]
    return "\n".join(rows)


def written() -> str:
    """The table that stands on the page."""
    text = PAGE.read_text()
    return text[text.index(BEGIN) + len(BEGIN) : text.index(END)].strip()


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """These tests print; and a window needs no screen here."""
    with (
        contextlib.redirect_stdout(io.StringIO()),
        mock.patch.dict(os.environ, {"SDL_VIDEODRIVER": "dummy"}),
        mock.patch("keepaway_agent.environments.camera.FRAMES_PER_SECOND", 10_000),
    ):
        yield


def _plain(words: str) -> str:
    return words.replace("\x1b[33m", "").replace("\x1b[0m", "").removeprefix("WARN: ").strip()


def main() -> int:
    """Print the table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help=f"write it into {PAGE.name}")
    args = parser.parse_args()
    rows = table()
    print(rows)
    if args.write:
        PAGE.write_text(PAGE.read_text().replace(written(), rows))
    return int("**failed**" in rows)


if __name__ == "__main__":
    assert keepaway_agent.environments
    sys.exit(main())
