"""The house's counts find what they are to find, and the documentation's tables are today's."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def house() -> ModuleType:
    spec = importlib.util.spec_from_file_location("house", ROOT / "scripts/checks/house.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A tree with one offender of each kind."""
    package = tmp_path / "src/keepaway_x/keepaway_x"
    package.mkdir(parents=True)
    long = "def long():\n" + "    x = 1\n" * 50 + "\n\ndef short():\n" + "    x = 1\n" * 49
    wide = "def wide(a, b, c, d, e, f, g, h, i): ...\n\n\nclass Box:\n"
    method = "    def fits(self, a, b, c, d, e, f, g, *, h): ...\n"
    (package / "one.py").write_text(f"{long}\nCOLOUR = 1\n_HIDDEN = 1\n")
    (package / "two.py").write_text(f"{wide}{method}\nCOLOUR, _HIDDEN = 2, 2\n")
    (package / "three.py").write_text("\n" * 401)
    return tmp_path


def test_offenders_are_counted(house: ModuleType, checkout: Path) -> None:
    counts = house.count(checkout)
    folder = "src/keepaway_x/keepaway_x"
    assert counts.long_functions == [f"{folder}/one.py:1 long 51"]
    assert counts.wide_functions == [f"{folder}/two.py:1 wide 9"]
    assert counts.long_modules == [f"{folder}/three.py 401"]
    assert counts.repeated_names == [f"COLOUR: {folder}/one.py, {folder}/two.py"]


def test_tables_of_the_documentation_are_those_of_the_code(house: ModuleType) -> None:
    for page in house.pages():
        text = page.read_text(encoding="utf-8")
        assert house.with_tables(page, text) == text, f"{page}: run scripts/checks/house.py --write"


def test_every_package_has_a_table_of_its_modules(house: ModuleType) -> None:
    for package in (ROOT / "src").glob("keepaway_*"):
        assert "<!-- table: modules -->" in (package / "README.md").read_text(encoding="utf-8")
