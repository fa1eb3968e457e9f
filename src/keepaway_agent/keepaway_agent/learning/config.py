"""How a learner learns, declared once for nodes, trainings, studies and weights files."""

from __future__ import annotations

import attrs

from keepaway_agent.learning.cmac import WIDTH_PROFILES
from keepaway_agent.learning.features import ORDERINGS
from keepaway_agent.settings import setting


@attrs.frozen
class SarsaConfig:
    """The numbers of the learning rule. Defaults are those of the papers' player framework.

    Raises:
        AgentError: a value outside its range.
    """

    alpha: float = setting(0.125, "step size, shared out among the active tiles", "1", "[0, 1]")
    gamma: float = setting(1.0, "discount", "1/cycle", "[0, 1]")
    lambda_: float = setting(0.0, "decay of the traces", "1/decision", "[0, 1]")
    epsilon: float = setting(0.01, "share of decisions that are random", "1", "[0, 1]")
    min_trace: float = setting(0.01, "smaller traces count as 0; 0 keeps all", "1", "[0, 1]")


@attrs.frozen
class LearnerConfig(SarsaConfig):
    """The learning rule, and what its state variables and tiles are.

    Raises:
        AgentError: a value outside its range, or a name that is none.
    """

    ordering: str = setting(
        "ball",
        "players are ranked by their distance to the ball, or to K1 (k1)",
        choices=tuple(ORDERINGS),
    )
    tile_widths: str = setting(
        "default", "of the tiles; framework: UT Austin's", choices=tuple(WIDTH_PROFILES)
    )

    @property
    def sarsa(self) -> SarsaConfig:
        """The learning rule alone."""
        return SarsaConfig(self.alpha, self.gamma, self.lambda_, self.epsilon, self.min_trace)
