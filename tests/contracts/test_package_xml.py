"""package.xml and imports: what a package imports is named there, and nothing else is."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"
PACKAGES = ("keepaway_sim", "keepaway_agent", "keepaway_transfer")
KEY = "python3-"
"""What rosdep's keys of Python packages begin with."""


def imported(package: str) -> set[str]:
    """The packages that a package's modules and launch files import, its own and Python's aside."""
    folder, found = SRC / package, set[str]()
    for module in [*(folder / package).rglob("*.py"), *(folder / "launch").glob("*.py")]:
        for node in ast.walk(ast.parse(module.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.partition(".")[0])
    return found - set(sys.stdlib_module_names) - {package}


def declared(package: str) -> list[str]:
    root = ElementTree.parse(SRC / package / "package.xml").getroot()
    keys = [str(each.text) for each in root.findall("exec_depend")]
    lines = (SRC / package / "requirements.txt").read_text().splitlines()
    return [key.removeprefix(KEY) for key in keys] + [
        line.partition("==")[0] for line in lines if line and not line.startswith("#")
    ]


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_imported_is_declared_once_and_nothing_else(package: str) -> None:
    names = declared(package)
    assert sorted(names) == sorted(set(names))
    assert set(names) == {name.lower() for name in imported(package)}  # as rosdep's keys are


def test_the_messages_declare_the_packages_whose_messages_they_use() -> None:
    msgs = SRC.parent / "msgs"
    root = ElementTree.parse(msgs / "package.xml").getroot()
    text = "\n".join(
        path.read_text() for path in [*msgs.glob("msg/*.msg"), *msgs.glob("srv/*.srv")]
    )
    used = set(re.findall(r"^(\w+)/\w+(?:\[\d*\])? ", text, re.M))
    assert {each.text for each in root.findall("depend")} == used


@pytest.mark.parametrize("folder", ["msgs", *(f"src/{package}" for package in PACKAGES)])
def test_a_package_says_who_made_it_and_how_it_is_tested(folder: str) -> None:
    package = SRC.parent / folder
    root = ElementTree.parse(package / "package.xml").getroot()
    tests = [] if folder == "msgs" else ["test_depend"]
    for tag in ("description", "maintainer", "author", "url", "license", *tests):
        assert root.findtext(tag), tag
    licence = root.find("license")
    assert licence is not None
    text = (package / str(licence.get("file"))).read_text()
    assert text == (SRC.parent / "LICENSE").read_text()
