"""What players say to their team, and what they make of what they hear."""

from __future__ import annotations

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import length, quantize
from keepaway_sim.world.memory import same_team
from keepaway_sim.world.physics import kick_acceleration, limited
from keepaway_sim.world.streams import draw

STALE_BALL = 3  # [cycles] a message about the ball helps a player who saw it longer ago
CHANGED_VELOCITY = 0.3  # [m/cycle] or one whose idea of its velocity differs by more
DEAF_RANGE = 3.0  # [m] P: nearer to the ball than this, a player trusts itself
SHARED_RANGE = 20.0  # [m] P: a player speaks of a ball it sees nearer than this


@compiled
def hear(w, f, p):
    """Take the one message that player p hears this cycle: a random team-mate's."""
    c, speech = w.constants, w.speech
    first = 0 if p < c.num_keepers else c.num_keepers
    last = c.num_keepers if p < c.num_keepers else w.num_players
    others = last - first - 1
    if others < 1:
        return
    speaker = first + int(draw(w.random, f) * others)
    if speaker >= p:
        speaker += 1
    if speech.own_said[f, speaker]:
        _hear_of_player(w, f, p, speaker, speech.own[f, speaker, 0], speech.own[f, speaker, 1])
    told = speech.opponent[f, speaker]
    if told >= 0:
        x, y = speech.opponent_position[f, speaker]
        _hear_of_player(w, f, p, told, x, y)
    if speech.ball_age[f, speaker] >= 0:
        _hear_of_ball(w, f, p, speaker)


@compiled
def _hear_of_player(w, f, p, who, x, y):
    belief = w.belief
    if belief.age[f, p, who] > 1:
        belief.position[f, p, who, 0], belief.position[f, p, who, 1] = x, y
        belief.velocity[f, p, who, 0] = 0.0
        belief.velocity[f, p, who, 1] = 0.0
        belief.age[f, p, who] = 1


@compiled
def _hear_of_ball(w, f, p, speaker):
    belief, speech = w.belief, w.speech
    ball = w.ball
    x, y, vx, vy = speech.ball[f, speaker]
    own = belief.position[f, p, p]
    known = belief.age[f, p, ball] < NEVER
    if (
        known
        and length(belief.position[f, p, ball, 0] - own[0], belief.position[f, p, ball, 1] - own[1])
        < DEAF_RANGE
    ):
        return
    differs = (
        length(vx - belief.velocity[f, p, ball, 0], vy - belief.velocity[f, p, ball, 1])
        > CHANGED_VELOCITY
    )
    if belief.age[f, p, ball] > STALE_BALL or differs:
        belief.position[f, p, ball, 0], belief.position[f, p, ball, 1] = x, y
        belief.velocity[f, p, ball, 0], belief.velocity[f, p, ball, 1] = vx, vy
        belief.age[f, p, ball] = speech.ball_age[f, speaker]


@compiled
def speak(w, f, p, kicked):
    """Compose what player p tells its team-mates after it chose its command.

    A message holds ten characters (S): six for the ball, four for an opponent, three for the
    own position, so the own position is left out where both others are told.
    """
    c, belief, speech = w.constants, w.belief, w.speech
    num = w.num_players
    own, ball = belief.position[f, p, p], belief.position[f, p, num]
    distance = length(ball[0] - own[0], ball[1] - own[1])
    speech.ball_age[f, p] = -1
    if belief.age[f, p, num] == 0 and distance < SHARED_RANGE:
        _speak_of_ball(w, f, p, distance, kicked)
    nearest, best = -1, c.feel_distance
    for j in range(num):
        if same_team(c, p, j) or belief.age[f, p, j] != 0:
            continue
        away = length(belief.position[f, p, j, 0] - own[0], belief.position[f, p, j, 1] - own[1])
        if away < best:
            nearest, best = j, away
    speech.opponent[f, p] = nearest
    if nearest >= 0:
        x, y = belief.position[f, p, nearest]
        speech.opponent_position[f, p, 0] = quantize(x, c.hear_step_x)
        speech.opponent_position[f, p, 1] = quantize(y, c.hear_step_y)
    speech.own_said[f, p] = not (nearest >= 0 and speech.ball_age[f, p] >= 0)
    speech.own[f, p, 0] = quantize(own[0] + belief.velocity[f, p, p, 0], c.hear_step_x)
    speech.own[f, p, 1] = quantize(own[1] + belief.velocity[f, p, p, 1], c.hear_step_y)


@compiled
def _speak_of_ball(w, f, p, distance, kicked):
    c, belief, memory, speech = w.constants, w.belief, w.memory, w.speech
    ball = w.ball
    x, y = belief.position[f, p, ball]
    vx, vy = belief.velocity[f, p, ball]
    speech.ball_age[f, p] = 1
    if distance < c.kickable_distance:
        away = False
        if kicked:
            ax, ay = kick_acceleration(
                c,
                memory.command[f, p, 1],
                memory.command[f, p, 2],
                x - belief.position[f, p, p, 0],
                y - belief.position[f, p, p, 1],
                belief.body[f, p, p],
            )
            wx, wy = limited(vx + ax, vy + ay, c.ball_speed_max)
            nx = belief.position[f, p, p, 0] + belief.velocity[f, p, p, 0]
            ny = belief.position[f, p, p, 1] + belief.velocity[f, p, p, 1]
            away = length(x + wx - nx, y + wy - ny) > c.kickable_distance + 0.2
        if away:
            x, y = x + wx, y + wy
            vx, vy = wx * c.ball_decay, wy * c.ball_decay
            speech.ball_age[f, p] = 0
        else:
            vx, vy = 0.0, 0.0
    speech.ball[f, p, 0] = quantize(x, c.hear_step_x)
    speech.ball[f, p, 1] = quantize(y, c.hear_step_y)
    speech.ball[f, p, 2] = quantize(vx, c.hear_step_velocity)
    speech.ball[f, p, 3] = quantize(vy, c.hear_step_velocity)
