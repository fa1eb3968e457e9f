"""Count what makes a house hard to live in, and write the tables of the documentation.

    .venv/bin/python scripts/checks/house.py              # this checkout
    .venv/bin/python scripts/checks/house.py ../other     # another one, side by side with this
    .venv/bin/python scripts/checks/house.py --list       # with every offender by name
    .venv/bin/python scripts/checks/house.py --write      # the tables in READMEs and docs/

Counted are functions of more than 50 lines or 8 parameters, modules of more than 400 lines, and
public names that more than one module of the packages defines at its top, what agents must say
again aside. Tables stand between
`<!-- table: modules -->` or `<!-- table: parameter NAME -->` (or `setting`) and
`<!-- end of table -->`; tests hold them to the code.
"""

import argparse
import ast
import importlib
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from keepaway_sim.settings import table

ROOT = Path(__file__).resolve().parents[2]
LONGEST_FUNCTION = 50  # lines, its docstring included
MOST_PARAMETERS = 8
LONGEST_MODULE = 400  # lines
EXPECTED = {"log", "main"}
"""Names that every module may have."""
TWINS = (
    "compiled.py",
    "machine_code.py",
    "parameters.py",
    "passing.py",
    "running.py",
    "settings.py",
    "trigonometry.py",
    "version.py",
)
"""Files that two packages have on purpose, equal but for the package's name."""
TWIN_NAMES = {
    *("Action", "Role", "Outcome", "NEVER", "HEADER", "CYCLE_TIME", "LOG_PERIOD", "RESEND_PERIOD"),
    *("MAX_FIELD_SIDE", "MAX_TEAM_SIZE", "SettingError", "Spin"),
}
"""What agents say again, as they import nothing of the simulator; tests hold the values equal."""
TABLE = re.compile(r"(<!-- table: ([^>]+) -->\n).*?(<!-- end of table -->)", re.DOTALL)


class Counts(NamedTuple):
    """What was found in a checkout, each by name."""

    long_functions: list[str]
    wide_functions: list[str]
    long_modules: list[str]
    repeated_names: list[str]


def main() -> int:
    """Count, or write."""
    arguments = parse()
    if arguments.write:
        for page in written_pages():
            print(f"wrote {page.relative_to(ROOT)}")
        return 0
    roots = [ROOT, *arguments.checkout]
    found = [count(root) for root in roots]
    print(f"{'':32}" + "".join(f"{root.name:>16}" for root in roots))
    for index, words in enumerate(
        (
            f"functions over {LONGEST_FUNCTION} lines",
            f"functions over {MOST_PARAMETERS} parameters",
            f"modules over {LONGEST_MODULE} lines",
            "names defined twice",
        )
    ):
        print(f"{words:32}" + "".join(f"{len(counts[index]):16}" for counts in found))
        if arguments.list:
            for root, counts in zip(roots, found, strict=True):
                print("".join(f"    {root.name}: {name}\n" for name in counts[index]), end="")
    return 0


def count(root: Path) -> Counts:
    """What a checkout has, of the code in `src` and `scripts`."""
    long_functions, wide_functions, long_modules = [], [], []
    for path in modules(root):
        text = path.read_text(encoding="utf-8")
        length = text.count("\n")
        if length > LONGEST_MODULE:
            long_modules.append(f"{path.relative_to(root)} {length}")
        for function in functions(ast.parse(text)):
            where = f"{path.relative_to(root)}:{function.lineno} {function.name}"
            lines = (function.end_lineno or function.lineno) - function.lineno + 1
            if lines > LONGEST_FUNCTION:
                long_functions.append(f"{where} {lines}")
            parameters = num_parameters(function)
            if parameters > MOST_PARAMETERS:
                wide_functions.append(f"{where} {parameters}")
    return Counts(long_functions, wide_functions, long_modules, repeated_names(root))


def modules(root: Path) -> list[Path]:
    """The sources that count: packages and scripts; not examples, which stand alone."""
    found = [*root.glob("src/*/keepaway_*/**/*.py"), *root.glob("scripts/**/*.py")]
    return sorted(path for path in found if path.name != "setup.py")


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Every function, methods and inner ones among them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def num_parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """How many parameters it has beside `self` and `cls`."""
    given = function.args
    names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def repeated_names(root: Path) -> list[str]:
    """Public names that several modules define, with the modules."""
    places: dict[str, list[str]] = defaultdict(list)
    for path in modules(root):
        where = str(path.relative_to(root))
        if path.name in (*TWINS, "__init__.py") or where.startswith("scripts"):
            continue
        for name in sorted(top_names(ast.parse(path.read_text(encoding="utf-8")))):
            places[name].append(where)
    return [
        f"{name}: {', '.join(where)}"
        for name, where in sorted(places.items())
        if len(where) > 1 and name not in EXPECTED and not _are_twins(name, where)
    ]


def _are_twins(name: str, where: list[str]) -> bool:
    packages = [each.split("/")[1] for each in where]
    return name in TWIN_NAMES and sorted(packages) == ["keepaway_agent", "keepaway_sim"]


def top_names(tree: ast.Module) -> set[str]:
    """The public names that a module defines at its top."""
    found: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                found |= {each.id for each in ast.walk(target) if isinstance(each, ast.Name)}
    return {name for name in found if not name.startswith("_")}


def written_pages() -> Iterator[Path]:
    """Write the tables of every page that has some; the pages that changed."""
    for page in pages():
        before = page.read_text(encoding="utf-8")
        after = with_tables(page, before)
        if after != before:
            page.write_text(after, encoding="utf-8")
            yield page


def pages() -> list[Path]:
    """The documentation in Markdown."""
    return sorted([*ROOT.glob("*.md"), *ROOT.glob("src/*/*.md"), *ROOT.glob("src/*/docs/**/*.md")])


def with_tables(page: Path, text: str) -> str:
    """A page's text with its tables as they are today."""

    def made(found: re.Match[str]) -> str:
        return found[1] + made_table(page, found[2]) + found[3]

    return TABLE.sub(made, text)


def made_table(page: Path, what: str) -> str:
    """The table that a page asks for: "modules", "parameter package.module.Class"."""
    kind, _, name = what.partition(" ")
    if kind == "modules":
        package = page.parent / page.parent.name
        return module_table(package)
    module, _, settings = name.rpartition(".")
    return table(getattr(importlib.import_module(module), settings), kind)


def module_table(package: Path) -> str:
    """Every module of a package with the first line of its docstring, room by room."""
    found = [path for path in package.rglob("*.py") if path.name != "__init__.py"]
    ordered = sorted(found, key=lambda path: (path.parent != package, path.relative_to(package)))
    rows = ["| module | what it is |", "|---|---|"]
    for path in ordered:
        docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        first = docstring.partition("\n")[0].rstrip(".")
        rows.append(f"| `{path.relative_to(package)}` | {first} |")
    return "\n".join(rows) + "\n"


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkout", type=Path, nargs="*", help="other checkouts to count, too")
    parser.add_argument("--list", action="store_true", help="every offender by name")
    parser.add_argument("--write", action="store_true", help="write the documentation's tables")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
