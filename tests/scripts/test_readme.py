"""The figures of README.md are those of the committed data."""

import pytest
import readme


def test_the_figures_of_the_readme_are_what_the_data_give() -> None:
    text = readme.PAGE.read_text(encoding="utf-8")
    assert readme.written(text) == text, "run scripts/checks/readme.py --write"


def test_a_page_without_a_part_is_refused() -> None:
    with pytest.raises(SystemExit, match="no part results"):
        readme.written("# Keepaway\n")
