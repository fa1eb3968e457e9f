"""Trials of learning players in one process or many, and their results on disk."""
