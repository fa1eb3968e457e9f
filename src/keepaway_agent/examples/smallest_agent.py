"""The smallest complete agent, keeper or taker: it goes to the ball, holds it, gets open."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from keepaway_msgs.msg import ActionRequest, AgentStatus, Match, Perception

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class SmallestAgent(Node):
    """One player; its node's name is the player's: `--ros-args -r __node:=keeper_2`."""

    def __init__(self) -> None:
        super().__init__("keeper_1")
        name, self.match = self.get_name(), Match()
        self.status = self.create_publisher(AgentStatus, f"{name}/status", LATCHED)
        self.requests = self.create_publisher(ActionRequest, f"{name}/action_request", 10)
        self.create_subscription(Match, "match", self.on_match, LATCHED)
        self.create_subscription(Perception, f"{name}/perception", self.on_perception, 10)

    def on_match(self, match: Match) -> None:
        """Take a place in a new match, and publish that it is ready."""
        name, self.match = self.get_name(), match
        self.index = match.player_names.index(name)
        status = AgentStatus(player_index=self.index, name=name, policy="mine", ready=True)
        self.status.publish(status)

    def on_perception(self, seen: Perception) -> None:
        """Answer what is due, by its episode and cycle."""
        if not seen.decision_due or len(seen.cycles_to_ball) != len(self.match.player_names):
            return
        action, target = self.choose(seen)
        answer = ActionRequest(player_index=self.index, action=action, target=target)
        answer.episode, answer.cycle = seen.episode, seen.cycle
        self.requests.publish(answer)

    def choose(self, seen):
        """One of ActionRequest's actions, and its target: this is the part to change."""
        is_keeper = self.index < self.match.num_keepers
        if is_keeper and seen.ball_kickable:
            return ActionRequest.HOLD_BALL, 0
        if is_keeper and seen.cycles_to_ball[self.index] > min(seen.cycles_to_ball):
            return ActionRequest.GET_OPEN, 0
        return ActionRequest.GO_TO_BALL, 0


def main(agent=SmallestAgent):
    """Play until SIGINT or SIGTERM."""
    rclpy.init()
    try:
        rclpy.spin(agent())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():  # else it was ended while it answered
            raise


if __name__ == "__main__":
    main()
