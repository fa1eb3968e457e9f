"""What happens on other people's machines: odd folders, signals, killed processes, hostile files.

    .venv/bin/python scripts/checks/robustness.py             # the quick rows, some minutes
    .venv/bin/python scripts/checks/robustness.py --long      # all rows, set-ups among them
    .venv/bin/python scripts/checks/robustness.py --only signals --long
    .venv/bin/python scripts/checks/robustness.py --write     # the table of docs/robustness.md

Every row of the table in `src/keepaway_sim/docs/robustness.md` is a function of `robustness_setup`,
`robustness_signals` or `robustness_hostile`: it does what the row describes and fails unless the
row's outcome happens. Rows that tests state already run those tests.
"""

from __future__ import annotations

import argparse
import importlib
import sys

from other_machines import PAGE, ROWS, passes, with_table

from keepaway_sim.cli.interrupts import restore_ctrl_c

SUBJECTS = ("robustness_setup", "robustness_signals", "robustness_hostile")
"""Modules whose rows are the table, in its order."""


def main() -> int:
    """Do the rows, or write the table."""
    args = parse()
    restore_ctrl_c()
    for subject in SUBJECTS:
        importlib.import_module(subject)  # which makes its rows
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
