"""A simulator that only reads out a script (`conformance.script`) and listens: what tests an agent.

It has the simulator's name and topics, and imports nothing of it.
"""

import secrets
import time
from collections.abc import Callable, Iterable
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock

from keepaway_agent.checks import conformance
from keepaway_agent.checks.conformance import Exchange, Garbage, Pause, Request, Shown, Step
from keepaway_agent.errors import AgentError
from keepaway_agent.nodes.qos import ANSWERS, MATCHES_KEPT, STATUSES
from keepaway_agent.texts import one_line
from keepaway_msgs.msg import ActionRequest, AgentStatus, Match, Perception

RESEND_PERIOD = 0.25  # [s] an unanswered perception is sent again, as the simulator does
SILENCE = 0.02  # [s] to listen where no answer is due
READY_PATIENCE = 300.0  # [s] for an agent to start, some of which compile

Spin = Callable[[float], None]
"""Lets ROS handle what has come, or waits for it, at most this number of seconds."""


class ScriptedSimulator(Node):
    """Publishes a script's steps to one agent.

    Attributes:
        log: an `Exchange` for every step sent so far.
    """

    def __init__(self, name: str, **node_options: Any) -> None:
        """Listen to the agent called `name`; `node_options` are for `rclpy.node.Node`."""
        super().__init__("simulator", **node_options)
        self.log: list[Exchange] = []
        self._name, self._ready_as, self._said_at = name, -1, 0.0
        self._match_id, self._others_match = secrets.randbelow(2**63 - 1) + 1, ""
        self._match = self.create_publisher(Match, "match", STATUSES)
        self._simulated_time = self.create_publisher(Clock, "/clock", ANSWERS)
        self._perception = self.create_publisher(Perception, f"{name}/perception", ANSWERS)
        self.create_subscription(
            ActionRequest, f"{name}/action_request", self._on_request, ANSWERS, raw=True
        )
        self.create_subscription(AgentStatus, f"{name}/status", self._on_status, STATUSES)
        self.create_subscription(Match, "match", self._on_match, MATCHES_KEPT)

    def perform(
        self, steps: Iterable[Step], spin: Spin, is_there: Callable[[], bool], patience: float
    ) -> None:
        """Say all steps.

        Args:
            steps: of the script.
            spin: handles what has come.
            is_there: whether the agent's process still runs; one that ended is not waited for.
            patience: for an answer [s].

        Raises:
            AgentError: another simulator talks to the agent's topics, too.
        """
        self._spin, self._is_there, self._patience = spin, is_there, patience
        for step in steps:
            self.log.append(Exchange(step))
            if isinstance(step, conformance.ScriptedMatch):
                self._announce(step)
            elif isinstance(step, Shown):
                self._show(step)
            elif isinstance(step, Garbage):
                self._perception.publish(step.data)
                self._listen(SILENCE)
            elif isinstance(step, Pause):
                self._listen(step.seconds)

    def _announce(self, match: conformance.ScriptedMatch) -> None:
        self._ready_as = -1
        self._match.publish(match_message(match, self._match_id))
        index = match.player_names.index(self._name)
        exchange = self.log[-1]
        self._listen(READY_PATIENCE, lambda: self._ready_as == index)
        exchange.ready = self._ready_as == index

    def _show(self, shown: Shown) -> None:
        self._simulated_time.publish(Clock(clock=time_message(shown.stamp)))
        message, self._said_at = perception_message(shown), time.monotonic()
        if not shown.due or shown.is_garbage:
            self._perception.publish(message)
            self._listen(SILENCE)
            return
        until = self._said_at + self._patience
        while not self._is_answered() and self._is_there() and time.monotonic() < until:
            self._perception.publish(message)
            self._listen(min(RESEND_PERIOD, until - time.monotonic()), self._is_answered)

    def _is_answered(self) -> bool:
        return self.log[-1].answer_time is not None

    def _listen(self, seconds: float, is_done: Callable[[], bool] = lambda: False) -> None:
        until = time.monotonic() + seconds
        while not is_done() and self._is_there() and (left := until - time.monotonic()) > 0:
            self._spin(min(left, 0.1))
            if self._others_match:
                raise AgentError(
                    f"another simulator publishes `match` here ({self._others_match}): what the"
                    " agent answers may be meant for it; choose another domain, or end the other"
                )

    def _on_request(self, data: bytes) -> None:
        if not self.log:
            return
        exchange, request = self.log[-1], read_request(data)
        exchange.requests.append(request)
        shown = exchange.step
        if exchange.answer_time is not None or request is None or not isinstance(shown, Shown):
            return
        if shown.due and (request.episode, request.cycle) == shown.moment:
            exchange.answer_time = time.monotonic() - self._said_at

    def _on_match(self, match: Match) -> None:
        if match.match_id != self._match_id:
            self._others_match = one_line(match.task)

    def _on_status(self, status: AgentStatus) -> None:
        if status.ready and status.name == self._name:
            self._ready_as = status.player_index


def match_message(match: conformance.ScriptedMatch, match_id: int) -> Match:
    """What is played, as a message."""
    return Match(
        match_id=match_id,
        task=f"{match.num_keepers}v{match.num_takers}",
        profile="2005",
        num_keepers=match.num_keepers,
        num_takers=match.num_takers,
        field_length=conformance.FIELD_SIZE,
        field_width=conformance.FIELD_SIZE,
        cycle_time=conformance.CYCLE_TIME,
        visible_angle=6.283185307179586,
        player_names=match.player_names,
        config_json="{}",
    )


def perception_message(shown: Shown) -> Perception:
    """A perception, as a message."""
    positions = shown.position.ravel().tolist()
    return Perception(
        stamp=time_message(shown.stamp),
        player_index=shown.player,
        episode=shown.episode,
        cycle=shown.cycle,
        outcome=int(shown.outcome),
        decision_due=shown.due,
        ball_kickable=shown.kickable,
        positions=positions,
        velocities=[0.0] * len(positions),
        ages=shown.age.tolist(),
        cycles_to_ball=shown.cycles_to_ball.tolist(),
    )


def time_message(seconds: float) -> Time:
    """A time of 0 s or later, as a message."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def read_request(data: bytes) -> Request | None:
    """The request in an ActionRequest's bytes; None where they are none."""
    try:
        message = deserialize_message(data, ActionRequest)
    except Exception:  # rclpy raises whatever its layers do
        return None
    return Request(
        message.player_index,
        message.episode,
        message.cycle,
        message.action,
        message.target,
        list(message.action_values),
    )
