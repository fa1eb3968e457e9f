"""Small scenes for tests of perception and skills, drawn in ASCII: a cell is a square metre.

`1` to `9` are keepers, `a` to `k` takers, `o` is the ball. The lower left cell is (0, 0) unless a
test says otherwise; x goes to the right, y up. Everybody faces +x and is at rest.
"""

import math

import numpy as np

from keepaway_sim.task import Task
from keepaway_sim.world import sight, state
from keepaway_sim.world.config import NEVER, Config, noiseless, profile
from keepaway_sim.world.constants import pack
from keepaway_sim.world.skills import kicking, tactics
from keepaway_sim.world.skills.prediction import cycles_to_ball

EXACT = noiseless(profile("2005"))  # every noise and rounding off


class Scene:
    """One field on which all players know who is drawn, and of nobody else.

    Players that are not drawn stand at (-5, -12), for whoever looks.

    Attributes:
        c: constants.
        s: what players believe (`vision.Perceptions`).
        m: what they remember (`vision.Memory`).
        speech: what they say.
        position, velocity, yaw: the truth, (P + 1, 2), (P + 1, 2), (P,).
    """

    def __init__(
        self,
        drawing: str,
        config: Config = EXACT,
        field: float = 25.0,
        corner: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        places = _places(drawing, *corner)
        keepers = max([2, *(int(name) for name in places if name.isdigit())])
        takers = max([1, *(ord(name) - 96 for name in places if name in "abcdefghijk")])
        self.c = pack(Task(keepers, takers, field, field), config)
        self.num_keepers, self.ball = keepers, keepers + takers
        self.s = state.make_perceptions(1, self.ball)
        self.m = state.make_memory(self.c, 1)
        self.speech = state.make_speech(1, self.ball)
        self.position = np.tile([-5.0, -12.0], (self.ball + 1, 1))
        self.velocity = np.zeros((self.ball + 1, 2))
        self.yaw = np.zeros(self.ball)
        for name, (x, y) in places.items():
            self.put(name, x, y)
            self.s.age[0, :, self.index(name)] = 0

    def index(self, name: str) -> int:
        """The object's number, in match order."""
        if name == "o":
            return self.ball
        return int(name) - 1 if name.isdigit() else self.num_keepers + ord(name) - 97

    def put(self, name: str, x: float, y: float) -> None:
        """Put an object somewhere else than it was drawn."""
        self.position[self.index(name)] = x, y
        self.believe()

    def move(self, name: str, vx: float, vy: float) -> None:
        """Give an object a velocity [m/cycle]."""
        self.velocity[self.index(name)] = vx, vy
        self.believe()

    def face(self, name: str, degrees: float) -> None:
        """Turn a player's body."""
        self.yaw[self.index(name)] = math.radians(degrees)
        self.believe()

    def believe(self) -> None:
        """All players believe the truth (of whom they know) and what follows from it."""
        self.s.position[0], self.s.velocity[0], self.s.body[0] = (
            self.position,
            self.velocity,
            self.yaw,
        )
        away = np.linalg.norm(self.position[:-1] - self.position[-1], axis=1)
        self.s.ball_kickable[0] = away < self.c.kickable_distance

    def lose(self, name: str, age: int = NEVER) -> None:
        """Let everybody have seen an object `age` cycles ago for the last time."""
        self.s.age[0, :, self.index(name)] = age

    def predict_meetings(self, name: str) -> None:
        """Let a player work out how soon each known team-mate reaches the ball."""
        p = self.index(name)
        for j in range(self.num_keepers):
            if self.s.age[0, p, j] < NEVER:
                self.s.cycles_to_ball[0, p, j] = cycles_to_ball(
                    self.c,
                    *self.position[j],
                    *self.velocity[j],
                    math.cos(self.yaw[j]),
                    math.sin(self.yaw[j]),
                    self.position[-1],
                    self.velocity[-1],
                    2 * self.c.intercept_horizon - 1,
                )

    def command(self, name: str, action: int, target: str = "1") -> tuple[float, float, float]:
        """A player's command: kind, power, angle [deg]."""
        p, aim = self.index(name), self.index(target)
        kind, power, angle = tactics.command(self.c, self.s, self.m, 0, p, int(action), aim)
        return kind, power, math.degrees(angle)

    def ball_after(self, name: str, command: tuple[float, float, float]) -> np.ndarray:
        """Where the ball is a cycle after a player's command (kind, power, degrees)."""
        kind, power, angle = command
        p = self.index(name)
        return np.array(kicking.ball_after(self.c, self.s, 0, p, kind, power, math.radians(angle)))

    def look(self, name: str, *uniforms: float) -> None:
        """Let a player see the truth; `uniforms` are the random numbers that it takes."""
        block = np.array([[*uniforms, *[math.nan] * 64]])
        cursor = np.zeros(1, dtype=np.int64)
        truth = self.position, self.velocity, self.yaw
        sight.look(self.c, self.s, self.m, *truth, 0, self.index(name), block, cursor)
        assert cursor[0] == len(uniforms)

    def seen(self, name: str, what: str) -> np.ndarray:
        """Where a player believes an object to be, as seen from itself."""
        belief = self.s.position[0, self.index(name)]
        return np.asarray(belief[self.index(what)] - belief[self.index(name)])


def _places(drawing: str, left: float, bottom: float) -> dict[str, tuple[float, float]]:
    rows = [row.split() for row in drawing.strip().splitlines()]
    return {
        name: (left + x, bottom + y)
        for y, row in enumerate(reversed(rows))
        for x, name in enumerate(row)
        if name != "."
    }
