"""ROS 2 nodes of the players: the only modules of this package that import rclpy."""
