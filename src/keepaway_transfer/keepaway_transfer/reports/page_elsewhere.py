"""What the page of results says of measurements that are not this project's."""

from typing import Any

from keepaway_transfer.reports.page_parts import Lines, own_picture

PAPER = [
    "Taylor & Stone (2004) train 4v3 keepers until they hold the ball for 9.0 s on average over"
    " 1,000 episodes, from scratch and after 10 to 9,000 episodes of 3v2 that rho carries over."
    " They report that every amount of 3v2 shortens the time in 4v3, that some shorten the time in"
    " all,"
    " that 9,000 episodes serve 4v3 worse than 1,000 (overtraining), and that transferred keepers"
    " begin hardly better than new ones but learn faster. A modified rho takes 10 to 20 % longer in"
    " all than rho. There is no row that starts with a constant instead of a source: whether it is"
    " what was learned that helps, or only that something is expected of every action, is open"
    " there.",
]  # fmt: skip


def real_server(real: dict[str, Any]) -> Lines:
    """What the real server showed, one run an arm."""
    lines = [
        f"{real['what']}. One run an arm shows a direction, no more.",
        "",
        "| 4v3 | hours before | to 8.0 s (h) | to 9.0 s (h) | first 100 episodes (s)"
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
    return [
        *lines,
        "",
        own_picture("Hours of 4v3 to 9.0 s on the real server", "real_server"),
    ]


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
