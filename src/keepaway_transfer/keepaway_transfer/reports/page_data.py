"""The sections of the page on the data: which trials they are, and what they were before."""

from keepaway_transfer.reports.evidence import (
    Studies,
    Twins,
    have_one_goal,
    scratch_difference,
    twins,
)
from keepaway_transfer.reports.page_parts import (
    AFTER_EPISODES,
    Lines,
    listed,
    note,
    said_of,
    study_table,
)
from keepaway_transfer.reports.report import shown_p, spread
from keepaway_transfer.reports.summary import values

EARLIER_WORLD = (
    "The world of version e3f9ad8 differed from the real server in learned play: keepers chose"
    " again in every cycle of a pass, rewards counted from the decision, and who marks skipped the"
    " ball holder. Now these rules are the real players', and Table 2 was played anew."
)


def data(studies: Studies) -> Lines:
    """Which trials the page is made of, and what two studies say of the same row."""
    lines = ["| study | trials | seed | code | |", "|---|---|---|---|---|"]
    for name, one in studies.items():
        versions = ", ".join(sorted({record.code_version for record in one.results.records}))
        lines.append(
            f"| [`{name}`](../results/{name}/table.md) | {len(one.results.records)}"
            f" | {one.study.seed} | {versions} | {one.results.note} |"
        )
    return [*lines, "", *_scratch_rows(studies), *_twins(studies)]


def _scratch_rows(studies: Studies) -> Lines:
    """By how much the scratch rows of studies differ from Table 2's."""
    if (table2 := studies.get("table2")) is None:
        return []
    groups: dict[tuple[float, ...], list[str]] = {}
    for name, other in studies.items():
        if other is not table2 and other.has_scratch and have_one_goal(table2, other):
            hours = tuple(values(other.trials(other.scratch), "target_hours"))
            groups.setdefault(hours, []).append(name)
    if not groups:
        return []
    lines = [
        "Rows from scratch that are to the same threshold, against Table 2's (hours of 4v3 more):",
        "",
    ]
    for hours, names in groups.items():
        found = scratch_difference(studies[names[0]], table2)
        same = f", all with the same {len(hours)} trials" if len(names) > 1 else ""
        lines.append(
            f"- {listed([f'`{name}`' for name in names])}"
            + (": Table 2's trials" if found is None else f"{same}: {spread(found)}")
        )
    return lines


def _twins(studies: Studies) -> Lines:
    """Rows that were played twice from source runs that have nothing in common."""
    if not (found := twins(studies)):
        return []
    return [
        "",
        "Rows that start alike in two studies, but from source runs of their own: how much the"
        " draw of source runs is worth (hours of 4v3 saved by the second; p is adjusted over these"
        " lines). Rows of one study with `shared_sources` share their draw.",
        "",
        "| first | hours of 4v3 | second | hours of 4v3 | saved | p |",
        "|---|---|---|---|---|---|",
        *(_twin_row(studies, one) for one in found),
    ]


def _twin_row(studies: Studies, one: Twins) -> str:
    first, second = (
        f"`{study}`, {row} | {spread(studies[study].rows[row].target)}"
        for study, row in (one.first, one.second)
    )
    return f"| {first} | {second} | {spread(one.saved)} | {shown_p(one.p_value)} |"


def history(studies: Studies) -> Lines:
    """What Table 2 was before the world's rules were mended."""
    if (before := studies.get("table2_before")) is None:
        return [EARLIER_WORLD]
    return [
        EARLIER_WORLD,
        "",
        *note(before),
        *said_of(before, "target", "the time in 4v3", AFTER_EPISODES),
        *said_of(before, "total", "the time in all", AFTER_EPISODES),
        "",
        *study_table(before, before.scratch, "episodes of 3v2"),
    ]
