"""Who plays, how a match begins and goes on. Knows no ROS."""
