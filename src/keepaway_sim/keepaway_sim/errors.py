"""The one family of errors this package raises for bad input."""


class KeepawayError(ValueError):
    """Bad input, refused at the edge; the message names the value and the way out."""


class SettingError(KeepawayError):
    """A setting that does not exist, or whose value is refused."""
