"""The project has one version, and a line about it in the changelog."""

import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from keepaway_sim.version import __version__

ROOT = Path(__file__).resolve().parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
PACKAGES = sorted([*ROOT.glob("src/*/package.xml"), ROOT / "msgs" / "package.xml"])


@pytest.mark.parametrize("path", PACKAGES, ids=lambda path: path.parent.name)
def test_package_has_the_version_of_the_project(path: Path) -> None:
    assert ElementTree.parse(path).getroot().findtext("version") == VERSION


def test_code_says_the_version_of_the_project() -> None:
    assert __version__ == VERSION


def test_changelog_tells_of_the_version() -> None:
    assert f"## [{VERSION}]" in (ROOT / "CHANGELOG.md").read_text()
