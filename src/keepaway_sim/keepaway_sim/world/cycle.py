"""One cycle of every field: requests, commands, movement, referee, perception."""

from __future__ import annotations

import math

from keepaway_sim.task import Action, Outcome
from keepaway_sim.world import physics, referee, sight
from keepaway_sim.world.compiled import compiled, compiled_apart
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import TWO_PI, length
from keepaway_sim.world.hearing import hear, speak
from keepaway_sim.world.memory import feel_self, forget, remember
from keepaway_sim.world.skills import tactics
from keepaway_sim.world.skills.prediction import LATELY, UNKNOWN_SPEED, cycles_to_ball
from keepaway_sim.world.skills.running import expected_turn
from keepaway_sim.world.state import DASH, KICK, TURN
from keepaway_sim.world.streams import draw

_HOLD = int(Action.HOLD_BALL)
_PASS = int(Action.PASS_BALL)
_OPEN = int(Action.GET_OPEN)
_GO = int(Action.GO_TO_BALL)
_MARK = int(Action.MARK_KEEPER)
_IN_PLAY = int(Outcome.IN_PLAY)


@compiled
def is_legal(c, player, action, target):
    """Can this player carry out this request?"""
    if player >= c.num_keepers:
        return action == _GO or (action == _MARK and 0 <= target < c.num_keepers)
    if action == _PASS:
        return 0 <= target < c.num_keepers and target != player
    return action in (_HOLD, _OPEN, _GO)


@compiled
def _first_illegal(c, state, s, action, target):
    num = c.num_keepers + c.num_takers
    for f in range(len(state.running)):
        for p in range(num):
            if s.decision_due[f, p] and not is_legal(c, p, action[f, p], target[f, p]):
                return f * num + p
    return -1


@compiled_apart
def start(c, state, s, m, speech, uniforms, cursor, f):
    """First kick-off of a trial: nothing of an earlier one remains."""
    for p in range(c.num_keepers + c.num_takers):
        state.yaw[f, p] = TWO_PI * (draw(uniforms, cursor, f) - 0.5)
        s.body[f, p, :] = state.yaw[f, p]
        s.neck[f, p] = 0.0
        s.position[f, p, :, :] = 0.0
    m.self_error[f, :, :] = 0.0
    state.time[f] = 0
    state.running[f] = True
    s.episode[f] = -1
    _kick_off(c, state, s, m, speech, uniforms, cursor, f)


@compiled
def _kick_off(c, state, s, m, speech, uniforms, cursor, f):
    referee.kick_off(c, state.position[f], state.velocity[f], uniforms, cursor, f)
    state.take_count[f] = 0
    state.last_keeper[f] = -1
    s.outcome[f] = _IN_PLAY
    s.episode[f] += 1
    s.cycle[f] = 0
    for p in range(c.num_keepers + c.num_takers):
        state.action[f, p] = _OPEN if p < c.num_keepers else _GO
        state.target[f, p] = 0
        forget(c, s, m, f, p, uniforms, cursor)
        speech.ball_age[f, p] = -1
        speech.opponent[f, p] = -1
        speech.own_said[f, p] = False
    _perceive(c, state, s, m, speech, uniforms, cursor, f)


@compiled_apart
def act(c, state, s, m, speech, motion, place, acceleration, uniforms, cursor, action, target):
    """Requests become commands, commands become this cycle's velocities.

    Returns:
        The first request (counted over all players) that is illegal, if any: then nothing was
        done; else -1.
    """
    illegal = _first_illegal(c, state, s, action, target)
    if illegal >= 0:
        return illegal
    num = c.num_keepers + c.num_takers
    for f in range(len(state.running)):
        if not state.running[f] or s.outcome[f] != _IN_PLAY:
            motion[f, :, 2:] = 0.0
            continue
        acceleration[:] = 0.0
        for p in range(num):
            _take_request(c, state, s, m, f, p, action[f, p], target[f, p])
            _carry_out(c, state, s, m, speech, acceleration, f, p, uniforms, cursor)
        for o in range(num + 1):
            vx, vy = _velocity(c, state, acceleration, f, o, uniforms, cursor)
            state.velocity[f, o, 0], state.velocity[f, o, 1] = vx, vy
            motion[f, o, 0] = state.position[f, o, 0] + place[f, 0]
            motion[f, o, 1] = state.position[f, o, 1] + place[f, 1]
            motion[f, o, 2], motion[f, o, 3] = vx, vy
    return -1


@compiled
def _take_request(c, state, s, m, f, p, action, target):
    if s.decision_due[f, p]:
        state.action[f, p], state.target[f, p] = action, target
        if action == _PASS and s.ball_kickable[f, p]:
            m.pass_cycle[f, p] = s.cycle[f]
            m.pass_rank[f, p] = tactics.rank_of(c, s, f, p, target)
    elif c.pass_by_rank and state.action[f, p] == _PASS:
        state.target[f, p] = tactics.keeper_of_rank(c, s, f, p, m.pass_rank[f, p])


@compiled
def _carry_out(c, state, s, m, speech, acceleration, f, p, uniforms, cursor):
    """Player p's command: what p expects of it, says of it, and what the server does with it."""
    kind, power, angle = tactics.command(c, s, m, f, p, state.action[f, p], state.target[f, p])
    m.command[f, p, 0], m.command[f, p, 1], m.command[f, p, 2] = kind, power, angle
    m.turned[f, p] = expected_turn(c, s, f, p, kind, angle)
    m.kicked[f, p] = False
    if c.hearing:
        speak(c, s, speech, m, f, p, kind == KICK)
    yaw = state.yaw[f, p]
    if kind == DASH:
        ax, ay = physics.dash_acceleration(c, power, yaw)
        acceleration[p, 0] += ax
        acceleration[p, 1] += ay
    elif kind == TURN:
        noise = 2.0 * draw(uniforms, cursor, f) - 1.0 if c.turn_noise else 0.0
        speed = length(state.velocity[f, p, 0], state.velocity[f, p, 1])
        state.yaw[f, p] = physics.turned_yaw(c, yaw, angle, speed, noise)
    elif kind == KICK:
        _kick(c, state, m, acceleration, f, p, power, angle, uniforms, cursor)


@compiled
def _kick(c, state, m, acceleration, f, p, power, angle, uniforms, cursor):
    ball = c.num_keepers + c.num_takers
    rel_x = state.position[f, ball, 0] - state.position[f, p, 0]
    rel_y = state.position[f, ball, 1] - state.position[f, p, 1]
    if length(rel_x, rel_y) > c.kickable_distance:
        return
    m.kicked[f, p] = True
    yaw = state.yaw[f, p]
    ax, ay = physics.kick_acceleration(c, power, angle, rel_x, rel_y, yaw)
    acceleration[ball, 0] += ax
    acceleration[ball, 1] += ay
    if c.kick_rand > 0.0:
        speed = length(state.velocity[f, ball, 0], state.velocity[f, ball, 1])
        largest = physics.kick_noise_radius(c, power, rel_x, rel_y, yaw, speed)
        radius = largest * draw(uniforms, cursor, f)
        direction = TWO_PI * draw(uniforms, cursor, f)
        acceleration[ball, 0] += radius * math.cos(direction)
        acceleration[ball, 1] += radius * math.sin(direction)


@compiled
def _velocity(c, state, acceleration, f, o, uniforms, cursor):
    vx, vy = state.velocity[f, o]
    ax, ay = acceleration[o]
    if o == c.num_keepers + c.num_takers:
        rand = c.ball_rand if c.movement_noise else 0.0
        return physics.moved_velocity(
            vx, vy, ax, ay, c.ball_accel_max, c.ball_speed_max, rand, uniforms, cursor, f
        )
    rand = c.player_rand if c.movement_noise else 0.0
    return physics.moved_velocity(
        vx, vy, ax, ay, c.player_accel_max, c.player_speed_max, rand, uniforms, cursor, f
    )


@compiled_apart
def settle(c, state, s, m, speech, motion, place, radius, touched, scratch, uniforms, cursor):
    """After the discs moved: collisions, referee, and what the players perceive of it."""
    num = c.num_keepers + c.num_takers
    for f in range(len(state.running)):
        if not state.running[f]:
            continue
        state.time[f] += 1
        if s.outcome[f] != _IN_PLAY:
            _kick_off(c, state, s, m, speech, uniforms, cursor, f)
            continue
        for o in range(num + 1):
            decay = c.ball_decay if o == num else c.player_decay
            for axis in range(2):
                state.position[f, o, axis] = motion[f, o, axis] - place[f, axis]
                state.velocity[f, o, axis] = physics.on_grid(decay * state.velocity[f, o, axis])
        if touched[f]:
            physics.separate(state.position[f], state.velocity[f], radius, *scratch)
        s.cycle[f] += 1
        keeper = referee.near_ball(c, state.position[f], 0, c.num_keepers)
        taker = referee.near_ball(c, state.position[f], c.num_keepers, num)
        if keeper >= 0:
            state.last_keeper[f] = keeper
        count = state.take_count[f]
        s.outcome[f] = referee.outcome(c, state.position[f], count)
        if s.outcome[f] == _IN_PLAY:
            state.take_count[f] = referee.next_take_count(count, keeper >= 0, taker >= 0)
        _perceive(c, state, s, m, speech, uniforms, cursor, f)


@compiled
def _perceive(c, state, s, m, speech, uniforms, cursor, f):
    position, velocity, yaw = state.position[f], state.velocity[f], state.yaw[f]
    for p in range(c.num_keepers + c.num_takers):
        if s.cycle[f] > 0:
            remember(c, s, m, f, p)
        feel_self(c, s, m, position, velocity, f, p)
        if c.hearing:
            hear(c, s, speech, f, p, uniforms, cursor)
        if sight.looks_now(c, m, f, p, state.time[f]):
            sight.look(c, s, m, position, velocity, yaw, f, p, uniforms, cursor)
        _judge(c, s, m, f, p)


@compiled
def _judge(c, s, m, f, p):
    """What follows from player p's belief: can it kick, who is nearest, must it decide?"""
    num = c.num_keepers + c.num_takers
    ball = s.position[f, p, num]
    known = s.age[f, p, num] <= c.ball_lost_age
    own = s.position[f, p, p]
    near = length(ball[0] - own[0], ball[1] - own[1]) < c.kickable_distance
    s.ball_kickable[f, p] = known and near
    s.cycles_to_ball[f, p, :] = NEVER
    if s.ball_kickable[f, p]:
        s.cycles_to_ball[f, p, p] = 0
    elif known and p < c.num_keepers:
        _find_fastest_keeper(c, s, m, f, p)
    passing = m.pass_cycle[f, p] == s.cycle[f] - 1 and s.ball_kickable[f, p]
    s.decision_due[f, p] = s.outcome[f] == _IN_PLAY and not passing


@compiled
def _find_fastest_keeper(c, s, m, f, p):
    """Which keeper reaches the ball first, as player p believes, and when (equal ones all count).

    Begins with the keeper nearest to the ball, so that most others are soon seen to be slower.
    """
    ball = c.num_keepers + c.num_takers
    nearest = tactics.nearest_to_ball(c, s, f, p, 0, c.num_keepers)
    fastest = 2 * c.intercept_horizon - 1
    for k in range(c.num_keepers):
        j = (nearest + k) % c.num_keepers
        if j != p and s.age[f, p, j] > c.player_lost_age:
            continue
        x, y = s.position[f, p, j]
        vx, vy = s.velocity[f, p, j]
        ux, uy = math.cos(s.body[f, p, j]), math.sin(s.body[f, p, j])
        if j != p and s.cycle[f] - m.motion_cycle[f, p, j] > LATELY:
            vx, vy, ux, uy = UNKNOWN_SPEED, 0.0, 0.0, 0.0
        place, motion = s.position[f, p, ball], s.velocity[f, p, ball]
        cycles = cycles_to_ball(c, x, y, vx, vy, ux, uy, place, motion, fastest)
        if cycles < fastest:
            fastest = cycles
            s.cycles_to_ball[f, p, :] = NEVER
        s.cycles_to_ball[f, p, j] = cycles
