"""Rows of `robustness.py`: signals, killed processes, resumed studies, a clock that jumps."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

from other_machines import (
    environment,
    expect_stopped,
    expect_success,
    row,
    run_tests,
    script,
    shared_library,
    training,
)

CLOCK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static long shift(void) {  /* an hour back, once the file CLOCK_BACK_WHEN is there */
    static int seen;
    const char *file = getenv("CLOCK_BACK_WHEN");
    if (!seen && file) seen = access(file, F_OK) == 0;
    return seen ? -3600 : 0;
}
int clock_gettime(clockid_t id, struct timespec *t) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(id, t);
    if (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE) t->tv_sec += shift();
    return result;
}
int gettimeofday(struct timeval *restrict t, void *restrict zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec;
    t->tv_usec = now.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *out) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec;
    return now.tv_sec;
}
"""


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
    "SIGINT at 8 moments of the time in which a script imports its modules",
    "one line or none, code 130",
)
def signal_while_importing(folder: Path) -> None:
    """No traceback of modules half imported."""
    for _ in range(2):  # a first start may compile byte code
        begun = time.monotonic()
        expect_success(training("--help"))
        took = time.monotonic() - begun
    for number in range(8):
        command = training("--episodes", 10**7)
        lines = expect_stopped(command, signal.SIGINT, after=took * (0.25 + 0.1 * number))
        assert len(lines) <= 1, lines


@row(
    "SIGINT, two SIGINTs in 50 ms, SIGTERM, SIGHUP to `view.py --live`",
    "it ends with 130, 130, 143, 129 and without a word",
)
def signals_to_a_live_view(folder: Path) -> None:
    """The page's server goes as it came."""
    interrupts = (signal.SIGINT, 1), (signal.SIGINT, 2), (signal.SIGTERM, 1), (signal.SIGHUP, 1)
    for number, times in interrupts:
        assert not expect_stopped(script("view.py", "--live", "--port", "0"), number, times)


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
        lines = expect_stopped(script("replay.py", bag), chosen, after=0.02 + 0.1 * number)
        assert len(lines) <= 1, (number, lines)


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
    run_tests("tests/transfer/studies/test_study_processes.py")
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
