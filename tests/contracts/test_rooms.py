"""Tests lie as the sources do, room by room; pages name paths that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"sim": "keepaway_sim", "agent": "keepaway_agent", "transfer": "keepaway_transfer"}
BESIDE = {"agent": {"examples"}}
"""Folders of tests whose sources lie beside the package."""
WORDS_THAT_ARE_NO_PATHS = re.compile(r"^\.venv/|[<>*{}$ ,]|\.\.|NAME|BAG|out/|results/|^/")


def rooms(folder: Path) -> set[str]:
    """The folders of sources or tests below a folder, by name."""
    found = {path.parent.relative_to(folder) for path in folder.rglob("*.py")}
    return {str(each) for each in found if each.parts and each.parts[0] != "__pycache__"}


@pytest.mark.parametrize(("name", "package"), PACKAGES.items())
def test_every_room_has_a_folder_of_tests_and_every_folder_a_room(name: str, package: str) -> None:
    sources = rooms(ROOT / "src" / package / package)
    tests = rooms(ROOT / "tests" / name)
    assert tests - BESIDE.get(name, set()) == sources


@pytest.mark.parametrize("page", ["CONTRIBUTING.md"])
def test_every_path_that_a_page_names_exists(page: str) -> None:
    quoted = re.findall(r"`([^`\n]+)`", (ROOT / page).read_text(encoding="utf-8"))
    paths = [word for word in quoted if "/" in word and not WORDS_THAT_ARE_NO_PATHS.search(word)]
    assert paths
    bases = (ROOT, *(ROOT / "src").glob("keepaway_*/keepaway_*"), *(ROOT / "src").glob("*"))
    missing = [word for word in paths if not any((base / word).exists() for base in bases)]
    assert not missing
