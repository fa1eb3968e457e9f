"""What the documentation promises: links lead somewhere, commands exist, tutorials run."""

import ast
import functools
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    page
    for pattern in ("*.md", ".github/**/*.md", "msgs/*.md", "src/*/README.md", "src/*/docs/*.md")
    for page in ROOT.glob(pattern)
)
SCRIPTS = sorted((ROOT / "scripts").glob("*.py"))
TUTORIALS = [
    "README.md",
    "src/keepaway_transfer/docs/tutorial.md",
    "src/keepaway_agent/docs/write_an_agent.md",
]


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as the usual hosts make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    words = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {word.replace(" ", "-") for word in words}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_to_files_and_headings_that_exist(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    broken = []
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if "://" in link or link.startswith("mailto:"):
            continue
        wants_heading = anchor and target.suffix == ".md"
        if not target.exists() or (wants_heading and anchor not in anchors(target)):
            broken.append(link)
    assert not broken


def commands(page: Path) -> Iterator[list[str]]:
    """The words of every command that begins with a script, of a page or a script's docstring."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```(?:sh)?\n(.*?)^```", text, re.M | re.S)
    if page.suffix == ".py":
        blocks, text = [ast.get_docstring(ast.parse(text)) or ""], ""
    inline = re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.S))
    for line in [*"\n".join(blocks).splitlines(), *inline]:
        found = re.search(r"(?:^|[\s=])(scripts/[\w/]+(?:\.py)?(?=\s|$).*)", line)
        if found:
            yield shlex.split(found[1].replace("'", ""), comments=True)


@functools.cache
def help_of(script: Path) -> str:
    """What a script prints about its options; a shell script, its text."""
    if script.with_suffix(".py").exists():  # a shell script that starts it
        script = script.with_suffix(".py")
    if script.suffix != ".py":
        return script.read_text(encoding="utf-8")
    command = [sys.executable, str(script), "--help"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("page", [*PAGES, *SCRIPTS], ids=name_of)
def test_every_command_has_its_script_and_every_option_is_known(page: Path) -> None:
    unknown = []
    for name, *words in commands(page):
        script = ROOT / name
        if script.is_dir():
            continue
        assert script.is_file(), name
        for word in words:
            if word in ("--", "--ros-args"):  # what follows is for another program
                break
            option = word.partition("=")[0]
            if re.fullmatch(r"--[a-z][\w-]*", option) and option not in help_of(script):
                unknown.append(f"{name} {option}")
    assert not unknown


def test_the_readmes_snippet_runs_as_written() -> None:
    (snippet,) = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.M | re.S)
    names: dict[str, object] = {}
    exec(compile(snippet, "README.md", "exec"), names)
    assert names["observation"] in names["env"].observation_space  # type: ignore[attr-defined]


def test_a_site_is_built_of_all_pages_and_docstrings(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "scripts/docs.py"), "--out", str(tmp_path / "site")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    site = tmp_path / "site"
    assert (site / "src/keepaway_transfer/docs/results.html").is_file()
    assert "read_trials" in (site / "api/keepaway_transfer.studies.results.html").read_text()


@pytest.mark.parametrize("tutorial", TUTORIALS)
@pytest.mark.xdist_group("ros")
@pytest.mark.timeout(900)
def test_a_tutorial_runs_as_written(tutorial: str, tmp_path: Path, ros_domain: int) -> None:
    for name in ("scripts", "src", ".venv"):
        (tmp_path / name).symlink_to(ROOT / name)
    text = (ROOT / tutorial).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(sh|python)\n(.*?)^```", text, re.M | re.S)
    assert [kind for kind, _ in blocks].count("sh") >= 2  # those marked sh: the quick ones
    environment = os.environ | {"ROS_DOMAIN_ID": str(ros_domain)}
    for kind, block in blocks:
        if kind == "python":
            if block.startswith("    def "):  # methods for the file that the page has made
                replace_methods(tmp_path / "quick_keeper.py", block)
            continue
        done = subprocess.run(
            ["bash", "-ec", block],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{block}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"


def replace_methods(file: Path, block: str) -> None:
    """Put a block of methods in the place of the method that the first of them is called like."""
    text = file.read_text(encoding="utf-8")
    name = re.findall(r"def (\w+)", block)[0]
    method = next(
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef) and node.name == name
    )
    lines = text.splitlines(keepends=True)
    lines[method.lineno - 1 : method.end_lineno] = [block]
    file.write_text("".join(lines), encoding="utf-8")
