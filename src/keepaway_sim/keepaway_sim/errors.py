"""The one family of errors this package raises for bad input, and how often trouble is logged."""

from typing import Final

LOG_PERIOD: Final = 5.0
"""Seconds in which the same warning is logged once."""


class KeepawayError(ValueError):
    """Bad input, refused at the edge; the message names the value and the way out."""


class SettingError(KeepawayError):
    """A setting that does not exist, or whose value is refused."""
