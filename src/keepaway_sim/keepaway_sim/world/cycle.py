"""One cycle of every field: requests, commands, movement, referee, perception."""

from __future__ import annotations

from keepaway_sim.task import Action, Outcome
from keepaway_sim.world import physics, referee, sight
from keepaway_sim.world.compiled import compiled, compiled_apart
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import TWO_PI, length
from keepaway_sim.world.hearing import hear, speak
from keepaway_sim.world.memory import feel_self, forget, remember, roll_on
from keepaway_sim.world.skills import tactics
from keepaway_sim.world.skills.fastest import fastest_keeper, nobody_asked
from keepaway_sim.world.skills.running import expected_turn
from keepaway_sim.world.state import DASH, KICK, TURN
from keepaway_sim.world.streams import draw
from keepaway_sim.world.survey import looks_now, survey
from keepaway_sim.world.trigonometry import unit

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
def _first_illegal(w, playing, action, target):
    for f in range(len(playing)):
        for p in range(w.num_players):
            due = playing[f] and w.belief.decision_due[f, p]
            if due and not is_legal(w.constants, p, action[f, p], target[f, p]):
                return f * w.num_players + p
    return -1


@compiled
def _kick_off(w, f):
    """The next episode of field f begins."""
    c, truth, belief, speech = w.constants, w.truth, w.belief, w.speech
    referee.kick_off(w, f)
    truth.take_count[f] = 0
    truth.last_keeper[f] = -1
    belief.outcome[f] = _IN_PLAY
    belief.episode[f] += 1
    belief.cycle[f] = 0
    for p in range(w.num_players):
        truth.action[f, p] = _OPEN if p < c.num_keepers else _GO
        truth.target[f, p] = 0
        forget(w, f, p)
        speech.ball_age[f, p] = -1
        speech.opponent[f, p] = -1


@compiled_apart
def act(w, playing, action, target):
    """Requests become commands, commands become this cycle's velocities.

    Args:
        w: Fields.
        playing: (num_fields,) bool, on which of the running fields time goes by.
        action, target: (num_fields, num_players) int64, requests.

    Returns:
        The first request (counted over all players) that is illegal, if any: then nothing was
        done; else -1.
    """
    illegal = _first_illegal(w, playing, action, target)
    if illegal >= 0:
        return illegal
    w.bodies.num_asked[0] = 0
    for f in range(len(playing)):
        if playing[f] and w.truth.running[f]:
            begin_cycle(w, f, action, target)
    return -1


@compiled
def begin_cycle(w, f, action, target):
    """Field f up to the point where its discs move: `bodies.slot` says whether pymunk is asked."""
    w.bodies.slot[f], w.bodies.touched[f] = -1, False
    if w.belief.outcome[f] != _IN_PLAY:
        return
    w.scratch.acceleration[:] = 0.0
    for p in range(w.num_players):
        _take_request(w, f, p, action[f, p], target[f, p])
        _carry_out(w, f, p)
    for o in range(w.ball + 1):
        _set_off(w, f, o)
    if physics.may_touch(w.truth.position[f], w.truth.velocity[f], w.bodies.radius):
        _ask_pymunk(w, f)


@compiled
def _take_request(w, f, p, action, target):
    c, truth, belief, memory = w.constants, w.truth, w.belief, w.memory
    if belief.decision_due[f, p]:
        truth.action[f, p], truth.target[f, p] = action, target
        if action == _PASS and belief.ball_kickable[f, p]:
            memory.pass_cycle[f, p] = belief.cycle[f]
            memory.pass_rank[f, p] = tactics.rank_of(w, f, p, target)
    else:  # a pass continues
        memory.pass_cycle[f, p] = belief.cycle[f]
        if c.pass_by_rank:
            truth.target[f, p] = tactics.keeper_of_rank(w, f, p, memory.pass_rank[f, p])


@compiled
def _carry_out(w, f, p):
    """Player p's command: what p expects of it, says of it, and what the server does with it."""
    c, truth, memory = w.constants, w.truth, w.memory
    command = tactics.command(w, f, p, truth.action[f, p], truth.target[f, p])
    kind, power, angle = command
    memory.command[f, p, 0], memory.command[f, p, 1], memory.command[f, p, 2] = kind, power, angle
    memory.turned[f, p] = expected_turn(w, f, p, command)
    memory.kicked[f, p] = False
    if c.hearing:
        speak(w, f, p, command)
    yaw = truth.yaw[f, p]
    if kind == DASH:
        ax, ay = physics.dash_acceleration(c, power, yaw)
        w.scratch.acceleration[p, 0] += ax
        w.scratch.acceleration[p, 1] += ay
    elif kind == TURN:
        noise = 2.0 * draw(w.random, f) - 1.0 if c.turn_noise else 0.0
        speed = length(truth.velocity[f, p, 0], truth.velocity[f, p, 1])
        truth.yaw[f, p] = physics.turned_yaw(c, yaw, angle, speed, noise)
    elif kind == KICK:
        _kick(w, f, p, power, angle)


@compiled
def _kick(w, f, p, power, angle):
    """The server lets player p kick the ball if it is in reach."""
    c, truth, ball = w.constants, w.truth, w.ball
    rel_x = truth.position[f, ball, 0] - truth.position[f, p, 0]
    rel_y = truth.position[f, ball, 1] - truth.position[f, p, 1]
    if length(rel_x, rel_y) > c.kickable_distance:
        return
    w.memory.kicked[f, p] = True
    acceleration, yaw = w.scratch.acceleration, truth.yaw[f, p]
    ax, ay = physics.kick_acceleration(c, power, angle, rel_x, rel_y, yaw)
    acceleration[ball, 0] += ax
    acceleration[ball, 1] += ay
    if c.kick_rand > 0.0:
        speed = length(truth.velocity[f, ball, 0], truth.velocity[f, ball, 1])
        largest = physics.kick_noise_radius(c, power, rel_x, rel_y, yaw, speed)
        radius = largest * draw(w.random, f)
        direction = TWO_PI * draw(w.random, f)
        ux, uy = unit(direction)
        acceleration[ball, 0] += radius * ux
        acceleration[ball, 1] += radius * uy


@compiled
def _set_off(w, f, o):
    """Object o's velocity of this cycle."""
    vx, vy = w.truth.velocity[f, o]
    ax, ay = w.scratch.acceleration[o]
    vx, vy = physics.moved_velocity(vx, vy, ax, ay, _limits(w, o), w.random, f)
    w.truth.velocity[f, o, 0], w.truth.velocity[f, o, 1] = vx, vy


@compiled
def _ask_pymunk(w, f):
    """Give field f the next slot, and write its discs as pymunk is to move them."""
    truth, bodies = w.truth, w.bodies
    slot = bodies.num_asked[0]
    bodies.num_asked[0] = slot + 1
    bodies.asked[slot], bodies.slot[f] = f, slot
    for o in range(w.ball + 1):
        for axis in range(2):
            bodies.motion[slot, o, axis] = truth.position[f, o, axis] + bodies.place[slot, axis]
            bodies.motion[slot, o, 2 + axis] = truth.velocity[f, o, axis]


@compiled
def _limits(w, o):
    """How object o may move."""
    c = w.constants
    if o == w.ball:
        rand = c.ball_rand if c.movement_noise else 0.0
        return physics.Limits(c.ball_accel_max, c.ball_speed_max, rand)
    rand = c.player_rand if c.movement_noise else 0.0
    return physics.Limits(c.player_accel_max, c.player_speed_max, rand)


@compiled_apart
def settle(w, playing):
    """After the discs moved: collisions, referee, and what the players perceive of it.

    Args:
        w: Fields.
        playing: (num_fields,) bool, as `act` had it.
    """
    for f in range(len(playing)):
        if playing[f] and w.truth.running[f]:
            end_cycle(w, f)


@compiled
def end_cycle(w, f):
    """Field f from there on; where its episode had ended the next one kicks off."""
    w.truth.time[f] += 1
    if w.belief.outcome[f] != _IN_PLAY:
        _kick_off(w, f)
    else:
        _come_to_rest(w, f)
        _judge_ball(w, f)
    _perceive(w, f)


@compiled
def _come_to_rest(w, f):
    """Where the discs of field f have moved; those that overlap are parted."""
    c, truth, bodies, slot = w.constants, w.truth, w.bodies, w.bodies.slot[f]
    for o in range(w.ball + 1):
        decay = c.ball_decay if o == w.ball else c.player_decay
        for axis in range(2):
            if slot >= 0:
                truth.position[f, o, axis] = bodies.motion[slot, o, axis] - bodies.place[slot, axis]
            else:
                truth.position[f, o, axis] += truth.velocity[f, o, axis]
            truth.velocity[f, o, axis] = physics.on_grid(decay * truth.velocity[f, o, axis])
    if bodies.touched[f]:
        physics.separate(truth.position[f], truth.velocity[f], bodies.radius, w.scratch)


@compiled
def _judge_ball(w, f):
    """The referee's look at field f: who controls the ball, is the episode over?"""
    c, truth, belief = w.constants, w.truth, w.belief
    belief.cycle[f] += 1
    keeper = referee.near_ball(c, truth.position[f], 0, c.num_keepers)
    taker = referee.near_ball(c, truth.position[f], c.num_keepers, w.num_players)
    if keeper >= 0:
        truth.last_keeper[f] = keeper
    count = truth.take_count[f]
    belief.outcome[f] = referee.outcome(c, truth.position[f], count)
    if belief.outcome[f] == _IN_PLAY:
        truth.take_count[f] = referee.next_take_count(count, keeper >= 0, taker >= 0)


@compiled
def _perceive(w, f):
    """What every player of field f makes of this cycle."""
    survey(w, f)
    for p in range(w.num_players):
        if w.belief.cycle[f] > 0:
            remember(w, f, p)
        feel_self(w, f, p)
        looks, chase = looks_now(w, f, p), nobody_asked()
        if w.belief.cycle[f] > 0 and not (looks and sight.sees_all(w)):
            chase = roll_on(w, f, p)
        if looks:
            sight.look(w, f, p)
            chase = nobody_asked()
        if w.constants.hearing:
            hear(w, f, p)
        _judge(w, f, p, chase)


@compiled
def _judge(w, f, p, chase):
    """What follows from player p's belief: can it kick, who is nearest, must it decide?

    Args:
        chase: Chase, as `fastest_keeper` takes it.
    """
    c, belief = w.constants, w.belief
    ball = belief.position[f, p, w.ball]
    known = belief.age[f, p, w.ball] <= c.ball_lost_age
    own = belief.position[f, p, p]
    near = length(ball[0] - own[0], ball[1] - own[1]) < c.kickable_distance
    belief.ball_kickable[f, p] = known and near
    belief.cycles_to_ball[f, p, :] = NEVER
    if p < c.num_keepers and belief.ball_kickable[f, p]:
        belief.cycles_to_ball[f, p, p] = 0
    elif known and (p < c.num_keepers or c.num_takers > 2):  # of two takers none marks
        keeper, cycles = fastest_keeper(w, f, p, chase)
        if keeper >= 0:
            belief.cycles_to_ball[f, p, keeper] = cycles
    belief.decision_due[f, p] = belief.outcome[f] == _IN_PLAY and not _goes_on_passing(w, f, p)


@compiled
def _goes_on_passing(w, f, p):
    """Does a pass that player p asked for, or continued, a cycle ago need another kick?

    P keeperWithBall: until the ball has left reach no other choice is made. A keeper that has lost
    sight of a player forgets the pass.
    """
    c, belief = w.constants, w.belief
    if w.memory.pass_cycle[f, p] != belief.cycle[f] - 1 or not belief.ball_kickable[f, p]:
        return False
    oldest = 0
    for j in range(w.num_players):
        oldest = max(oldest, belief.age[f, p, j])
    return oldest <= c.player_lost_age
