"""The one family of errors this package raises for bad input."""

from keepaway_agent.texts import one_line


class AgentError(ValueError):
    """Bad input, refused at the edge; the message names the value and the way out.

    Its text is one printable line, whatever the input was.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


class WeightsError(AgentError):
    """Weights, or a file of weights, that cannot be used here."""


class SettingError(AgentError):
    """A setting that does not exist, or whose value is refused."""
