"""Frames of a field from above, in the colours of the page of `scripts/view.py`."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from keepaway_agent.actions import Action, Outcome
from keepaway_sim.task import Task
from keepaway_sim.view.palette import BALL, CHALK, GRASS, GRASS_LIGHT, INK, TEAM_COLOURS
from keepaway_sim.world.world import World

LONG_SIDE: Final = 480
"""Pixels along the longer side of a frame."""
BLOCK: Final = 16
"""Both sides of a frame are multiples of this [pixels], as video codecs need."""
MARGIN: Final = 1.6
"""Metres of grass beyond the lines."""
TRAIL: Final = 25
"""Cycles of the ball's way that are drawn."""
_FINE: Final = 2
"""A frame is drawn this many times as large and scaled down, for smooth edges."""
_STRIPES: Final = 5


class Scene(NamedTuple):
    """What of a field is drawn."""

    position: np.ndarray  # (num_players + 1, 2) [m], the ball last
    body: np.ndarray  # (num_players,) [rad]
    face: np.ndarray  # (num_players,) [rad]
    action: np.ndarray  # (num_players,) int64, in force
    target: np.ndarray  # (num_players,) int64
    trail: np.ndarray  # (num_points, 2) [m] the ball's last places, the newest last
    cycle: int
    outcome: int


def scene_of(world: World, field: int, trail: np.ndarray) -> Scene:
    """The present of a field of a World, copied; `trail` is (num_points, 2)."""
    truth, seen = world.truth, world.belief
    return Scene(
        truth.position[field].copy(),
        truth.yaw[field].copy(),
        truth.yaw[field] + seen.neck[field],
        truth.action[field].copy(),
        truth.target[field].copy(),
        trail,
        int(seen.cycle[field]),
        int(seen.outcome[field]),
    )


class Painter:
    """Draws scenes of one task.

    Attributes:
        size: (width, height) of a frame in pixels.
    """

    def __init__(self, task: Task) -> None:
        """Measure the frame, and draw what is the same in all of them."""
        self._task = task
        sides = np.array([task.field_length, task.field_width]) + 2 * MARGIN
        blocks = np.maximum(1, np.round(LONG_SIDE * sides / sides.max() / BLOCK)).astype(int)
        self.size = int(BLOCK * blocks[0]), int(BLOCK * blocks[1])
        self._scale = _FINE * float(min(self.size / sides))  # pixels of a metre
        self._radius = max(0.3 * self._scale, 0.016 * _FINE * min(self.size))
        self._font = ImageFont.load_default(1.25 * self._radius)
        self._ground = self._draw_ground()

    def paint(self, scene: Scene) -> np.ndarray:
        """A frame, (height, width, 3) uint8."""
        image = self._ground.copy()
        pen = ImageDraw.Draw(image, "RGBA")
        for player in range(self._task.num_players):
            self._draw_intent(pen, scene, player)
        self._draw_trail(pen, scene)
        for player in range(self._task.num_players):
            self._draw_player(pen, scene, player)
        self._disc(pen, scene.position[-1], max(0.16 * self._scale, 0.55 * self._radius), BALL)
        self._write(pen, (image.width / 2, 0.6 * self._radius), _caption(scene))
        return np.asarray(image.reduce(_FINE))

    def _place(self, point: np.ndarray) -> tuple[float, float]:
        """Pixels of a point in metres; y goes down in pictures."""
        x, y = point
        width, height = self.size
        return _FINE * width / 2 + x * self._scale, _FINE * height / 2 - y * self._scale

    def _draw_ground(self) -> Image.Image:
        width, height = self.size
        image = Image.new("RGB", (_FINE * width, _FINE * height), GRASS)
        pen = ImageDraw.Draw(image)
        half = np.array([self._task.field_length, self._task.field_width]) / 2
        left, top = self._place(half * (-1, 1))
        right, bottom = self._place(half * (1, -1))
        stripe = (right - left) / _STRIPES
        for k in range(0, _STRIPES, 2):
            pen.rectangle(
                (left + k * stripe, top, left + (k + 1) * stripe, bottom), fill=GRASS_LIGHT
            )
        pen.rectangle(
            (left, top, right, bottom), outline=CHALK, width=max(1, round(0.12 * self._scale))
        )
        return image

    def _draw_intent(self, pen: ImageDraw.ImageDraw, scene: Scene, player: int) -> None:
        action = scene.action[player]
        if action not in (Action.PASS_BALL, Action.MARK_KEEPER):
            return
        start, end = scene.position[player], scene.position[scene.target[player]]
        length = math.dist(start, end)
        dash, gap = (0.5, 0.3) if action == Action.PASS_BALL else (0.12, 0.25)
        for at in np.arange(0.0, length, dash + gap):
            ends = np.array([at, min(at + dash, length)]) / length
            points = [self._place(start + share * (end - start)) for share in ends]
            pen.line(points, fill=self._colour(player), width=round(0.1 * self._scale))

    def _draw_trail(self, pen: ImageDraw.ImageDraw, scene: Scene) -> None:
        points = [self._place(point) for point in scene.trail]
        for age in range(1, len(points)):
            alpha = round(255 * 0.75 * (1 - age / (TRAIL + 1)))
            pen.line(
                points[len(points) - age - 1 : len(points) - age + 1],
                fill=(255, 255, 255, alpha),
                width=round(0.14 * self._scale),
            )

    def _draw_player(self, pen: ImageDraw.ImageDraw, scene: Scene, player: int) -> None:
        at, radius = scene.position[player], self._radius
        self._spoke(pen, at, scene.face[player], (0.0, 1.75), self._colour(player))
        self._disc(pen, at, radius, self._colour(player))
        self._spoke(pen, at, scene.body[player], (0.35, 0.95), INK)
        x, y = self._place(at)
        team, number = self._task.player_names[player].split("_")
        self._write(pen, (x, y + 1.2 * radius), f"{team[0].upper()}{number}")

    def _spoke(
        self,
        pen: ImageDraw.ImageDraw,
        at: np.ndarray,
        direction: float,
        reach: tuple[float, float],
        colour: str,
    ) -> None:
        x, y = self._place(at)
        ahead = self._radius * np.array([math.cos(direction), -math.sin(direction)])
        points = [(x + share * ahead[0], y + share * ahead[1]) for share in reach]
        pen.line(points, fill=colour, width=max(1, round(0.27 * self._radius)))

    def _disc(self, pen: ImageDraw.ImageDraw, at: np.ndarray, radius: float, colour: str) -> None:
        rim = max(1, round(0.16 * self._radius))
        pen.circle(self._place(at), radius, fill=colour, outline=INK, width=rim)

    def _write(self, pen: ImageDraw.ImageDraw, at: tuple[float, float], text: str) -> None:
        rim = max(1, round(0.12 * self._radius))
        pen.text(at, text, "#ffffff", self._font, "mt", stroke_width=rim, stroke_fill=GRASS)

    def _colour(self, player: int) -> str:
        return TEAM_COLOURS[self._task.role(player)]


def _caption(scene: Scene) -> str:
    seconds = f"{scene.cycle / 10:.1f} s"
    if scene.outcome == Outcome.IN_PLAY:
        return seconds
    return f"{seconds}, {Outcome(scene.outcome).name.lower().replace('_', ' ')}"
