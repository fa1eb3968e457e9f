"""What the paper claims, claim by claim, beside what was seen here."""

from keepaway_transfer.reports.evidence import Evidence, Studies, difference
from keepaway_transfer.reports.page_parts import Lines, less, listed
from keepaway_transfer.reports.report import spread
from keepaway_transfer.reports.summary import SIGNIFICANT, verdict

HARDLY_BETTER = 1.0
"""[s] up to which keepers count as hardly better: a third of what hand-coded keepers of 4v3 are
better than random ones."""


def claims(studies: Studies) -> Lines:
    """The table of claims; those of a study that was not run are left out."""
    table2 = studies["table2"]
    lines = [
        _of_rows(table2, "target", "every amount of 3v2 shortens the time in 4v3", every=True),
        _of_rows(table2, "total", "some amounts shorten the time in all", every=False),
        _overtraining(table2),
        _first_episodes(table2),
    ]
    if (variants := studies.get("variants_1000")) is not None:
        lines.append(_modified(variants))
    if (fivevfour := studies.get("fivevfour")) is not None:
        lines.append(_fivevfour(fivevfour))
    return ["| the paper | here | |", "|---|---|---|", *lines]


def _of_rows(table2: Evidence, measure: str, claim: str, *, every: bool) -> str:
    against = {
        name: row.against[table2.scratch]
        for name, row in table2.rows.items()
        if name != table2.scratch
    }
    saves = [
        name
        for name, found in against.items()
        if verdict(getattr(found, measure), getattr(found, f"{measure}_holm")) == "saves"
    ]
    holds = len(saves) == len(against) if every else bool(saves)
    after = f"after {listed(saves)} episodes" if saves else "after no number of episodes"
    return f"| {claim} | shorter {after} | {_word(holds)} |"


def _overtraining(table2: Evidence) -> str:
    least, most = (table2, "1000"), (table2, "9000")
    apart = difference(least, most, "target_hours")
    holds = apart.p_value < SIGNIFICANT and apart.difference < 0
    return (
        "| after 9,000 episodes 4v3 takes longer than after 1,000 |"
        f" {less(apart)} | {_word(holds)} |"
    )


def _first_episodes(table2: Evidence) -> str:
    """How much longer keepers hold the ball at first, after few and after many episodes."""
    found = {
        name: row.against[table2.scratch].jumpstart
        for name, row in table2.rows.items()
        if name != table2.scratch
    }
    shown = [name for name in ("1000", "3000", "6000") if name in found]
    held = [f"{spread(found[name])} s longer after {name}" for name in shown]
    holds = all(one.high < HARDLY_BETTER for one in found.values())
    return f"| keepers begin hardly better than new ones | {listed(held)} | {_word(holds)} |"


def _modified(variants: Evidence) -> str:
    longer = difference((variants, "rho_modified"), (variants, "rho"), "total_hours")
    share = [round(100 * hours / variants.rows["rho"].total.estimate) for hours in longer[:3]]
    return (
        "| a modified rho takes 10 to 20 % longer in all |"
        f" {share[0]} % longer [{share[1]}, {share[2]}] | {_word(share[1] > 0)} |"
    )


def _fivevfour(one: Evidence) -> str:
    found = one.rows["4v3"].against[one.scratch]
    holds = verdict(found.total, found.total_holm) == "saves"
    return (
        "| 4v3 before shortens 5v4, in all, too |"
        f" {less(found.target)} of 5v4, {less(found.total)} in all | {_word(holds)} |"
    )


def _word(holds: bool) -> str:
    return "seen" if holds else "not seen"
