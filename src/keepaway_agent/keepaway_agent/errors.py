"""The one family of errors this package raises for bad input."""


class AgentError(ValueError):
    """Bad input, refused at the edge; the message names the value and the way out."""


class WeightsError(AgentError):
    """Weights, or a file of weights, that cannot be used here."""


class SettingError(AgentError):
    """A setting that does not exist, or whose value is refused."""
