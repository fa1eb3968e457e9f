"""The one family of errors this package raises for bad input, and how often trouble is logged."""

from typing import Final

LOG_PERIOD: Final = 5.0
"""Seconds in which the same warning is logged once."""


class KeepawayError(ValueError):
    """Bad input, refused at the edge; the message names the value and the way out.

    Its text is one printable line, whatever the input was.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


class SettingError(KeepawayError):
    """A setting that does not exist, or whose value is refused."""


def one_line(text: str) -> str:
    r"""An untrusted text as one printable line: control characters are escaped.

    >>> print(one_line("red \x1b[31m, line\nbreak"))
    red \x1b[31m, line\nbreak
    """
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)
