"""What happens on other people's machines: odd folders, signals, killed processes, hostile files.

    .venv/bin/python scripts/checks/robustness.py             # the quick rows, some minutes
    .venv/bin/python scripts/checks/robustness.py --long      # all rows, set-ups among them
    .venv/bin/python scripts/checks/robustness.py --only signals --long
    .venv/bin/python scripts/checks/robustness.py --write     # the table of docs/robustness.md

Every row of the table in `src/keepaway_sim/docs/robustness.md` is a function here, which does what
the row says was done, and fails unless what the row says happens. Rows that tests state already run
those tests.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from other_machines import (
    CLOCK,
    NO_LINKS,
    PAGE,
    ROOT,
    ROWS,
    bombs,
    copy_checkout,
    environment,
    expect_one_line,
    expect_success,
    passes,
    row,
    run,
    run_tests,
    script,
    shared_library,
    training,
    with_table,
)

from keepaway_sim.cli.interrupts import restore_ctrl_c

ODD_NAME = "it's ü (x) $HOME & \\ \" 🙂 ` end"
MAX_MEMORY = 500e6  # [bytes] that refusing a file may take


def main() -> int:
    """Do the rows, or write the table."""
    args = parse()
    restore_ctrl_c()
    page = with_table(PAGE.read_text(encoding="utf-8"))
    if args.write:
        PAGE.write_text(page, encoding="utf-8")
    if args.print:
        print(page, end="")
    if args.write or args.print:
        return 0
    chosen = {n: r for n, r in ROWS.items() if args.only in n and (args.long or not r.is_long)}
    failed = sum(not passes(name, each) for name, each in chosen.items())
    print(f"robustness: {failed} rows failed" if failed else "robustness: all as it should be")
    return min(failed, 1)


# Set-up


@row(
    "`scripts/setup` where the path has `:`, `;`, a line break or `$LIB` in it",
    "refused at once in a line that names the character",
)
def path_that_cannot_work(folder: Path) -> None:
    """Characters that separate lists of folders."""
    for odd in (":", ";", "\n", "$LIB"):
        place = folder / f"a{odd}b" / "scripts"
        place.mkdir(parents=True)
        shutil.copy(ROOT / "scripts/setup", place)
        done = run([str(place / "setup")])
        expect_one_line(done, f"has '{odd.replace(chr(10), chr(92) + 'n')}' in it")


@row(
    "`scripts/setup` beside a `.venv` that it did not make",
    "refused in a line; the `.venv` is as it was",
)
def somebody_elses_venv(folder: Path) -> None:
    """A .venv of a person's own is not replaced."""
    copy_checkout(folder)
    own = folder / ".venv" / "notes.txt"
    own.parent.mkdir()
    own.write_text("mine")
    done = run([str(folder / "scripts/setup")])
    assert done.returncode == 1, done
    assert "was not made by this script" in done.stderr, done
    assert [path.name for path in own.parent.iterdir()] == ["notes.txt"]


@row(
    f"set-up, a training and a match in a folder called `{ODD_NAME.replace('`', chr(39))}` (with a"
    " backtick), with `LC_ALL=C` and umask 077",
    "all work; messages were built in a plainly named folder, which is gone",
    is_long=True,
)
def odd_folder(folder: Path) -> None:
    """A whole set-up where CMake cannot build."""
    place = folder / ODD_NAME
    copy_checkout(place)
    python = str(place / ".venv/bin/python")
    expect_success(["bash", "-c", 'umask 077; "$0"', str(place / "scripts/setup")], LC_ALL="C")
    out = str(place / "out")
    train = [python, str(place / "scripts/train.py"), "--episodes", "5", "--save-weights", out]
    expect_success(train, LC_ALL="C")
    match = [python, str(place / "scripts/match.py"), "--episodes", "2"]
    expect_success([*match, "--single-process", "--domain", "21"], LC_ALL="C")
    assert not list(Path(tempfile.gettempdir()).glob("keepaway-setup-*"))


@row(
    "`scripts/setup` killed (SIGKILL, with all that it had started) at 5 moments, and run again",
    "the last run makes it whole: messages import, and a training runs",
    is_long=True,
)
def killed_setup(folder: Path) -> None:
    """Killed at any moment, run again it is whole."""
    copy_checkout(folder)
    for _ in range(5):
        with subprocess.Popen([str(folder / "scripts/setup")], start_new_session=True) as started:
            time.sleep(random.uniform(1, 90))
            os.killpg(started.pid, signal.SIGKILL)
    expect_success([str(folder / "scripts/setup")])
    python = str(folder / ".venv/bin/python")
    expect_success([python, "-c", "import keepaway_msgs.msg"])
    expect_success([python, str(folder / "scripts/train.py"), "--episodes", "5"])


@row(
    "set-up, a training and a match by another user, who may not write in the checkout",
    "nothing is made anew and all work; logs go to that user's home",
    is_long=True,
)
def another_users_checkout(folder: Path) -> None:
    """Needs root, to be another user, and a Python that others may run."""
    assert os.geteuid() == 0, "run it as root"
    place, home = folder / "checkout", folder / "home"
    home.mkdir()
    os.chown(home, 65534, 65534)
    folder.chmod(0o755)
    copy_checkout(place)
    expect_success([str(place / "scripts/setup"), "--no-compile"], PYTHON="/usr/bin/python3")
    other = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    expect_success([*other, str(place / "scripts/setup"), "--no-compile"], HOME=str(home))
    for words in ("train.py --episodes 5", "match.py --episodes 2 --domain 21 --single-process"):
        name, *options = words.split()
        command = [str(place / ".venv/bin/python"), str(place / "scripts" / name), *options]
        expect_success([*other, *command], HOME=str(home), cwd=str(home))


# Files


@row(
    "`scripts/demo --out DIR`, where DIR holds a letter; where it holds an earlier demo and notes",
    "refused, and the letter stays; of the demo only what it made is replaced, and the notes stay",
)
def demo_folder(folder: Path) -> None:
    """Nothing a user owns is deleted."""
    run_tests("tests/scripts/test_demo.py")


@row(
    "a training into a file system without hard links (`link` fails with EPERM)",
    "the same files, whole, and none beside them",
)
def no_hard_links(folder: Path) -> None:
    """Like exFAT, SMB and some FUSE file systems."""
    library = shared_library(folder, NO_LINKS)
    out = folder / "out"
    expect_success([*training("--episodes", 5), "--save-weights", str(out)], LD_PRELOAD=library)
    names = sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())
    weights = [f"keeper_{number}.npz" for number in (1, 2, 3)]
    trial = [f"trial_0000/{name}" for name in ("episodes.csv", *weights)]
    assert names == [*weights, "training.json", *trial], names


@row(
    "a trial that cannot be moved into its place; weights that cannot",
    "kept beside it under a name that the error says",
)
def kept_beside(folder: Path) -> None:
    """A learned table is never lost."""
    run_tests("tests/agent/test_files.py")


@row(
    "`--save-weights`, `--out` in a place that cannot be written",
    "refused in a line before the work begins",
)
def unwritable_folder(folder: Path) -> None:
    """Known before hours of work."""
    for command in (
        [*training("--episodes", 10**7), "--save-weights", "/proc/keepaway"],
        [*script("study.py", "tiny"), "--out", "/proc/keepaway"],
    ):
        done = run(command)
        expect_one_line(done, "/proc/keepaway")


# Interrupted work


@row(
    "SIGINT, two SIGINTs in 50 ms, SIGTERM, SIGHUP to a training of two processes",
    "finished trials are saved, one line says how to continue; codes 130, 130, 143, 129; no process"
    " is left, and no word of a resource tracker",
)
def signals_to_a_training(folder: Path) -> None:
    """It ends as with Ctrl-C, whatever asks."""
    run_tests("tests/agent/training/test_workers.py", "-k", "signal")


@row(
    "SIGKILL, two SIGINTs in 50 ms, SIGTERM, SIGHUP to a study, which is then resumed",
    "the same trials in the end as of a study that nothing interrupted",
    is_long=True,
)
def signals_to_a_study(folder: Path) -> None:
    """Interrupted at any moment."""
    run_tests("tests/scripts/test_study_script.py", "-k", "stopped")


@row(
    "SIGINT at 8 moments of the 2 s in which a script imports its modules",
    "one line or none, code 130",
)
def signal_while_importing(folder: Path) -> None:
    """No traceback of modules half imported."""
    for number in range(8):
        command = training("--episodes", 10**7)
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as started:
            time.sleep(0.15 + 0.25 * number)
            started.send_signal(signal.SIGINT)
            _, said = started.communicate(timeout=60)
        assert started.returncode in (130, -signal.SIGINT), (started.returncode, said)
        assert b"Traceback" not in said, said.decode()


@row(
    "SIGINT, two SIGINTs in 50 ms, SIGTERM, SIGHUP to `view.py --live`",
    "it ends with 130, 130, 143, 129 and without a word",
)
def signals_to_a_live_view(folder: Path) -> None:
    """The page's server goes as it came."""
    for number, times in (
        (signal.SIGINT, 1),
        (signal.SIGINT, 2),
        (signal.SIGTERM, 1),
        (signal.SIGHUP, 1),
    ):
        command = script("view.py", "--live", "--port", "0")
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment()
        ) as started:
            assert started.stdout
            started.stdout.readline()
            for _ in range(times):
                started.send_signal(number)
                time.sleep(0.05)
            _, said = started.communicate(timeout=60)
        assert started.returncode == 128 + number, (started.returncode, said)
        assert said == b"", said.decode()


@row(
    "SIGTERM and SIGINT, in turn, at 30 moments of the start of `replay.py`",
    "code 143 or 130, and at most one line",
    is_long=True,
)
def signals_to_a_replay(folder: Path) -> None:
    """Its start has no moment in which a signal leaves a traceback."""
    bag = folder / "bag"
    trial = ("--episodes", 3, "--trials", 1, "--record", bag)
    expect_success(script("train.py", "--policy", "hand", *trial))
    for number in range(30):
        chosen = (signal.SIGTERM, signal.SIGINT)[number % 2]
        command = script("replay.py", bag)
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment()
        ) as started:
            time.sleep(0.02 + 0.1 * number)
            started.send_signal(chosen)
            _, said = started.communicate(timeout=60)
        # Python's own handlers end the process by the signal itself: to a shell the same codes.
        assert started.returncode in (128 + chosen, -chosen), (number, started.returncode, said)
        assert len(said.splitlines()) <= 1, said.decode()
        assert b"Traceback" not in said, said.decode()


@row(
    "`kill -9` of one of a training's two processes, and of all again and again",
    "noticed at once, its trials are played again and give the same, a line says so; the second"
    " ends in a line",
)
def killed_worker_of_a_training(folder: Path) -> None:
    """A process that dies takes nothing with it."""
    run_tests("tests/agent/training/test_workers.py", "-k", "killed or fails")


@row(
    "`kill -9` of a study's process",
    "its batch is played again by another, a line says so, and the study ends with the same trials",
)
def killed_worker_of_a_study(folder: Path) -> None:
    """Where `ProcessPoolExecutor` gave up everything."""
    run_tests("tests/transfer/studies/test_processes.py")
    run_tests("tests/scripts/test_study_script.py", "-k", "killed")


# Studies and clocks


@row(
    "`--resume` of packed trials; two studies that begin one folder at once; 300 trials of a run",
    "new trials are added to the packed ones; one of the two is refused; no trial that is on the"
    " disk is kept in memory",
)
def studies(folder: Path) -> None:
    """Results are never mixed or lost."""
    run_tests("tests/transfer/studies/test_results.py", "tests/transfer/studies/test_experiment.py")


@row(
    "the wall's clock set back by an hour under a recorded match of six processes",
    "the match continues to its end, and the bag is whole",
    is_long=True,
)
def clock_set_back(folder: Path) -> None:
    """Nothing waits by the wall's clock."""
    back = folder / "back"
    wrong = {"LD_PRELOAD": shared_library(folder, CLOCK), "CLOCK_BACK_WHEN": str(back)}
    bag = str(folder / "bag")
    command = script("match.py", "--speed", 1, "--episodes", 4, "--domain", 21, "--record", bag)
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(**wrong),
    ) as started:
        assert started.stdout
        while not any(path.stat().st_size > 10_000 for path in Path(bag).glob("*.mcap")):
            assert started.poll() is None
            time.sleep(0.1)  # until it plays
        back.touch()
        said, _ = started.communicate(timeout=300)
    assert started.returncode == 0, said
    assert "Error" not in said, said
    expect_success(script("replay.py", bag, "--check"))


# Hostile files and browsers


@row(
    "weights files that unpack to gigabytes, name 10^9 players, hold pickles, NaN, 1e308, escapes"
    " of terminals, paths, thousands of members, numbers of 4,000 digits",
    "refused in a printable line of at most 1,000 characters before anything is sized by them",
)
def hostile_weights(folder: Path) -> None:
    """Reads are bounded, numbers and texts checked first."""
    run_tests("tests/agent/learning/test_weights.py")


@row(
    "the same files given to `describe.py`",
    "one line that names the file, code 1, less than 500 MB",
)
def hostile_weights_described(folder: Path) -> None:
    """As a person meets them."""
    for name, data in bombs():
        path = folder / name
        path.write_bytes(data)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        done = run(script("describe.py", str(path)))
        peak = 1024 * max(before, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
        assert peak < MAX_MEMORY, f"{peak / 1e6:.0f} MB"
        expect_one_line(done, name)


@row(
    "requests that do not come, that come byte by byte, 23 connections where 3 may be, a browser"
    " that takes nothing, other hosts' names, `localhost` on port 80, matches with hostile names",
    "each ends in time and holds no thread; other origins get 403; the match is refused, and"
    " names are text",
)
def live_server(folder: Path) -> None:
    """Browsers and their pages are not trusted."""
    run_tests("tests/sim/view/test_live.py", "-k", "not follows")


@row(
    "every `json.dumps`, every clock and every removal in `src/` and `scripts/` looked up",
    "JSON refuses NaN, no program reads the wall's clock to wait, removals are those listed below",
)
def audit(folder: Path) -> None:
    """What the code may not do anywhere."""
    run_tests("tests/contracts/test_machines.py")


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--long", action="store_true", help="rows that take minutes too")
    parser.add_argument("--only", default="", metavar="WORD", help="rows with this in their name")
    parser.add_argument("--write", action="store_true", help="write the table of the docs page")
    parser.add_argument("--print", action="store_true", help="the page as it would be written")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
