"""Recorded matches: MCAP bags as rosbag2 lays them out, written and read without ROS."""
