"""The real server's measurements as they are read."""

import numpy as np

from keepaway_agent.fidelity.reference import (
    GOALS,
    GOALS_NARROW,
    SESSIONS,
    Cell,
    reference,
    reference_cells,
    reference_curves,
    reference_processes,
)


def test_every_number_of_the_file_is_in_a_cell():
    cells = {(c.profile, c.visible_angle, c.task, c.policy): c for c in reference_cells()}
    times = reference("hold_times")
    counted = 0
    for profile, name in SESSIONS.items():
        for view, tasks in times[name].items():
            if not view.startswith("visible_angle_"):
                continue
            for task, policies in tasks.items():
                for policy, numbers in policies.items():
                    cell = cells[profile, int(view.removeprefix("visible_angle_")), task, policy]
                    assert (cell.mean, cell.sem) == (numbers["mean"], numbers["sem"])
                    counted += 1
    assert counted == len(cells) > 6


def test_a_narrow_view_has_a_goal_of_its_own():
    assert Cell("2005", 90, "3v2", "hand", 9.0, 0.1).goal == GOALS_NARROW["hand"]
    assert Cell("2005", 360, "3v2", "hand", 6.0, 0.1).goal == GOALS["hand"]


def test_learning_curves_are_blocks_of_durations():
    for profile in SESSIONS:
        curves = reference_curves(profile)
        assert curves
        for curve in curves:
            assert curve.ndim == 1
            assert np.all((curve > 1.0) & (curve < 60.0))


def test_recorded_processes_are_of_full_vision_only():
    assert reference_processes(Cell("2005", 90, "3v2", "hand", 9.0, 0.1)) is None
    recorded = reference_processes(Cell("2005", 360, "3v2", "hand", 6.0, 0.1))
    assert recorded is not None
    assert len(recorded["cycles"]) == recorded["episodes"]
