"""Physics, perception and skill constants of the world: frozen data with units and sources.

Sources: "S" is the RoboCup soccer server 19.0.0, "P" the UT Austin keepaway player framework 0.6
on UvA Trilearn's base code. Two named profiles: `2005`, the server of the papers (default), and
`v19`, today's server.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import MAX_FIELD_SIDE

CYCLE_TIME = 0.1  # [s] S: simulator_step
ROLL_CYCLES = 128  # entries of the two tables of rolling distances
SIGHT_NEAREST, SIGHT_FARTHEST = 0.01, 200.0  # [m] range of the tables of seen distances
SIGHT_CELLS = 8.0  # [1/m] their fineness
SIGHT_STEP = 0.1  # [m] S: reported distances are rounded to it
FINEST_DIRECTION = 0.01  # [deg] finest rounding of seen directions
NEVER = 65535  # [cycles] age of what was never seen; also "cannot reach the ball"


@dataclass(frozen=True)
class Physics:
    """Movement, kicks and collisions (S: serverparam.cpp; 2005 values where they differ)."""

    player_size: float = 0.3  # [m] radius
    player_decay: float = 0.4  # [1/cycle] share of the velocity kept
    player_rand: float = 0.1  # [1] movement and turn noise, share of speed
    player_accel_max: float = 1.0  # [m/cycle^2]
    player_speed_max: float = 1.2  # [m/cycle]
    dash_power_rate: float = 0.006  # [m/cycle^2 per unit of power]
    min_dash_power: float = -100.0  # [power] backward dashes; 0 forbids them (S since 17.0.0)
    inertia_moment: float = 5.0  # [cycle/m] how much speed hinders a turn
    ball_size: float = 0.085  # [m] radius
    ball_decay: float = 0.94  # [1/cycle]
    ball_rand: float = 0.05  # [1]
    ball_accel_max: float = 2.7  # [m/cycle^2]
    ball_speed_max: float = 2.7  # [m/cycle]
    kick_power_rate: float = 0.027  # [m/cycle^2 per unit of power]
    kickable_margin: float = 0.7  # [m] beyond both radii
    kick_rand: float = 0.0  # [m/cycle] kick noise at full power (S since 12.0: 0.1)
    movement_noise: bool = True  # switch for player_rand and ball_rand on velocities
    turn_noise: bool = True  # switch for player_rand on turns


@dataclass(frozen=True)
class Vision:
    """What a player sees, feels, hears and remembers (S: visualsenderplayer, P: world model)."""

    visible_angle: float = 360.0  # [deg] width of the view cone; 90 is limited vision
    quantize_step: float = 0.1  # [1] log-distance step of players and ball; 0 is exact
    direction_step: float = 1.0  # [deg] seen directions are rounded to it; 0 is exact
    change_step: float = 0.02  # [1] step of distance change over distance; 0 is exact
    speed_step: float = 0.01  # [m/cycle] own felt speed is rounded to it; 0 is exact
    self_position_error: float = 0.15  # [m] largest error of own position after a look
    self_yaw_error: float = 0.3  # [deg] largest error of own direction after a look
    feel_distance: float = 3.0  # [m] S: visible_distance, felt all round
    certain_distance: float = 20.0  # [m] velocity and body direction are surely seen below
    unsure_distance: float = 40.0  # [m] and never beyond; linear in between
    look_period: int = 3  # [cycles] one of so many brings no look (150 ms to 100 ms); 1: all do
    hearing: bool = True  # team-mates' messages about the ball and themselves
    hear_distance: float = 50.0  # [m] S: audio_cut_dist
    hear_step_x: float = 1.45  # [m] P: say-message resolution, 106 m in 73 steps
    hear_step_y: float = 0.93  # [m] P: 68 m in 73 steps
    hear_step_velocity: float = 0.074  # [m/cycle] P: 5.4 m/cycle in 73 steps


@dataclass(frozen=True)
class Skills:
    """Constants of the reference players' skills (P: PlayerSettings.cc, BasicPlayer.cc)."""

    pass_end_speed: float = 1.2  # [m/cycle] a pass arrives at it
    hold_distance: float = 0.7  # [1] of the margin: where a keeper holds the ball
    taker_hold_distance: float = 0.3  # [1] of the margin: where a taker holds it
    setup_distance: float = 0.16  # [1] of the margin: where a kick is set up
    when_to_turn: float = 7.0  # [deg] moving players turn when further off
    when_to_kick: float = 0.85  # [1] of the best kick: still kick
    back_dash_distance: float = 2.5  # [m] nearer points behind are reached backwards
    cone_width: float = 0.3  # [1] half width over length of a pass lane
    open_border: float = 0.15  # [1] share of the field's sides not used for getting open
    open_buffer: float = 1.5  # [m] near enough to the open point
    mark_distance: float = 4.0  # [m] from the marked keeper toward the ball
    mark_turn_angle: float = 25.0  # [deg]
    mark_back_distance: float = 3.0  # [m]
    search_turn: float = 60.0  # [deg] body turn of a player who lost the ball
    ball_lost_age: int = 10  # [cycles] ball unseen for longer: search (confidence 0.90)
    player_lost_age: int = 12  # [cycles] player unseen for longer: unknown (confidence 0.88)
    intercept_horizon: int = 30  # [cycles]
    patience: int = 20  # [cycles] of dashing backward in vain (v19 forbids it), then turn
    pass_by_rank: bool = True  # P: a pass in two kicks goes to the then k-th closest keeper
    whole_commands: bool = True  # powers and angles of commands are cut to whole numbers


@dataclass(frozen=True)
class Config:
    """Everything about a world but its task; one field of data, written into every result."""

    profile: str = "2005"
    physics: Physics = field(default_factory=Physics)
    vision: Vision = field(default_factory=Vision)
    skills: Skills = field(default_factory=Skills)

    def __post_init__(self) -> None:
        for group in (self.physics, self.vision, self.skills):
            _check_numbers(group)
        if not 0.0 < self.vision.visible_angle <= 360.0:
            raise KeepawayError(
                f"visible_angle={self.vision.visible_angle}: give 0 < degrees <= 360"
            )
        for name in ("player_decay", "ball_decay"):
            decay = getattr(self.physics, name)
            if not 0.0 < decay < 1.0:
                raise KeepawayError(f"{name}={decay}: give a share between 0 and 1")
        if 0.0 < self.vision.direction_step < FINEST_DIRECTION:
            raise KeepawayError(
                f"direction_step={self.vision.direction_step}: give 0 (exact), or"
                f" {FINEST_DIRECTION} degrees or more"
            )
        if not self.vision.look_period >= 1:
            raise KeepawayError(f"look_period={self.vision.look_period}: give 1 or more cycles")
        if not 1 <= self.skills.intercept_horizon <= ROLL_CYCLES // 2:
            raise KeepawayError(
                f"intercept_horizon={self.skills.intercept_horizon}:"
                f" give 1 to {ROLL_CYCLES // 2} cycles"
            )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for a result's record."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Config:
        """The inverse of `to_dict`.

        Raises:
            KeepawayError: an unknown or ill-typed entry, by name.
        """
        try:
            return cls(
                profile=str(data["profile"]),
                physics=Physics(**data["physics"]),
                vision=Vision(**data["vision"]),
                skills=Skills(**data["skills"]),
            )
        except (KeyError, TypeError) as error:
            raise KeepawayError(f"not a world configuration: {error}") from error


_V19 = Physics(
    player_speed_max=1.05, min_dash_power=0.0, ball_speed_max=3.0, kick_rand=0.1
)  # S: serverparam.cpp defaults
PROFILES: dict[str, Physics] = {"2005": Physics(), "v19": _V19}


def profile(name: str = "2005", *, visible_angle: float = 360.0, **changes: Any) -> Config:
    """The named configuration, with single constants changed by name.

    Args:
        name: "2005" or "v19".
        visible_angle: width of the view cone [deg].
        changes: fields of Physics, Vision or Skills.

    Raises:
        KeepawayError: unknown profile or field name.
    """
    if name not in PROFILES:
        raise KeepawayError(f"profile={name!r}: choose from {', '.join(PROFILES)}")
    config = Config(name, PROFILES[name], Vision(visible_angle=visible_angle), Skills())
    return changed(config, changes)


def changed(config: Config, changes: Mapping[str, Any]) -> Config:
    """A configuration with single constants of physics, vision or skills changed by name.

    Raises:
        KeepawayError: an unknown name or a value that makes no sense.
    """
    groups: dict[str, Any] = {}
    for key, value in changes.items():
        owner = next((g for g in _GROUP_NAMES if hasattr(getattr(config, g), key)), None)
        if owner is None:
            raise KeepawayError(f"{key!r} is no constant of physics, vision or skills")
        group = groups.get(owner, getattr(config, owner))
        groups[owner] = dataclasses.replace(group, **{key: value})
    return dataclasses.replace(config, **groups)


_GROUP_NAMES = ("physics", "vision", "skills")


def noiseless(config: Config) -> Config:
    """The same world with every noise source switched off (for tests and for comparison).

    What is left to chance are kick-offs, which cycles bring no look, and who is heard.
    """
    physics = dataclasses.replace(
        config.physics, movement_noise=False, turn_noise=False, kick_rand=0.0
    )
    vision = dataclasses.replace(
        config.vision,
        quantize_step=0.0,
        direction_step=0.0,
        change_step=0.0,
        speed_step=0.0,
        self_position_error=0.0,
        self_yaw_error=0.0,
        certain_distance=_EVERYWHERE,
        hear_step_x=0.0,
        hear_step_y=0.0,
        hear_step_velocity=0.0,
    )
    skills = dataclasses.replace(config.skills, whole_commands=False)
    return Config(config.profile, physics, vision, skills)


_EVERYWHERE = 2.0 * MAX_FIELD_SIDE  # [m] longer than any field's diagonal
_DIVISORS = (
    "player_speed_max",
    "dash_power_rate",
    "ball_speed_max",
    "kick_power_rate",
    "kickable_margin",
    "pass_end_speed",
)


def _check_numbers(group: object) -> None:
    for entry in dataclasses.fields(group):  # type: ignore[arg-type]
        value = getattr(group, entry.name)
        if not isinstance(value, (bool, int, float)) or not math.isfinite(value):
            raise KeepawayError(f"{entry.name}={value!r}: give a finite number")
        if value < 0 and entry.name != "min_dash_power":
            raise KeepawayError(f"{entry.name}={value!r}: give a number that is not negative")
        if value == 0 and entry.name in _DIVISORS:
            raise KeepawayError(f"{entry.name}={value!r}: give a number above 0")
        if isinstance(entry.default, int) and value != int(value):
            raise KeepawayError(f"{entry.name}={value!r}: give a whole number")
