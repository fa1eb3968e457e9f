"""ROS 2 nodes of the world: the only modules of this package that import rclpy."""
