"""Texts of others, as they may stand in a message, in a file or on a terminal."""

from typing import Final

MAX_TEXT: Final = 10_000
"""Characters of a text that is kept."""
MAX_SHOWN: Final = 200
"""Characters of a value that a message shows."""


def one_line(text: str) -> str:
    r"""A text as one printable line of at most MAX_TEXT characters; others are escaped.

    A terminal obeys control characters, and a name with a line break looks like two.

    >>> one_line("run \x1b[31m")
    'run \\x1b[31m'
    """
    kept = text if len(text) <= MAX_TEXT else text[: MAX_TEXT // 10] + " ..."
    plain = "".join(each if each.isprintable() else ascii(each)[1:-1] for each in kept)
    return plain[:MAX_TEXT]


def shown(value: object) -> str:
    """A value as a message shows it: printable and short.

    >>> shown("a" * 1000)[-7:]
    'aaa ...'
    """
    text = repr(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]} ..."
