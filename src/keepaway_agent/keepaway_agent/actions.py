"""What a player may ask for, why an episode ended, who plays: the numbers of the messages.

An agent imports nothing of the simulator, so the simulator has its own copy of these; a test holds
both against the constants in the messages.
"""

from enum import IntEnum
from typing import Final


class Action(IntEnum):
    """A high-level action that an agent requests for its player."""

    HOLD_BALL = 0  # stay with the ball and shield it
    PASS_BALL = 1  # kick it to the team-mate that the request's target names
    GET_OPEN = 2  # run to where a team-mate can pass to
    GO_TO_BALL = 3  # run to where the ball can be reached soonest
    MARK_KEEPER = 4  # stand between the ball and the keeper that the request's target names


class Outcome(IntEnum):
    """Why an episode ended."""

    IN_PLAY = 0
    TAKEN_AWAY = 1
    OUT_OF_BOUNDS = 2
    ABORTED = 3  # cut off from outside (reset, shutdown): its end teaches nothing


class Role(IntEnum):
    """A player's team."""

    KEEPER = 0
    TAKER = 1


NO_TARGET: Final = 0
"""The target in a request whose action has none."""
NEVER: Final = 65535
"""Age [cycles] of what was never perceived."""
UNREACHABLE: Final = 65535
"""Cycles to the ball when they are not known."""


def keeper_action_names(num_keepers: int) -> tuple[str, ...]:
    """What a keeper with the ball chooses from, in the order of its action values.

    >>> keeper_action_names(3)
    ('hold', 'pass_k2', 'pass_k3')
    """
    return ("hold", *(f"pass_k{rank}" for rank in range(2, num_keepers + 1)))


def taker_action_names(num_keepers: int) -> tuple[str, ...]:
    """What a learning taker chooses from, in the order of its action values.

    >>> taker_action_names(3)
    ('go_to_ball', 'mark_k2', 'mark_k3')
    """
    return ("go_to_ball", *(f"mark_k{rank}" for rank in range(2, num_keepers + 1)))


def action_names(role: Role, num_keepers: int) -> tuple[str, ...]:
    """What a learner of this role chooses from, in the order of its action values."""
    names = keeper_action_names if role == Role.KEEPER else taker_action_names
    return names(num_keepers)
