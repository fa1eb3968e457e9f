"""How the topics of players are offered and subscribed to."""

from rclpy.qos import DurabilityPolicy, QoSProfile

PERCEPTIONS = QoSProfile(depth=10)
ANSWERS = QoSProfile(depth=200)
"""Deeper than the simulator needs: a recorder may be some cycles behind."""
STATUSES = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Latched: who subscribes later has the last one."""
MATCHES_KEPT = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""With a depth of 1 another simulator's `match` would replace the own one's."""
