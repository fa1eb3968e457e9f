"""ROS 2 node of transfer: the only modules of this package that import rclpy."""
