"""Messages as bytes: CDR, the messages of a match, markers. Knows no files and no ROS."""
