"""A keeper with a small neural network that learns as it plays: Q-learning, numpy, no CMAC.

Put it into a match with `match.py --keeper-agent`.

It sees where all players stand as seen from itself, chooses between holding the ball and passing
to one of its team-mates in match order, and is paid 1 for every second until it chooses again.
"""

import numpy as np
from small_network import NetworkConfig, QNetworks
from smallest_agent import SmallestAgent, main

from keepaway_msgs.msg import ActionRequest, Match, Perception

SCALE = 10.0  # [m] that are 1 to the network
FORGOTTEN = 100  # [cycles] an older perception is no worse
GAMMA = 0.99  # discount per cycle
EPSILON = 0.05  # share of random choices
CONFIG = NetworkConfig(learn_after=100, train_every=2, copy_every=200)
ALL_FIELDS = np.ones(1, dtype=np.bool_)


class NetworkKeeper(SmallestAgent):
    """Learns from each of its choices when the next one comes, or the episode's end."""

    def on_match(self, match: Match) -> None:
        """Take a place; a match of another size is learned anew."""
        size = (match.num_keepers, match.num_takers)
        if size != (self.match.num_keepers, self.match.num_takers):
            rng = np.random.default_rng([match.seed, match.player_names.index(self.get_name())])
            inputs = 3 * len(match.player_names)
            self.networks = QNetworks(1, inputs, match.num_keepers, rng, CONFIG)
        self.last_choice: tuple[np.ndarray, np.ndarray, int] | None = None
        self.last_seen = (-1, -1)
        super().on_match(match)

    def on_perception(self, seen: Perception) -> None:
        """Learn from the end of an episode; answer what is due."""
        is_new = (seen.episode, seen.cycle) > self.last_seen
        if len(seen.cycles_to_ball) == len(self.match.player_names) and is_new:
            if seen.outcome in (Perception.TAKEN_AWAY, Perception.OUT_OF_BOUNDS):
                self.learn(seen, discount=0.0)
            if seen.episode != self.last_seen[0] or seen.outcome != Perception.IN_PLAY:
                self.last_choice = None
            self.last_seen = (seen.episode, seen.cycle)
        super().on_perception(seen)

    def choose(self, seen):
        """With the ball ask the network; without it do as the smallest agent does."""
        if not seen.ball_kickable:
            return super().choose(seen)
        self.learn(seen, discount=GAMMA)
        state = self.state(seen)
        choice = self.networks.choose(state, EPSILON)
        self.last_choice = state, choice, seen.cycle
        mates = [i for i in range(self.match.num_keepers) if i != self.index]
        if choice[0] == 0:
            return ActionRequest.HOLD_BALL, 0
        return ActionRequest.PASS_BALL, mates[choice[0] - 1]

    def learn(self, seen: Perception, discount: float) -> None:
        """From the last choice, given what came of it; `discount` is 0 at an episode's end."""
        if self.last_choice is None:
            return
        state, choice, cycle = self.last_choice
        num_cycles = seen.cycle - cycle
        paid = np.array([self.match.cycle_time * (1 - GAMMA**num_cycles) / (1 - GAMMA)])
        after = np.array([discount**num_cycles])
        self.networks.learn(ALL_FIELDS, state, choice, paid, after, self.state(seen))

    def state(self, seen: Perception) -> np.ndarray:
        """(1, 3 * num_players): every player's place from here, and how sure it is."""
        places = np.reshape(seen.positions, (-1, 2))[:-1]
        ages = np.minimum(seen.ages[:-1], FORGOTTEN) / FORGOTTEN
        own = np.nan_to_num((places - places[self.index]) / SCALE)
        own[self.index] = np.nan_to_num(places[self.index] / SCALE)
        return np.concatenate([own.ravel(), ages])[None]


if __name__ == "__main__":
    main(NetworkKeeper)
