"""What players say to their team, and what they make of what they hear.

Players also say where they themselves are about to be, but none learns of it: P decodes a message
as if the listener had said it (WorldModelUpdate.cc: processPlayerMessage gives the decoder the own
number), and where it is itself a player knows better (processPerfectHearInfo). So it is left out.
"""

from __future__ import annotations

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import length
from keepaway_sim.world.memory import same_team
from keepaway_sim.world.skills.kicking import ball_after
from keepaway_sim.world.skills.running import place_after
from keepaway_sim.world.state import KICK
from keepaway_sim.world.streams import draw

STALE_BALL = 3  # [cycles] a message about the ball helps a player who saw it longer ago
CHANGED_VELOCITY = 0.3  # [m/cycle] or one whose idea of its velocity differs by more
DEAF_RANGE = 3.0  # [m] P: nearer to the ball than this, a player trusts itself
TOLD_AGE = 2  # [cycles] P: age of the news of an opponent
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
    told = speech.opponent[f, speaker]
    if told >= 0:
        x, y = speech.opponent_position[f, speaker]
        _hear_of_opponent(w, f, p, told, x, y)
    if speech.ball_age[f, speaker] >= 0:
        _hear_of_ball(w, f, p, speaker)


@compiled
def _hear_of_opponent(w, f, p, who, x, y):
    """P processPerfectHearInfo: counts as seen two cycles ago, where nothing newer is known."""
    belief, memory = w.belief, w.memory
    if belief.age[f, p, who] > TOLD_AGE or memory.nameless[f, p, who]:
        belief.position[f, p, who, 0], belief.position[f, p, who, 1] = x, y
        belief.velocity[f, p, who, 0] = 0.0
        belief.velocity[f, p, who, 1] = 0.0
        belief.age[f, p, who] = TOLD_AGE
        memory.nameless[f, p, who] = False
        memory.behind[f, p, who] = TOLD_AGE


@compiled
def _hear_of_ball(w, f, p, speaker):
    """P WMBallInfo: helps who is not near the ball and has not seen it move for a while.

    Or who has just not seen it, and had another idea of how it moves.
    """
    belief, ball = w.belief, w.ball
    place, motion = belief.position[f, p, ball], belief.velocity[f, p, ball]
    said = w.speech.ball_age[f, speaker]
    x, y, vx, vy = w.speech.ball[f, speaker]
    if said > 0:
        x, y = x + vx, y + vy
        vx, vy = w.constants.ball_decay * vx, w.constants.ball_decay * vy
    differs = length(vx - motion[0], vy - motion[1]) > CHANGED_VELOCITY
    if belief.age[f, p, ball] < NEVER:
        own = belief.position[f, p, p]
        unseen = belief.cycle[f] - w.memory.motion_cycle[f, p, ball]
        is_news = unseen > STALE_BALL or (unseen > said and differs)
        if not is_news or length(place[0] - own[0], place[1] - own[1]) <= DEAF_RANGE:
            return
    if belief.age[f, p, ball] > said + 1 or differs:
        place[0], place[1] = x, y
        motion[0], motion[1] = vx, vy
        belief.age[f, p, ball] = said + 1


@compiled
def speak(w, f, p, command):
    """Compose what player p tells its team-mates after it chose its Command.

    A message holds ten characters (S): six for the ball and four for an opponent (P:
    makeSayMessage).
    """
    belief, speech = w.belief, w.speech
    _speak_of_ball(w, f, p, command)
    nearest = _opponent_in_touch(w, f, p)
    speech.opponent[f, p] = nearest
    if nearest >= 0:
        x, y = belief.position[f, p, nearest]
        x, y = spelled(w.constants, p, x, y)
        speech.opponent_position[f, p, 0], speech.opponent_position[f, p, 1] = x, y


@compiled
def _opponent_in_touch(w, f, p):
    """The nearest opponent that player p sees within touch; -1: none."""
    c, belief = w.constants, w.belief
    own = belief.position[f, p, p]
    nearest, best = -1, c.feel_distance
    for j in range(w.num_players):
        if same_team(c, p, j) or belief.age[f, p, j] != 0:
            continue
        away = length(belief.position[f, p, j, 0] - own[0], belief.position[f, p, j, 1] - own[1])
        if away < best:
            nearest, best = j, away
    return nearest


@compiled
def _speak_of_ball(w, f, p, command):
    """Tell of a ball that is seen, or that is about to leave player p's reach.

    Where the player kicks it away, it tells where that ball will be; a ball that stays in reach
    is reported as lying still.
    """
    c, belief, speech, ball = w.constants, w.belief, w.speech, w.ball
    own, place = belief.position[f, p, p], belief.position[f, p, ball]
    distance = length(place[0] - own[0], place[1] - own[1])
    in_reach = distance < c.kickable_distance
    x, y, vx, vy = ball_after_command(w, f, p, command)
    next_x, next_y = place_after(w, f, p, command)
    away = length(x - next_x, y - next_y)
    seen = belief.age[f, p, ball] == 0 and distance < SHARED_RANGE
    speech.ball_age[f, p] = -1
    if not seen and not (in_reach and away > c.kickable_distance):
        return
    speech.ball_age[f, p] = 1
    if in_reach and command.kind == KICK and away > c.kickable_distance + 0.2:
        speech.ball_age[f, p] = 0
    elif in_reach:
        x, y, vx, vy = place[0], place[1], 0.0, 0.0
    else:
        x, y = place
        vx, vy = belief.velocity[f, p, ball]
    speech.ball[f, p, 0], speech.ball[f, p, 1] = spelled(c, p, x, y)
    speech.ball[f, p, 2] = cut(vx, c.hear_step_velocity, p < c.num_keepers)
    speech.ball[f, p, 3] = cut(vy, c.hear_step_velocity, p >= c.num_keepers)


@compiled
def ball_after_command(w, f, p, command):
    """Place and velocity that player p expects of the ball a cycle later."""
    x, y = ball_after(w, f, p, command)
    decay, place = w.constants.ball_decay, w.belief.position[f, p, w.ball]
    return x, y, decay * (x - place[0]), decay * (y - place[1])


@compiled
def spelled(c, p, x, y):
    """A position as a message can spell it, in the axes of player p's team: y to the right."""
    keeps = p < c.num_keepers
    return cut(x, c.hear_step_x, keeps), cut(y, c.hear_step_y, not keeps)


@compiled
def cut(value, step, ahead):
    """A number as one of 73 characters spells it: cut to the lower end of its step.

    P SayMsgDataTypes.h: the steps lie evenly around 0, so reports are half a step too low in
    the mean, in the team's axes (`ahead`: they point like the field's).
    """
    if step == 0.0:
        return value
    sign = 1.0 if ahead else -1.0
    return sign * (round(sign * value / step) - 0.5) * step
