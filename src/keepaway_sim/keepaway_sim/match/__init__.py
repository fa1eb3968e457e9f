"""Who plays, how a match begins and continues. Knows no ROS."""
