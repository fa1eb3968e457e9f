"""Frames: whom they show where, how many there are, and that videos and windows take them."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.save_video import save_video
from gymnasium.wrappers import RecordEpisodeStatistics, RecordVideo

from keepaway_agent.environments import KeepawayParallelEnv, KeeperEnv, KeeperVectorEnv
from keepaway_agent.environments.pictures import MARGIN, Painter
from keepaway_sim.task import Role, Task
from keepaway_sim.view.palette import TEAM_COLOURS


def rgb(colour: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(colour[1:]))


def pixel_at(frame: np.ndarray, point: np.ndarray, task: Task) -> np.ndarray:
    """The pixel of a point of the field [m]."""
    height, width = frame.shape[:2]
    scale = min(width / (task.field_length + 2 * MARGIN), height / (task.field_width + 2 * MARGIN))
    x, y = frame.shape[1] / 2 + scale * point[0], frame.shape[0] / 2 - scale * point[1]
    pixel: np.ndarray = frame[int(y), int(x)]
    return pixel


@pytest.mark.parametrize("task", [Task(3, 2), Task(4, 3, 40.0, 20.0)])
def test_everybody_is_drawn_in_the_teams_colour_where_the_truth_is(task: Task) -> None:
    env = KeepawayParallelEnv(task=task, render_mode="rgb_array")
    env.reset(seed=1)
    frame = env.render()
    assert frame.dtype == np.uint8
    assert frame.shape[2] == 3
    assert frame.shape[0] % 16 == frame.shape[1] % 16 == 0
    places = env.state()[: 4 * (task.num_players + 1)].reshape(-1, 4)[:, :2]
    for player in range(task.num_players):
        around = places[player] + 0.17 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
        wanted = rgb(TEAM_COLOURS[task.role(player)])
        pixels = [pixel_at(frame, point, task).astype(int) for point in around]
        assert any(np.abs(pixel - wanted).max() < 30 for pixel in pixels), player
    assert (pixel_at(frame, places[-1], task) > 240).all()


def test_colours_are_those_of_the_page(root: Path) -> None:
    page = (root / "src/keepaway_sim/keepaway_sim/view/web/page.css").read_text()
    assert f"--keeper: {TEAM_COLOURS[Role.KEEPER]}" in page
    assert f"--taker: {TEAM_COLOURS[Role.TAKER]}" in page


def test_a_list_of_frames_has_every_cycle_once() -> None:
    env = KeeperEnv(render_mode="rgb_array_list")
    env.reset(seed=3)
    first = len(env.render())
    cycles = sum(env.step(k % 3)[4]["cycles"] for k in range(8))
    assert first >= 1
    assert len(env.render()) == cycles
    assert env.render() == []


def test_many_fields_give_a_frame_each() -> None:
    env = KeeperVectorEnv(3, render_mode="rgb_array")
    env.reset(seed=1)
    frames = env.render()
    assert frames is not None
    assert len(frames) == 3
    assert (frames[0] != frames[1]).any()
    assert KeeperVectorEnv(2).render_mode is None


def test_a_window_shows_every_cycle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr("keepaway_agent.environments.camera.FRAMES_PER_SECOND", 10_000)
    pygame = pytest.importorskip("pygame")
    env = KeeperEnv(render_mode="human")
    shown: list[Any] = []
    monkeypatch.setattr(pygame.display, "flip", lambda: shown.append(1))
    env.reset(seed=3)
    before = len(shown)
    assert len(shown) - before == 0
    cycles = env.step(1)[4]["cycles"]
    assert len(shown) - before == cycles
    assert env.render() is None
    env.close()


def test_a_student_records_a_video_and_statistics_first(tmp_path: Path) -> None:
    made = gymnasium.make("keepaway_agent.environments:Keepaway-v0", render_mode="rgb_array")
    film = RecordVideo(made, str(tmp_path / "videos"), episode_trigger=lambda _: True)
    env = RecordEpisodeStatistics(film)
    env.reset(seed=1)
    over, info, paid = False, dict[str, Any](), 0.0
    while not over:
        _, reward, over, _, info = env.step(1)
        paid += float(reward)
    env.close()
    assert info["episode"]["r"] == paid
    assert (tmp_path / "videos" / "rl-video-episode-0.mp4").stat().st_size > 1000


def test_a_video_of_every_cycle(tmp_path: Path) -> None:
    env = KeeperEnv(render_mode="rgb_array_list")
    env.reset(seed=1)
    for _ in range(4):
        env.step(1)
    save_video(env.render(), str(tmp_path / "videos"), fps=10, episode_trigger=lambda _: True)
    assert (tmp_path / "videos" / "rl-video-episode-0.mp4").stat().st_size > 1000


def test_without_a_render_mode_nothing_is_drawn() -> None:
    env = KeeperEnv()
    env.reset(seed=1)
    assert env.render() is None
    assert Painter(Task()).size == (480, 480)
