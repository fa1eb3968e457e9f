"""Physics, perception and skill constants of the world: frozen data with units and sources.

Sources: "S" is the RoboCup soccer server 19.0.0, "P" the UT Austin keepaway player framework 0.6
on UvA Trilearn's base code. Two named profiles: `2005`, the server of the papers (default), and
`v19`, today's server.
"""

from __future__ import annotations

from typing import Any

import attrs

from keepaway_sim.errors import KeepawayError, SettingError
from keepaway_sim.settings import build, changed, group, setting
from keepaway_sim.task import MAX_FIELD_SIDE

CYCLE_TIME = 0.1  # [s] S: simulator_step
ROLL_CYCLES = 128  # entries of the two tables of rolling distances
SIGHT_NEAREST, SIGHT_FARTHEST = 0.01, 200.0  # [m] range of the tables of seen distances
SIGHT_CELLS = 32.0  # [1/m] their fineness
SIGHT_STEP = 0.1  # [m] S: reported distances are rounded to it
FINEST_DIRECTION = 0.01  # [deg] finest rounding of seen directions
NEVER = 65535  # [cycles] age of what was never seen; also "cannot reach the ball"


@attrs.frozen
class Physics:
    """Movement, kicks and collisions (S: serverparam.cpp; 2005 values where they differ)."""

    player_size: float = setting(0.3, "radius of a player", "m", "(0, 5]")
    player_decay: float = setting(0.4, "share of the velocity kept", "1/cycle", "(0, 1)")
    player_rand: float = setting(0.1, "movement and turn noise, share of speed", "1", "[0, 1]")
    player_accel_max: float = setting(
        1.0, "largest acceleration of a player", "m/cycle^2", "[0, 10]"
    )
    player_speed_max: float = setting(1.2, "largest speed of a player", "m/cycle", "(0, 10]")
    dash_power_rate: float = setting(
        0.006, "acceleration of a dash", "m/cycle^2 per unit of power", "(0, 1]"
    )
    min_dash_power: float = setting(
        -100.0, "of a dash; 0 forbids backward ones (S since 17.0.0)", "power", "[-100, 100]"
    )
    inertia_moment: float = setting(5.0, "how much speed hinders a turn", "cycle/m", "[0, 100]")
    ball_size: float = setting(0.085, "radius of the ball", "m", "(0, 5]")
    ball_decay: float = setting(0.94, "share of the velocity kept", "1/cycle", "(0, 1)")
    ball_rand: float = setting(0.05, "movement noise, share of speed", "1", "[0, 1]")
    ball_accel_max: float = setting(2.7, "largest acceleration by a kick", "m/cycle^2", "[0, 10]")
    ball_speed_max: float = setting(2.7, "largest speed of the ball", "m/cycle", "(0, 10]")
    kick_power_rate: float = setting(
        0.027, "acceleration of a kick", "m/cycle^2 per unit of power", "(0, 1]"
    )
    kickable_margin: float = setting(
        0.7, "beyond both radii: how near a ball can be kicked", "m", "(0, 10]"
    )
    kick_rand: float = setting(
        0.0, "kick noise at full power (S since 12.0: 0.1)", "m/cycle", "[0, 10]"
    )
    movement_noise: bool = setting(True, "switch for player_rand and ball_rand on velocities")
    turn_noise: bool = setting(True, "switch for player_rand on turns")


@attrs.frozen
class Vision:
    """What a player sees, feels, hears and remembers (S: visualsenderplayer, P: world model)."""

    visible_angle_deg: float = setting(
        360.0,
        "width of the view cone; 90 is limited vision",
        "deg",
        "(0, 360]",
        was=("visible_angle",),
    )
    quantize_step: float = setting(
        0.1, "log-distance step of players and ball; 0 is exact", "1", "[0, 10]"
    )
    direction_step_deg: float = setting(
        1.0,
        "seen directions are rounded to it; 0 is exact",
        "deg",
        "[0, 180]",
        was=("direction_step",),
    )
    change_step: float = setting(
        0.02, "step of distance change over distance; 0 is exact", "1", "[0, 1]"
    )
    speed_step: float = setting(
        0.01, "own felt speed is rounded to it; 0 is exact", "m/cycle", "[0, 10]"
    )
    self_position_error: float = setting(
        0.035, "largest error of own position after a look", "m", "[0, 100]"
    )
    self_yaw_error_deg: float = setting(
        0.3,
        "largest error of own direction after a look",
        "deg",
        "[0, 180]",
        was=("self_yaw_error",),
    )
    feel_distance: float = setting(
        3.0, "S: visible_distance; nearer objects are felt all round", "m", "[0, 1000]"
    )
    certain_distance: float = setting(
        20.0, "nearer players' velocity and body direction are surely seen", "m", "[0, 1000]"
    )
    unsure_distance: float = setting(
        40.0, "those of players farther off are never seen; linear in between", "m", "[0, 1000]"
    )
    look_period: int = setting(
        3, "one cycle in N brings no look (150 ms to 100 ms); 1: all do", "cycles", "[1, 1000]"
    )
    hearing: bool = setting(True, "team-mates' messages about the ball and themselves")
    hear_step_x: float = setting(
        1.45, "P: resolution of x in messages, 106 m in 73 steps", "m", "[0, 100]"
    )
    hear_step_y: float = setting(0.93, "P: of y, 68 m in 73 steps", "m", "[0, 100]")
    hear_step_velocity: float = setting(
        0.074, "P: of velocities, 5.4 m/cycle in 73 steps", "m/cycle", "[0, 10]"
    )

    def __attrs_post_init__(self) -> None:
        if 0.0 < self.direction_step_deg < FINEST_DIRECTION:
            raise SettingError(
                f"direction_step_deg={self.direction_step_deg}: give 0 (exact), or"
                f" {FINEST_DIRECTION} degrees or more"
            )


@attrs.frozen
class Skills:
    """Constants of the reference players' skills (P: PlayerSettings.cc, BasicPlayer.cc)."""

    pass_end_speed: float = setting(1.2, "a pass arrives at it", "m/cycle", "(0, 10]")
    hold_distance: float = setting(
        0.7, "of the margin: where a keeper holds the ball", "1", "[0, 1]"
    )
    taker_hold_distance: float = setting(
        0.3, "of the margin: where a taker holds it", "1", "[0, 1]"
    )
    setup_distance: float = setting(0.16, "of the margin: where a kick is set up", "1", "[0, 1]")
    when_to_turn_deg: float = setting(
        7.0, "moving players turn when further off", "deg", "[0, 180]", was=("when_to_turn",)
    )
    when_to_kick: float = setting(0.85, "of the best kick: still kick", "1", "[0, 1]")
    back_dash_distance: float = setting(
        2.5, "nearer points behind are reached backwards", "m", "[0, 100]"
    )
    cone_width: float = setting(0.3, "half width over length of a pass lane", "1", "[0, 10]")
    open_border: float = setting(
        0.15, "share of the field's sides not used for getting open", "1", "[0, 0.5)"
    )
    open_buffer: float = setting(1.5, "nearer to the open point is near enough", "m", "[0, 100]")
    mark_distance: float = setting(4.0, "from the marked keeper toward the ball", "m", "[0, 100]")
    mark_turn_angle_deg: float = setting(
        25.0,
        "a taker who marks turns when further off",
        "deg",
        "[0, 180]",
        was=("mark_turn_angle",),
    )
    mark_back_distance: float = setting(
        3.0, "a marking taker reaches nearer points behind it backwards", "m", "[0, 100]"
    )
    search_turn_deg: float = setting(
        60.0, "body turn of a player who lost the ball", "deg", "[0, 180]", was=("search_turn",)
    )
    ball_lost_age: int = setting(
        10, "ball unseen for longer: search (confidence 0.90)", "cycles", "[0, 1000]"
    )
    player_lost_age: int = setting(
        12, "player unseen for longer: unknown (confidence 0.88)", "cycles", "[0, 1000]"
    )
    intercept_horizon: int = setting(
        30,
        "how far ahead the ball's path is searched for a meeting point",
        "cycles",
        f"[1, {ROLL_CYCLES // 2}]",
    )
    patience: int = setting(
        20, "of dashing backward in vain (v19 forbids it), then turn", "cycles", "[0, 1000]"
    )
    pass_by_rank: bool = setting(
        True, "P: a pass in two kicks goes to the then k-th closest keeper"
    )
    whole_commands: bool = setting(True, "powers and angles of commands are cut to whole numbers")


@attrs.frozen
class Config:
    """Everything about a world but its task; one field of data, written into every result."""

    profile: str = setting(
        "2005", "of the world's constants: the papers' server, or today's", choices=("2005", "v19")
    )
    physics: Physics = group(Physics)
    vision: Vision = group(Vision)
    skills: Skills = group(Skills)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for a result's record."""
        return attrs.asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Config:
        """The inverse of `to_dict`.

        Raises:
            KeepawayError: an unknown or ill-typed entry, by name.
        """
        try:
            groups: dict[str, Any] = {
                name: build(kind, data[name]) for name, kind in _GROUPS.items()
            }
            return cls(str(data["profile"]), **groups)
        except (KeyError, TypeError, AttributeError) as error:
            raise KeepawayError(f"not a world configuration: {error!r}") from error


_GROUPS: dict[str, type] = {"physics": Physics, "vision": Vision, "skills": Skills}
_V19 = Physics(
    player_speed_max=1.05, min_dash_power=0.0, ball_speed_max=3.0, kick_rand=0.1
)  # S: serverparam.cpp defaults
PROFILES: dict[str, Physics] = {"2005": Physics(), "v19": _V19}


def profile(name: str = "2005", **changes: Any) -> Config:
    """The named configuration, with single constants changed by name.

    Args:
        name: "2005" or "v19".
        changes: fields of Physics, Vision or Skills, like `visible_angle_deg`.

    Raises:
        KeepawayError: unknown profile or field name, or a value that is refused.
    """
    if name not in PROFILES:
        raise SettingError(f"profile={name!r}: choose from {', '.join(PROFILES)}")
    return changed(Config(name, PROFILES[name]), changes)


def noiseless(config: Config) -> Config:
    """The same world with every noise source switched off (for tests and for comparison).

    What is left to chance are kick-offs, which cycles bring no look, and who is heard.
    """
    physics = attrs.evolve(config.physics, movement_noise=False, turn_noise=False, kick_rand=0.0)
    vision = attrs.evolve(
        config.vision,
        quantize_step=0.0,
        direction_step_deg=0.0,
        change_step=0.0,
        speed_step=0.0,
        self_position_error=0.0,
        self_yaw_error_deg=0.0,
        certain_distance=_EVERYWHERE,
        hear_step_x=0.0,
        hear_step_y=0.0,
        hear_step_velocity=0.0,
    )
    skills = attrs.evolve(config.skills, whole_commands=False)
    return Config(config.profile, physics, vision, skills)


_EVERYWHERE = 2.0 * MAX_FIELD_SIDE  # [m] longer than any field's diagonal
