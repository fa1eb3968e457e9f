"""A keeper of one's own: ordinary messages, none of this project's code. It goes, and holds."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from keepaway_msgs.msg import ActionRequest, AgentStatus, Match, Perception

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class PlainKeeper(Node):
    """All that an agent has to do: say that it is ready, and answer what is due."""

    def __init__(self) -> None:
        super().__init__("keeper_1")
        name = self.get_name()
        self.status = self.create_publisher(AgentStatus, f"{name}/status", LATCHED)
        self.requests = self.create_publisher(ActionRequest, f"{name}/action_request", 10)
        self.create_subscription(Match, "match", self.on_match, LATCHED)
        self.create_subscription(Perception, f"{name}/perception", self.on_perception, 10)

    def on_match(self, match: Match) -> None:
        name = self.get_name()
        index = match.player_names.index(name)
        self.status.publish(AgentStatus(player_index=index, name=name, policy="plain", ready=True))

    def on_perception(self, seen: Perception) -> None:
        if not seen.decision_due:
            return
        nearest = min(seen.cycles_to_ball)
        if seen.ball_kickable:
            action = ActionRequest.HOLD_BALL
        elif seen.cycles_to_ball[seen.player_index] == nearest:
            action = ActionRequest.GO_TO_BALL
        else:
            action = ActionRequest.GET_OPEN
        self.requests.publish(
            ActionRequest(
                player_index=seen.player_index,
                episode=seen.episode,
                cycle=seen.cycle,
                action=action,
            )
        )


def main() -> None:
    rclpy.init()
    try:
        rclpy.spin(PlainKeeper())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():  # else it was ended while it answered
            raise


if __name__ == "__main__":
    main()
