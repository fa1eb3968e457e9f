"""What the page of results says of measurements that are not this project's."""

from typing import Any

from keepaway_transfer.reports.evidence import Evidence
from keepaway_transfer.reports.page_parts import Lines, own_picture
from keepaway_transfer.reports.summary import values

MUCH = "6000"
"""The row of Table 2 that is nearest to the real server's run after much 3v2."""

PAPER = [
    "Taylor & Stone (2004) train 4v3 keepers until they hold the ball for 9.0 s on average over"
    " 1,000 episodes, from scratch and after 10 to 9,000 episodes of 3v2 that rho carries over."
    " They report that every amount of 3v2 shortens the time in 4v3, that some shorten the time in"
    " all,"
    " that 9,000 episodes serve 4v3 worse than 1,000 (overtraining), and that transferred keepers"
    " begin hardly better than new ones but learn faster. A modified rho takes 10 to 20 % longer in"
    " all than rho. There is no row that starts with a constant instead of a source: whether it is"
    " what was learned that helps, or only that something is expected of every action, is open"
    " there. The numbers of its Table 2 are lost in the copy at hand, so its claims are compared,"
    " not its hours.",
]  # fmt: skip


def real_server(real: dict[str, Any], table2: Evidence | None) -> Lines:
    """What the real server showed, one run an arm, and what Table 2 shows here of the same."""
    lines = [
        f"{real['what']}. One run an arm shows a direction, no more.",
        "",
        "| 4v3 | hours before | to 8.0 s (h) | to 9.0 s (h)"
        " | first 100 episodes (s, +- over episodes)"
        " | value of the action chosen, first 20 episodes (s) |",
        "|---|---|---|---|---|---|",
    ]
    for arm in real["arms"]:
        mean, error = arm["first_100"]
        to_8, to_9 = (_hours_or_never(arm[key], real) for key in ("to_8", "to_9"))
        lines.append(
            f"| {arm['name']} | {arm['source_hours']:g} | {to_8} | {to_9} | {mean} +- {error}"
            f" | {arm['chosen_value']} |"
        )
    if table2 is not None and MUCH in table2.rows:
        lines += ["", _against_much(real, table2)]
    return [
        *lines,
        "",
        own_picture("Hours of 4v3 to 9.0 s on the real server", "real_server"),
    ]


def _against_much(real: dict[str, Any], table2: Evidence) -> str:
    """How often a trial here is as slow as the real run after much training."""
    most, limit = max(real["arms"], key=lambda arm: arm["source_hours"]), real["limit_hours"]
    hours = values(table2.trials(MUCH), "target_hours")
    if most["to_9"] is not None:
        return f"After much 3v2 it reached 9.0 s in {most['to_9']:g} h."
    slow = sum(one > limit for one in hours)
    return (
        f"The run {most['name']} did not reach 9.0 s in {limit:g} h; here {slow} of {len(hours)}"
        f" trials after {int(MUCH):,} episodes take longer than that. So much training may hurt"
        " more on the real server than here; one run cannot tell."
    )


def _hours_or_never(hours: float | None, real: dict[str, Any]) -> str:
    return f"not in {real['limit_hours']:g}" if hours is None else f"{hours:g}"


def others(measured: dict[str, Any]) -> Lines:
    """What others measured on the real server."""
    lines = [f"{measured['what']}.", "", "| 4v3 | hours |", "|---|---|"]
    lines += [f"| {row['name']} | {row['hours']} |" for row in measured["rows"]]
    return [
        *lines,
        "",
        own_picture("Hours of 4v3 to 9.0 s as others measured them", "others"),
    ]
