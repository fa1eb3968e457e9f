"""The measures of fidelity, on made-up play, and the page that is written from their numbers."""

import json
from pathlib import Path

import numpy as np
import pytest

from keepaway_agent.fidelity import learned, page, trajectories
from keepaway_agent.fidelity.reference import Cell, recorded, reference, reference_cells

DOCS = Path(__file__).resolve().parents[3] / "src" / "keepaway_sim" / "docs"


def held(rows):
    """Held cycles of (episode, cycle, keeper, passes)."""
    episode, cycle, keeper, passes = (np.array(column) for column in zip(*rows, strict=True))
    looked = cycle % 3 != 2
    true = np.tile([5.0, 3.5, 8.0], (len(rows), 1))
    believed = true + np.where(looked, 0.0, 0.5)[:, None]
    return learned.Held(episode, cycle, keeper, passes.astype(bool), looked, believed, true)


PLAYED = held(
    [
        (0, 5, 0, False),
        (0, 6, 0, False),
        (0, 7, 0, True),  # after two cycles of holding, set up once
        (0, 8, 0, True),
        (0, 15, 1, True),  # received, and passed on at once
        (0, 25, 1, True),  # it came back to the passer
        (1, 5, 2, False),
    ]
)


def test_behaviour_is_counted_by_passes():
    found = learned.behaviour(learned.LearnedStage(0, np.array([3.0, 1.0]), PLAYED))
    assert found == pytest.approx(
        {
            "mean_s": 2.0,
            "hold_share": 3 / 6,
            "passes_per_episode": 1.5,
            "received_by_other": 0.5,
            "hold_cycles_before_pass": 2 / 3,
            "s_between_passes": 0.9,  # from 7 to 15 and from 15 to 25
            "setup_cycles_per_pass": 1 / 3,
        }
    )


def test_belief_errors_are_told_apart_by_whether_there_was_a_look():
    errors = learned.belief_errors(PLAYED)
    assert list(errors) == ["K1_to_centre", "K1_to_T1", "K1_to_T2"]
    assert errors["K1_to_T1"]["with_look"] == pytest.approx((0.0, 0.0))
    assert errors["K1_to_T1"]["without"] == pytest.approx((0.5, 0.0))


def test_holding_is_told_apart_by_the_distance_of_the_nearest_taker():
    near = PLAYED._replace(believed=np.tile([5.0, 2.5, 8.0], (7, 1)))
    assert learned.hold_share_by_distance(near)["2-3"] == pytest.approx(3 / 7)


def test_a_mean_between_two_sessions_of_the_real_server_is_near():
    cell = Cell("2005", 360, "4v3", "hand", mean=7.5, sem=0.3, second=8.3)
    assert [cell.is_near(mean) for mean in (6.9, 7.2, 8.0, 8.6, 8.8)] == [
        False, True, True, True, False,
    ]  # fmt: skip
    alone = Cell("v19", 360, "3v2", "hold", mean=3.0, sem=0.05)
    assert [alone.is_near(mean) for mean in (2.7, 2.8, 3.2, 3.3)] == [False, True, True, False]


def test_the_reference_has_a_second_session_where_it_was_measured():
    assert {cell.second is not None for cell in reference_cells() if cell.profile == "v19"} == {
        False
    }
    assert sum(cell.second is not None for cell in reference_cells()) == 6


def test_process_statistics_of_a_pass():
    # keeper 0 has the ball for two cycles, it flies three, keeper 1 has it at the end
    x = np.array([0.5, 0.5, 3.0, 6.0, 9.5, 10.0])
    ball = np.stack([x, 0 * x, 0 * x + 2.0, 0 * x], axis=1)
    players = np.zeros((6, 3, 6))
    players[:, 1, 0], players[:, 2, 1] = 10.0, 20.0
    players[:, 2, 2] = 0.4  # the taker runs a metre a cycle before decay
    commands = np.zeros((6, 3, 3), dtype=int)
    commands[2:, 0, 0] = 1
    found = trajectories.process_statistics(
        trajectories.Trajectories(np.zeros(6, dtype=int), ball, players, commands), 2
    )
    assert found["passes"] == 1
    assert found["pass_cycles"] == 3  # from the last cycle with one to the first with another
    assert found["pass_metres"] == pytest.approx(9.0)
    assert found["keeper_kicks"] == 1
    assert found["taker_speed"] == pytest.approx(1.0)
    assert np.isnan(found["first_taker_reach"])


def test_learned_play_stands_beside_the_real_servers_on_the_page():
    columns = reference("hold_times")["E05"]["learned_3v2"]["behaviour"]["columns"]
    recorded_play = recorded("2005", "3v2", "learned")
    assert recorded_play is not None
    learned_part = {
        "curves_s": [[7.0, 8.0, 7.4], [8.0, 10.0, 7.8]],
        "stages": [
            {
                "begin": 2800,
                "behaviour": dict.fromkeys(columns, 0.5),
                "hold_share_by_distance_to_T1_m": {"2-3": 0.25, "6-10": 0.75},
            }
        ],
        "belief_errors": learned.belief_errors(PLAYED),
        "processes": [
            {
                "task": "3v2",
                "policy": "learned",
                "ours": dict.fromkeys(recorded_play["statistics"], 2.0),
                "reference": recorded_play["statistics"],
            }
        ],
    }
    made = {"learned": {"command": "fidelity.py --learned", "code_version": "1"}}
    lines = page.page({"learned": learned_part, "made": made}).splitlines()
    assert "| 400 | 9.0 ± 2.8 | 8.0 | 7.6 | 5.7 | 7.5 |" in lines
    # band of the third block: 7.6 +- 0.57; the runs have 7.62, 7.57, 6.17 and 7.77
    inside = "From episode 400 on 1 of 1, 1 of 1, 0 of 1, 1 of 1 blocks of the real runs lie inside"
    ours, longest = (7.5 + 9.0 + 7.6) / 3, (5.42 + 5.72 + 6.17) / 3
    assert any(line.startswith(inside) for line in lines)
    assert any(line.endswith(f"by 600 episodes: {ours / longest:.2f}.") for line in lines)
    assert "| share of holding, T1 at (m) | 2-3 | 6-10 |" in lines
    assert "| here, from episode 2800 | 0.25 | 0.75 |" in lines
    assert "| K1 to T1 | without | 0.50, 0.00 | 0.48, 0.38 |" in lines
    assert f"| passes | 2 : {recorded_play['statistics']['passes']:.3g} |" in lines


def test_the_page_is_what_its_numbers_say():
    numbers = json.loads((DOCS / "fidelity.json").read_text())
    assert (DOCS / "fidelity.md").read_text() == page.page(numbers)
