"""Feed broken input to everything that reads what others wrote, and count what comes of it.

    .venv/bin/python scripts/checks/fuzz.py --cases 100000

A case is a valid input with some of its bytes cut, flipped, repeated or replaced (hypothesis makes
and, where one fails, shrinks them). It must be taken as valid or refused with the reader's own
kind of error, within seconds and a bounded memory. Anything else - another exception, a hang, a
value that no player, world or table can have - ends the script, and the case is in fuzz_case.bin.
"""

import argparse
import math
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from fuzz_targets import Target, make_targets
from hypothesis import HealthCheck, Phase, given, seed, settings
from mutations import broken

CASE = Path("fuzz_case.bin")  # where a case that fails is left
LONGEST = 5.0  # [s] of CPU time that a case may take
MOST_MEMORY = 2**30  # [bytes] that all cases may take beyond what the program has


class Result(NamedTuple):
    """What came of a target's cases."""

    accepted: int
    refused: int
    longest: float  # [s] of CPU time


class HangError(Exception):
    """A case took too long."""


def main() -> int:
    """Fuzz all targets, or some; print a table."""
    args = parse()
    limit_memory()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        targets = make_targets(Path(folder))
        chosen = {name: targets[name] for name in args.targets or targets}
        print(f"{'what is read':24} {'cases':>8} {'accepted':>8} {'refused':>8} {'longest':>9}")
        total = 0
        for name, target in chosen.items():
            result = fuzz(target, math.ceil(args.cases / len(chosen)), args.seed)
            cases = result.accepted + result.refused
            total += cases
            print(
                f"{name:24} {cases:8,} {result.accepted:8,} {result.refused:8,}"
                f" {1000 * result.longest:6.0f} ms",
                flush=True,
            )
    print(f"{'all':24} {total:8,} cases, no crash, no hang, nothing accepted that makes no sense")
    return 0


def fuzz(target: Target, cases: int, number: int) -> Result:
    """Read that many cases.

    Raises:
        Exception: whatever else than a refusal comes of a case; HangError: nothing does.
    """
    counts: Counter[str] = Counter()
    longest, last = 0.0, b""

    @seed(number)
    @settings(
        max_examples=cases,
        deadline=None,
        database=None,
        report_multiple_bugs=False,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(broken(target.valid))
    def read(data: bytes) -> None:
        nonlocal longest, last
        last = data
        began = time.process_time()
        with time_limit():
            try:
                counts["accepted" if target.read(data) is not None else "refused"] += 1
            except target.refusals:
                counts["refused"] += 1
        longest = max(longest, time.process_time() - began)

    try:
        read()
    except Exception:
        CASE.write_bytes(last)
        raise
    return Result(counts["accepted"], counts["refused"], longest)


def limit_memory() -> None:
    """From now on asking for much more memory fails."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_MEMORY, resource.RLIM_INFINITY))


@contextmanager
def time_limit() -> Iterator[None]:
    """What takes too long is interrupted."""
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def interrupt(*_: object) -> None:
    """The time is up."""
    raise HangError(f"more than {LONGEST} s")


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("targets", nargs="*", help="what to fuzz, as the table names it (default: everything)")
    add("--cases", type=int, default=100_000, help="in all (default 100,000)")
    add("--seed", type=int, default=0, help="of the cases (default 0)")
    return parser.parse_args()


if __name__ == "__main__":
    signal.signal(signal.SIGPROF, interrupt)
    sys.exit(main())
