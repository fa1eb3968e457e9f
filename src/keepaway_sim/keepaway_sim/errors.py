"""The one family of errors this package raises for bad input."""


class KeepawayError(ValueError):
    """Bad input, refused at the edge; the message names the value and the way out."""
