"""Small scenes for tests of perception and skills, drawn in ASCII: a cell is a square metre.

`1` to `9` are keepers, `a` to `k` takers, `o` is the ball. The lower left cell is (0, 0) unless a
test says otherwise; x goes to the right, y up. Everybody faces +x and is at rest.
"""

import math
from typing import Any

import numpy as np

from keepaway_sim.task import Task
from keepaway_sim.world import sight
from keepaway_sim.world.bodies import Bodies
from keepaway_sim.world.config import NEVER, Config, noiseless, profile
from keepaway_sim.world.constants import pack
from keepaway_sim.world.skills import kicking, tactics
from keepaway_sim.world.skills.prediction import ball_of, body_of, reach_ball, straight_run
from keepaway_sim.world.state import Command, Fields, make_fields
from keepaway_sim.world.streams import Draws
from keepaway_sim.world.survey import survey

EXACT = noiseless(profile("2005"))  # every noise and rounding off


class Scene:
    """One field on which all players know who is drawn, and of nobody else.

    Players that are not drawn stand at (-5, -12), for whoever looks.

    Attributes:
        w: the record of its one field.
        belief, memory, speech: of `w`.
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
        task = Task(keepers, takers, field, field)
        self.num_keepers, self.ball = keepers, keepers + takers
        self.w = make_record(task, config)
        self.belief, self.memory, self.speech = self.w.belief, self.w.memory, self.w.speech
        truth = self.w.truth
        self.position, self.velocity, self.yaw = truth.position[0], truth.velocity[0], truth.yaw[0]
        self.position[:] = -5.0, -12.0
        for name, (x, y) in places.items():
            self.put(name, x, y)
            self.belief.age[0, :, self.index(name)] = 0

    @property
    def c(self) -> Any:
        """The constants."""
        return self.w.constants

    def change(self, **constants: float) -> None:
        """Play on with other constants."""
        self.w = self.w._replace(constants=self.c._replace(**constants))

    def draw(self, *uniforms: float) -> None:
        """Let these be the next random numbers."""
        self.w = self.w._replace(random=draws(*uniforms))

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
        self.belief.position[0], self.belief.velocity[0], self.belief.body[0] = (
            self.position,
            self.velocity,
            self.yaw,
        )
        self.memory.seen[0, :, :, :2] = self.position[:-1]
        self.memory.seen[0, :, :, 2:] = self.velocity[:-1]
        self.memory.seen_cycle[:] = self.memory.motion_cycle[:] = self.belief.cycle[0]
        away = np.linalg.norm(self.position[:-1] - self.position[-1], axis=1)
        self.belief.ball_kickable[0] = away < self.c.kickable_distance

    def lose(self, name: str, age: int = NEVER) -> None:
        """Let everybody have seen an object `age` cycles ago for the last time."""
        j = self.index(name)
        self.belief.age[0, :, j] = age
        self.memory.motion_cycle[0, :, j] = self.belief.cycle[0] - age
        if j < self.ball:
            self.memory.seen_cycle[0, :, j] = self.belief.cycle[0] - age

    def predict_meetings(self, name: str) -> None:
        """Let a player work out how soon each known team-mate reaches the ball."""
        p = self.index(name)
        for j in range(self.num_keepers):
            if self.belief.age[0, p, j] < NEVER:
                limit = 2 * self.c.intercept_horizon - 1
                body, ball = body_of(self.w, 0, p, j), ball_of(self.w, 0, p)
                start = straight_run(self.c, body, 0, ball, limit)
                found = reach_ball(self.c, body, 0, ball, start, limit)
                self.belief.cycles_to_ball[0, p, j] = found[1]

    def command(self, name: str, action: int, target: str = "1") -> tuple[float, float, float]:
        """A player's command: kind, power, angle [deg]."""
        p, aim = self.index(name), self.index(target)
        kind, power, angle = tactics.command(self.w, 0, p, int(action), aim)
        return kind, power, math.degrees(angle)

    def ball_after(self, name: str, command: tuple[float, float, float]) -> np.ndarray:
        """Where the ball is a cycle after a player's command (kind, power, degrees)."""
        kind, power, angle = command
        p = self.index(name)
        return np.array(kicking.ball_after(self.w, 0, p, Command(kind, power, math.radians(angle))))

    def look(self, name: str, *uniforms: float) -> None:
        """Let a player see the truth; `uniforms` are the random numbers that it takes."""
        self.draw(*uniforms)
        survey(self.w, 0)
        sight.look(self.w, 0, self.index(name))
        assert self.w.random.cursor[0] == len(uniforms)

    def seen(self, name: str, what: str) -> np.ndarray:
        """Where a player believes an object to be, as seen from itself."""
        believed = self.belief.position[0, self.index(name)]
        return np.asarray(believed[self.index(what)] - believed[self.index(name)])


def draws(*uniforms: float) -> Draws:
    """One stream of random numbers: these, and none after them."""
    return Draws(np.array([[*uniforms, *[math.nan] * 64]]), np.zeros(1, dtype=np.int64))


def make_record(task: Task, config: Config) -> Fields:
    """One field on which nothing has begun."""
    bodies = Bodies(1, np.full(task.num_players + 1, 0.3), max(task.field_length, task.field_width))
    return make_fields(pack(task, config), bodies.discs, draws())


def _places(drawing: str, left: float, bottom: float) -> dict[str, tuple[float, float]]:
    rows = [row.split() for row in drawing.strip().splitlines()]
    return {
        name: (left + x, bottom + y)
        for y, row in enumerate(reversed(rows))
        for x, name in enumerate(row)
        if name != "."
    }
