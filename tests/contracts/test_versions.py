"""The project has one version, and a line about it in the changelog."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from keepaway_sim import version

ROOT = Path(__file__).resolve().parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
PACKAGES = sorted([*ROOT.glob("src/*/package.xml"), ROOT / "msgs" / "package.xml"])


@pytest.mark.parametrize("path", PACKAGES, ids=lambda path: path.parent.name)
def test_package_has_the_version_of_the_project(path: Path) -> None:
    assert ElementTree.parse(path).getroot().findtext("version") == VERSION


def test_code_says_the_version_of_the_project() -> None:
    assert version.__version__ == VERSION


def version_said_by(file: Path) -> str:
    """What a copy of `version.py` there says."""
    code = "import version; print(version.code_version())"
    said = subprocess.check_output([sys.executable, "-c", code], cwd=file.parent, text=True)
    return said.strip()


def test_code_in_a_checkout_says_its_commit_and_an_installed_one_none(tmp_path: Path) -> None:
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@example.org"]
    inside, installed = tmp_path / "src/a/a/version.py", tmp_path / "lib/version.py"
    for file in (inside, installed):
        file.parent.mkdir(parents=True)
        shutil.copy(version.__file__, file)
    subprocess.run([*git, "init", "--quiet"], check=True)
    subprocess.run([*git, "add", "src"], check=True)
    subprocess.run([*git, "commit", "--quiet", "--message", "x"], check=True)
    commit = subprocess.check_output([*git, "rev-parse", "--short", "HEAD"], text=True).strip()
    assert version_said_by(inside) == f"{VERSION}+g{commit}"
    assert version_said_by(installed) == VERSION
    inside.write_text(inside.read_text() + "\n")
    assert version_said_by(inside) == f"{VERSION}+g{commit}.dirty"


def test_changelog_tells_of_the_version() -> None:
    assert f"## [{VERSION}]" in (ROOT / "CHANGELOG.md").read_text()
