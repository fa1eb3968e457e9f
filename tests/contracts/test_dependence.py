"""Dependence goes one way, ROS stays in the nodes, and every module is in its package's README."""

from pathlib import Path

import pytest
from modules import MODULES, SRC, imports, name_of

PACKAGES = sorted(SRC.glob("keepaway_*"))
ALLOWED = {
    "keepaway_sim": {"keepaway_sim"},
    "keepaway_agent": {"keepaway_sim", "keepaway_agent"},
    "keepaway_transfer": {"keepaway_sim", "keepaway_agent", "keepaway_transfer"},
}
ROS = {"rclpy", "keepaway_msgs"}


def packages(module: Path) -> set[str]:
    """The top-level packages that a module imports."""
    return {name.partition(".")[0] for name in imports(module)}


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_packages_depend_in_one_direction(module: Path) -> None:
    package = name_of(module).partition(".")[0]
    assert packages(module) & set(ALLOWED) <= ALLOWED[package]


@pytest.mark.parametrize(
    "module", [m for m in MODULES if not {"nodes", "ros"} & set(m.parts)], ids=name_of
)
def test_pure_logic_knows_no_ros(module: Path) -> None:
    assert not packages(module) & ROS
    assert not [name for name in imports(module) if {"nodes", "ros"} & set(name.split("."))]


def test_agent_nodes_import_nothing_of_the_simulator() -> None:
    known = {name_of(module): module for module in MODULES}
    reached: set[str] = set()
    waiting = {name for name in known if name.startswith("keepaway_agent.nodes.")}
    while waiting:
        reached |= waiting
        waiting = set().union(*(imports(known[name]) for name in waiting)) & set(known) - reached
    assert not [name for name in reached if name.startswith("keepaway_sim")]


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_every_module_is_in_the_readme_of_its_package(package: Path) -> None:
    readme = (package / "README.md").read_text()
    inside = package / package.name
    modules = {str(module.relative_to(inside)) for module in inside.rglob("*.py")}
    listed = {name for name in modules if not name.endswith("__init__.py")}
    assert not {name for name in listed if f"| `{name}` |" not in readme}
