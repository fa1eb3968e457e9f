"""Policies, and one player as an object. Knows no simulator."""
