"""Inter-task mappings: which source state variable and action stand for each target one.

A mapping is data: `chi_x` names for every state variable of the target task one of the source
task, `chi_a` does the same for the actions (Taylor & Stone 2004, Table 1). `ZERO` in place of a
source name leaves the weights at zero.

>>> rho_mapping("3v2", "4v3").chi_x["min_dist_k4_t"]
'min_dist_k3_t'
>>> rho_mapping("3v2", "4v3").action_indices
(0, 1, 2, 2)
"""

import re
import tomllib
from collections.abc import Callable
from collections.abc import Mapping as Table
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from keepaway_agent.actions import Role, keeper_action_names
from keepaway_agent.learning.features import feature_names
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_transfer.errors import MappingError

ZERO = "zero"


def state_variables(task: str) -> tuple[str, ...]:
    """The names of a keeper's 4n + 2m - 3 state variables in a task, in the paper's order.

    >>> state_variables("2v1")[3:]
    ('dist_k2_c', 'dist_t1_c', 'min_dist_k2_t', 'min_ang_k2_t')
    """
    parsed = Task.parse(task)
    return feature_names(Role.KEEPER, parsed.num_keepers, parsed.num_takers)


def actions(task: str) -> tuple[str, ...]:
    """The n macro actions of the keeper with the ball: hold, pass to K2, ... pass to Kn.

    >>> actions("3v2")
    ('hold', 'pass_k2', 'pass_k3')
    """
    return keeper_action_names(Task.parse(task).num_keepers)


@dataclass(frozen=True)
class InterTaskMapping:
    """chi_x and chi_a from the names of a target task to those of a source task, checked when made.

    Raises MappingError when a target name is missing or unknown, or a source name does not exist.
    """

    source: str  # task the weights come from, "3v2"
    target: str  # task they go to, "4v3"
    chi_x: Table[str, str]  # target state variable -> source state variable or ZERO
    chi_a: Table[str, str]  # target action -> source action or ZERO

    def __post_init__(self) -> None:
        _check_coverage(
            "chi_x", self.chi_x, state_variables(self.source), state_variables(self.target)
        )
        _check_coverage("chi_a", self.chi_a, actions(self.source), actions(self.target))

    @property
    def variable_indices(self) -> tuple[int, ...]:
        """For each target state variable in order the index of its source one, -1 for ZERO."""
        return _indices(self.chi_x, state_variables(self.source), state_variables(self.target))

    @property
    def action_indices(self) -> tuple[int, ...]:
        """For each target action in order the index of its source one, -1 for ZERO."""
        return _indices(self.chi_a, actions(self.source), actions(self.target))

    def to_toml(self) -> str:
        """The mapping as the text of a file that `load_mapping` reads; a start for one's own."""
        lines = [f'source = "{self.source}"', f'target = "{self.target}"']
        for title, chi in (("chi_x", self.chi_x), ("chi_a", self.chi_a)):
            lines += [
                "",
                f"[{title}]  # of the target = of the source",
                *(f'{k} = "{v}"' for k, v in chi.items()),
            ]
        return "\n".join(lines) + "\n"


def load_mapping(path: Path | str) -> InterTaskMapping:
    """A user's own mapping: a TOML file with `source`, `target` and tables `chi_x`, `chi_a`."""
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        return InterTaskMapping(data["source"], data["target"], data["chi_x"], data["chi_a"])
    except KeyError as missing:
        raise MappingError(f"{path}: {missing} is missing") from missing
    except KeepawayError as error:
        raise MappingError(f"{path}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise MappingError(f"{path}: not a TOML file: {error}") from error
    except (TypeError, AttributeError) as error:
        raise MappingError(f"{path}: a value of another type than needed: {error}") from error


def rho_mapping(source: str, target: str) -> InterTaskMapping:
    """The paper's: a player the source task lacks takes what its last player of that team has.

    In 4v3 from 3v2 K4 takes K3's variables, T3 takes T2's, and pass_k4 is valued as pass_k3.
    """
    known = _known_players(source, target)
    return _renamed(
        source, target, new_keeper=f"k{known.num_keepers}", new_taker=f"t{known.num_takers}"
    )


def modified_mapping(source: str, target: str) -> InterTaskMapping:
    """The paper's sensitivity test: new keepers take K2's variables and new takers T1's.

    The paper changes the variables only, so the actions are rho's.
    """
    _known_players(source, target)
    modified = _renamed(source, target, new_keeper="k2", new_taker="t1")
    return InterTaskMapping(source, target, modified.chi_x, rho_mapping(source, target).chi_a)


def partial_mapping(source: str, target: str) -> InterTaskMapping:
    """Variables of players that the source task lacks start at zero; actions as in rho."""
    known = state_variables(source)
    chi_x = {name: name if name in known else ZERO for name in state_variables(target)}
    return InterTaskMapping(source, target, chi_x, rho_mapping(source, target).chi_a)


def shuffled_mapping(source: str, target: str, generator: np.random.Generator) -> InterTaskMapping:
    """Negative control: rho's source names dealt out at random, each as often as rho uses it."""
    rho = rho_mapping(source, target)
    return InterTaskMapping(
        source, target, _shuffled(rho.chi_x, generator), _shuffled(rho.chi_a, generator)
    )


MAPPING_RULES: dict[str, Callable[[str, str, np.random.Generator], InterTaskMapping]] = {
    "rho": lambda source, target, _: rho_mapping(source, target),
    "rho_modified": lambda source, target, _: modified_mapping(source, target),
    "partial": lambda source, target, _: partial_mapping(source, target),
    "shuffled": shuffled_mapping,
}


def _known_players(source: str, target: str) -> Task:
    smaller, larger = Task.parse(source), Task.parse(target)
    if larger.num_keepers < smaller.num_keepers or larger.num_takers < smaller.num_takers:
        raise MappingError(
            f"no rule from {source} to {target}: the target has fewer players on a team"
        )
    return smaller


def _renamed(source: str, target: str, *, new_keeper: str, new_taker: str) -> InterTaskMapping:
    known = Task.parse(source)

    def stand_in(player: re.Match[str]) -> str:
        team, rank = player[1], int(player[2])
        if team == "k":
            return player[0] if rank <= known.num_keepers else new_keeper
        return player[0] if rank <= known.num_takers else new_taker

    def chi(names: tuple[str, ...]) -> dict[str, str]:
        return {name: re.sub(r"([kt])(\d+)", stand_in, name) for name in names}

    return InterTaskMapping(source, target, chi(state_variables(target)), chi(actions(target)))


def _shuffled(chi: Table[str, str], generator: np.random.Generator) -> dict[str, str]:
    return dict(zip(chi, generator.permutation(list(chi.values())).tolist(), strict=True))


def _check_coverage(
    title: str, chi: Table[str, str], source: tuple[str, ...], target: tuple[str, ...]
) -> None:
    for name in target:
        if name not in chi:
            raise MappingError(f"{title} has no entry for {name!r} of the target task")
    for name, stands_for in chi.items():
        if name not in target:
            raise MappingError(f"{title} names {name!r}, which the target task does not have")
        if stands_for != ZERO and stands_for not in source:
            raise MappingError(
                f"{title} maps {name!r} to {stands_for!r}, which the source task does not have"
            )


def _indices(
    chi: Table[str, str], source: tuple[str, ...], target: tuple[str, ...]
) -> tuple[int, ...]:
    return tuple(-1 if chi[name] == ZERO else source.index(chi[name]) for name in target)
