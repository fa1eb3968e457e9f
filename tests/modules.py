"""The modules of all packages, and what each imports."""

import ast
from pathlib import Path

SRC = Path(__file__).resolve().parents[1] / "src"
MODULES = sorted(SRC.glob("keepaway_*/keepaway_*/**/*.py"))


def name_of(module: Path) -> str:
    """A module's dotted name, from its place."""
    return ".".join(module.relative_to(SRC).parts[1:]).removesuffix(".py")


def imports(module: Path) -> set[str]:
    """The dotted names of all modules that a module imports, wherever in its text."""
    nodes = list(ast.walk(ast.parse(module.read_text())))
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    froms = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    members = {f"{node.module}.{alias.name}" for node in froms for alias in node.names}
    return plain | members | {node.module or "" for node in froms}
