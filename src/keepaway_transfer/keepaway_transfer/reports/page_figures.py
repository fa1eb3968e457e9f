"""The figures of the page of results that are not a study's own."""

from typing import Any

from matplotlib.figure import Figure

from keepaway_transfer.reports import plotting
from keepaway_transfer.reports.evidence import Studies, beyond_optimism
from keepaway_transfer.reports.page_parts import elsewhere
from keepaway_transfer.reports.statistics import Interval


def page_figures(studies: Studies) -> dict[str, Figure]:
    """The figures of the page that are not a study's own, by name."""
    measured = elsewhere()
    figures = {
        "real_server": _real_server_figure(measured["real_server"]),
        "others": _others_figure(measured["others"]),
    }
    if {"table2", "optimistic"} <= studies.keys():
        figures["beyond_optimism"] = _beyond_figure(studies)
    return figures


def _real_server_figure(real: dict[str, Any]) -> Figure:
    limit = real["limit_hours"]
    hours = [limit if arm["to_9"] is None else arm["to_9"] for arm in real["arms"]]
    labels = [
        arm["name"] + (f" (not in {limit:g} h)" if arm["to_9"] is None else "")
        for arm in real["arms"]
    ]
    return plotting.intervals(
        labels,
        [Interval(one, one, one) for one in hours],
        title="The real server, one run an arm",
        x_label="Hours of 4v3 to 9.0 s",
    )


def _others_figure(others: dict[str, Any]) -> Figure:
    return plotting.intervals(
        [row["name"] for row in others["rows"]],
        [Interval(row["hours"], row["hours"], row["hours"]) for row in others["rows"]],
        title="Hua & Sheppard 2023, means of 10 trials",
        x_label="Hours of 4v3 to 9.0 s",
    )


def _beyond_figure(studies: Studies) -> Figure:
    found = beyond_optimism(studies)
    return plotting.intervals(
        list(found),
        [Interval(*total[:3]) for _, total, _ in found.values()],
        title=f"Table 2 against the best optimistic start ({studies['optimistic'].best('target')})",
        x_label="Total hours saved",
        zero=True,
    )
