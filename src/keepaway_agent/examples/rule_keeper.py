"""A keeper in plain Python that plays by three rules of its own: it looks for the freest lane.

.venv/bin/python scripts/match.py --keeper-agent src/keepaway_agent/examples/rule_keeper.py
"""

import math

from smallest_agent import SmallestAgent, main

from keepaway_msgs.msg import ActionRequest

SAFE = 4.0  # [m] from the nearest taker, to hold the ball
OLD = 12  # [cycles] since a player was seen, to believe where it is

Point = tuple[float, float]


class RuleKeeper(SmallestAgent):
    """Holds the ball while it is safe, else passes to the mate whom no taker can cut off."""

    def choose(self, seen):
        """Hold or pass with the ball; without it do as the smallest agent does."""
        known = [i for i in range(len(self.match.player_names)) if seen.ages[i] <= OLD]
        places = {i: (seen.positions[2 * i], seen.positions[2 * i + 1]) for i in known}
        takers = [places[i] for i in known if i >= self.match.num_keepers]
        mates = [i for i in known if i < self.match.num_keepers and i != self.index]
        own = places.get(self.index, (0.0, 0.0))
        if not seen.ball_kickable or not mates or not takers:
            return super().choose(seen)
        if min(math.dist(own, taker) for taker in takers) > SAFE:
            return ActionRequest.HOLD_BALL, 0
        best = max(mates, key=lambda mate: freedom(own, places[mate], takers))
        return ActionRequest.PASS_BALL, best


def freedom(start: Point, goal: Point, takers: list[Point]) -> float:
    """Metres from the line of a pass to the taker nearest to it.

    >>> freedom((0.0, 0.0), (10.0, 0.0), [(5.0, 2.0), (5.0, -3.0)])
    2.0
    """
    return min(distance_to_line(taker, start, goal) for taker in takers)


def distance_to_line(point: Point, start: Point, goal: Point) -> float:
    """Metres from a point to the line between two others."""
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    length = math.hypot(dx, dy) or 1.0
    along = ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / length
    along = min(max(along, 0.0), length)
    return math.dist(point, (start[0] + along * dx / length, start[1] + along * dy / length))


if __name__ == "__main__":
    main(RuleKeeper)
