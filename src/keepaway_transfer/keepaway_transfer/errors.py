"""What this package raises when it is given something it cannot work with."""

from keepaway_sim.errors import KeepawayError


class TransferError(KeepawayError):
    """Base of every error of this package; the message names the offending value."""


class MappingError(TransferError):
    """A mapping that leaves a variable or an action open, or names one that does not exist."""


class StudyError(TransferError):
    """Settings that make no study, or that differ from those of the results at hand."""


class LogError(TransferError):
    """A keepaway log (.kwy) that cannot be read."""
