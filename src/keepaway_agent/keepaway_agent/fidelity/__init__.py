"""This world beside the real soccer server: hold times, trajectories, learning curves."""
