"""What `render` gives: a frame, all frames since the last one, or a window."""

from __future__ import annotations

from collections import deque
from typing import Any, Final

import numpy as np

from keepaway_agent.environments.fields import DecisionFields
from keepaway_agent.environments.pictures import TRAIL, Painter, Scene, scene_of
from keepaway_agent.environments.refusals import UnsupportedModeError

FRAMES_PER_SECOND: Final = 10
"""A cycle is 0.1 s."""
MAX_KEPT: Final = 36_000
"""Frames that are kept for rgb_array_list, an hour of play; the oldest go."""


class Camera:
    """Follows fields cycle by cycle, if there is a render mode; else it costs nothing."""

    def __init__(self, fields: DecisionFields, render_mode: str | None) -> None:
        """Prepare; frames are drawn on request."""
        self._fields, self._mode = fields, render_mode
        self._balls: deque[np.ndarray] = deque(maxlen=TRAIL + 1)  # (num_fields, 2) [m]
        self._film: deque[Scene] = deque(maxlen=MAX_KEPT)
        self._painter: Painter | None = None
        self._window: Any = None
        if render_mode is not None:
            fields.watchers.append(self.follow)

    def follow(self, fields: DecisionFields) -> None:
        """Take note of a cycle that was played."""
        self._balls.append(fields.world.truth.position[:, -1].copy())
        if self._mode == "rgb_array_list":
            self._film.append(self._scene(0))
        elif self._mode == "human":
            self._show(self.frame(0))

    def render(self) -> Any:
        """A frame or frames of field 0, by the render mode."""
        if self._mode == "rgb_array":
            return self.frame(0)
        if self._mode == "rgb_array_list":
            film, self._film = list(self._film), deque(maxlen=MAX_KEPT)
            return [self._paint(scene) for scene in film]
        return None

    def frame(self, field: int) -> np.ndarray:
        """(height, width, 3) uint8, a field as it is now."""
        return self._paint(self._scene(field))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            import pygame

            pygame.display.quit()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles have no window; they open one of their own."""
        return self.__dict__ | {"_window": None, "_painter": None}

    def _scene(self, field: int) -> Scene:
        cycle = int(self._fields.cycle[field])
        trail = [balls[field] for balls in self._balls][-cycle - 1 :]
        return scene_of(self._fields.world, field, np.array(trail).reshape(-1, 2))

    def _paint(self, scene: Scene) -> np.ndarray:
        if self._painter is None:
            self._painter = Painter(self._fields.task)
        return self._painter.paint(scene)

    def _show(self, frame: np.ndarray) -> None:
        """Put a frame into the window, and wait until its time has come."""
        import pygame

        if self._window is None:
            self._window = _open_window(frame.shape[1], frame.shape[0])
        screen, clock = self._window
        pygame.event.pump()
        screen.blit(pygame.surfarray.make_surface(frame.swapaxes(0, 1)), (0, 0))
        pygame.display.flip()
        clock.tick(FRAMES_PER_SECOND)


def _open_window(width: int, height: int) -> tuple[Any, Any]:
    """A window of the desktop, and the clock that its frames keep to."""
    try:
        import pygame

        pygame.display.init()
        pygame.display.set_caption("keepaway")
        return pygame.display.set_mode((width, height)), pygame.time.Clock()
    except (ImportError, RuntimeError) as error:  # pygame.error is a RuntimeError
        raise UnsupportedModeError(
            f"render_mode='human': no window can be opened ({error}); take rgb_array"
        ) from error
