"""Machine code is never stale, wherever the sources lie, and compiling is never silent.

The mechanism is tried on a copy of it in two tiny packages, whose functions compile at once.
"""

import ast
import filecmp
import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from modules import MODULES, SRC, imports, name_of

from keepaway_sim.world.machine_code import SOURCES, sources

SIM, AGENT = SRC / "keepaway_sim" / "keepaway_sim", SRC / "keepaway_agent" / "keepaway_agent"
MECHANISM = ("compiled.py", "machine_code.py", "passing.py")
DECORATORS = {"compiled", "compiled_apart"}
UNCOMPILED = {"errors", "settings"}  # nothing in them ends up in machine code
OLD = 1_000_000_000  # a time stamp of 2001

CALLEE = """
from keepaway_sim.world.compiled import compiled

@compiled
def value():
    return 1
"""
CALLER = """
from {package} import compiled
from keepaway_sim.world.callee import value

@compiled
def middle():
    return 10 * value()

@compiled
def ask():
    return middle()
"""
ASK = "from keepaway_agent.compiled import Kernel; from {module} import ask; print(Kernel(ask)())"
CALLERS = ("keepaway_sim.world.caller", "keepaway_agent.learning.caller")


class Checkout:
    """Two packages with one compiled function in each that calls another one of the simulator's."""

    def __init__(self, folder: Path, home: Path) -> None:
        self.folder = folder
        self.env = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA", "XDG"))}
        self.env |= {"PYTHONPATH": str(folder), "HOME": str(home), "PYTHONDONTWRITEBYTECODE": "1"}
        for source, copy in ((SIM / "world", "keepaway_sim/world"), (AGENT, "keepaway_agent")):
            for name in MECHANISM:
                self.write(f"{copy}/{name}", (source / name).read_text())
        for package in ("keepaway_sim", "keepaway_sim/world", "keepaway_agent"):
            self.write(f"{package}/__init__.py", "")
        self.write("keepaway_agent/learning/__init__.py", "")
        self.write("keepaway_sim/world/callee.py", CALLEE)
        own = "keepaway_sim.world.compiled", "keepaway_agent.compiled"
        for package, module in zip(own, CALLERS, strict=True):
            self.write(f"{module.replace('.', '/')}.py", CALLER.format(package=package))

    def write(self, name: str, text: str) -> None:
        """Write a source whose time stamp says nothing."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        os.utime(path, (OLD, OLD))

    def change_callee(self, value: int) -> None:
        self.write("keepaway_sim/world/callee.py", CALLEE.replace("1", str(value)))

    def ask(self, module: str = CALLERS[1]) -> tuple[int, str]:
        """What a new process gets of the callers, and what it says on standard error."""
        command = [sys.executable, "-c", ASK.format(module=module)]
        done = subprocess.run(
            command, env=self.env, cwd="/", capture_output=True, text=True, check=True
        )
        return int(done.stdout), done.stderr


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path / "checkout", tmp_path / "home")


@pytest.mark.parametrize("module", CALLERS)
def test_a_changed_callee_of_another_file_counts(checkout: Checkout, module: str) -> None:
    assert checkout.ask(module)[0] == 10
    checkout.change_callee(2)  # of the same size, and no newer
    assert checkout.ask(module)[0] == 20


def test_code_is_compiled_once_and_found_again_after_another_commit(checkout: Checkout) -> None:
    _, said = checkout.ask()
    assert "compiles ask" in said
    assert "compiled ask in" in said
    checkout.change_callee(2)
    assert "compiles ask" in checkout.ask()[1]
    checkout.change_callee(1)
    assert checkout.ask() == (10, "")


def test_kept_code_is_loaded_without_all_that_compiling_needs(checkout: Checkout) -> None:
    checkout.ask()
    script = (
        ASK.format(module=CALLERS[1]) + "; import sys; print('numba.np.arraymath' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], env=checkout.env, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["10", "False"]


def test_a_folder_of_ones_own_is_used(checkout: Checkout, tmp_path: Path) -> None:
    checkout.env["NUMBA_CACHE_DIR"] = str(tmp_path / "own")
    checkout.ask()
    checkout.change_callee(2)
    assert checkout.ask()[0] == 20
    assert len(list((tmp_path / "own" / "keepaway").glob("machine_code-*"))) == 2
    assert not (tmp_path / "home").exists()


def test_a_checkout_that_cannot_be_written_shares_the_code_of_its_twin(
    checkout: Checkout, tmp_path: Path
) -> None:
    checkout.ask()
    twin = Checkout(tmp_path / "twin", tmp_path / "home")
    for path in twin.folder.rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert twin.ask() == (10, "")


def test_without_a_place_for_it_code_is_compiled_anew_and_one_line_says_so(
    checkout: Checkout,
) -> None:
    checkout.env["HOME"] = "/proc/nobody"
    for value in (1, 2):
        checkout.change_callee(value)
        answer, said = checkout.ask()
        assert answer == 10 * value
        assert sum("cannot be kept" in line for line in said.splitlines()) == 1


@pytest.fixture
def compiling(checkout: Checkout, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A process whose child compiles for ever, and names itself in the file `pids`."""
    pids = tmp_path / "pids"
    endless = f"""
import os, time
with open({str(pids)!r}, "a") as file:
    file.write(str(os.getpid()) + "\\n")
if len(open({str(pids)!r}).readlines()) > 1:
    time.sleep(3600)
"""
    module = f"{CALLERS[1].replace('.', '/')}.py"
    checkout.write(module, CALLER.format(package="keepaway_agent.compiled") + endless)
    command = [sys.executable, "-c", ASK.format(module=CALLERS[1])]
    process = subprocess.Popen(
        command, env=checkout.env, cwd="/", stderr=subprocess.PIPE, text=True
    )
    with process:
        yield process
        process.kill()


def test_an_interrupt_ends_compiling(compiling: subprocess.Popen[str], tmp_path: Path) -> None:
    assert compiling.stderr
    assert "compiles ask" in compiling.stderr.readline()
    assert "compiling: 0 of 1 done" in compiling.stderr.readline()  # the child is at it
    compiling.send_signal(signal.SIGINT)
    compiling.wait(60)
    assert "KeyboardInterrupt" in compiling.stderr.read()
    _, child = (tmp_path / "pids").read_text().split()
    assert not Path(f"/proc/{child}").exists()


def test_both_packages_compile_alike() -> None:
    for name in MECHANISM:
        assert filecmp.cmp(SIM / "world" / name, AGENT / name, shallow=False)


def has_compiled_functions(module: Path) -> bool:
    nodes = ast.walk(ast.parse(module.read_text()))
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    return any(
        isinstance(decorator, ast.Name) and decorator.id in DECORATORS
        for function in functions
        for decorator in function.decorator_list
    )


def test_all_that_ends_up_in_machine_code_is_counted_among_its_sources() -> None:
    counted = set(sources())
    compiled = {module for module in MODULES if has_compiled_functions(module)}
    assert len(compiled) > 15
    known = {name_of(module): module for module in MODULES}
    needed = set(compiled)
    for module in compiled:
        needed |= {known[name] for name in imports(module) if name in known}
    needed = {module for module in needed if module.stem not in UNCOMPILED}
    assert not {str(module) for module in needed - counted}


def test_set_up_compiles_again_when_any_source_has_changed() -> None:
    root = SRC.parent
    lines = (root / "scripts/setup").read_text().splitlines()
    listed = [line for line in lines if line.startswith(("sim=", "compiled"))]
    script = "\n".join([*listed, 'printf "%s\\n" "${compiled[@]}"'])
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    watched = [root / line for line in done.stdout.splitlines()]
    assert len(watched) > 5
    missing = [s for s in sources() if not any(s == w or w in s.parents for w in watched)]
    assert missing == []


def test_every_source_is_there() -> None:
    found = [SIM / name for name in SOURCES] + [AGENT / name for name in SOURCES]
    assert {path.name for path in found if path.exists()} == {Path(name).name for name in SOURCES}
    assert set(sources()) == {
        source
        for path in found
        for source in (path.rglob("*.py") if path.is_dir() else [path])
        if source.exists()
    }


def test_nothing_is_compiled_past_the_scheme() -> None:
    """No module calls numba itself, whose own cache knows one source file alone."""
    users = {module for module in MODULES if any("numba" in name for name in imports(module))}
    assert {module.name for module in users} == set(MECHANISM)
    assert importlib.util.find_spec("numba")


HALF = """
from keepaway_agent.compiled import compiled

@compiled
def half(x):
    return x / 2
"""
KINDS = """
from keepaway_agent.compiled import Kernel
from keepaway_agent.learning.half import half
kernel = Kernel(half)
kernel.compile_for(1)
print(kernel(3), kernel(3.5))
"""


@pytest.mark.parametrize(
    ("variable", "expected"),
    [
        ("KEEPAWAY_CHECKED", "1.5 1.75"),
        ("NUMBA_DISABLE_JIT", "1.5 1.75"),
        ("UNUSED", "1.5 1.5"),  # taken for the whole number that it was compiled for
    ],
)
def test_calls_may_be_checked_or_not_compiled(
    checkout: Checkout, variable: str, expected: str
) -> None:
    checkout.write("keepaway_agent/learning/half.py", HALF)
    command = [sys.executable, "-c", KINDS]
    done = subprocess.run(
        command,
        env=checkout.env | {variable: "1"},
        cwd="/",
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == expected


TOGETHER = """
from keepaway_agent import compiled as agent
from keepaway_agent.learning import caller
from keepaway_sim.world import compiled as sim, caller as world
with sim.postponed() as of_world, agent.postponed() as of_agents:
    agent.Kernel(caller.ask).compile_for()
    agent.Kernel(caller.ask).compile_for()
    sim.Kernel(world.ask).compile_for()
for _ in range(2):
    agent.make([*of_world, *of_agents])
"""


def test_functions_of_both_packages_are_compiled_side_by_side_and_once(checkout: Checkout) -> None:
    command = [sys.executable, "-c", TOGETHER]
    done = subprocess.run(
        command, env=checkout.env, cwd="/", capture_output=True, text=True, check=True
    )
    said = [line for line in done.stderr.splitlines() if line.startswith("compiles ")]
    assert said == ["compiles ask, ask: once for these sources, up to a minute"]


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize(
    "module", ["keepaway_agent.compiled", "keepaway_agent.passing", "keepaway_sim.world.passing"]
)
def test_coverage_is_imported_only_where_it_measures(before: bool, module: str) -> None:
    """It takes a seventh of the time that a node's imports take, and can be imported later."""
    first = "import coverage; " if before else ""
    code = f"{first}import sys, {module}; print('coverage' in sys.modules)"
    again = "; import coverage; from numba.misc import coverage_support as numbas"
    shown = "; print(numbas.coverage_available, coverage.__name__)"
    command = [sys.executable, "-c", code + again + shown]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(before), str(before), "coverage"]
