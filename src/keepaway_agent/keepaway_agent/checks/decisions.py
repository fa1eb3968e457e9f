"""Would the players of a recorded match decide the same again? Needs the recording, and no ROS.

Every player is made anew as the bag describes it (policy, seed, weights it began with), is shown
what was recorded as its perceptions, and must ask for what was recorded as its requests. So a
player that learns is checked to have learned the same.
"""

import io

import numpy as np

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.weights import read_weights
from keepaway_agent.playing.agent import Agent, AgentConfig, Decision, MatchFacts, Perceived
from keepaway_agent.playing.policies import View
from keepaway_agent.settings import build
from keepaway_sim.bags.match_bag import MatchBag, Track
from keepaway_sim.bags.verify import Checked, Difference, whole_episodes
from keepaway_sim.errors import KeepawayError


def check_decisions(bag: MatchBag) -> Checked:
    """Let the players of a bag decide again in its finished episodes, until something differs.

    Raises:
        KeepawayError: the bag does not say who played, or has gaps.
        AgentError: it describes something that no player can be.
    """
    agents = recorded_agents(bag)
    episodes = compared = 0
    for episode, track in whole_episodes(bag):
        for row in range(len(track.time)):
            for player, agent in agents.items():
                decision = agent.perceive(_perceived(track, row, player, episode.number))
                what = _difference(track, row, player, decision)
                if what:
                    name = f"{what} of {bag.match['player_names'][player]}"
                    at = Difference(name, episode.number, int(track.cycle[row]))
                    return Checked(episodes, compared, at)
                compared += decision is not None
        episodes += 1
    return Checked(episodes, compared, None)


def recorded_agents(bag: MatchBag) -> dict[int, Agent]:
    """The players of a bag as they were when the match began, by index; not foreign agents.

    Raises:
        KeepawayError: the bag does not say who played.
        AgentError: it describes something that no player can be.
    """
    if "agents" not in bag.reader.info:
        raise KeepawayError(f"{bag.reader.path} does not say who played (no info 'agents')")
    told = bag.agents
    match, files = bag.match, dict(bag.reader.attachments())
    facts = MatchFacts(
        num_keepers=match["num_keepers"],
        num_takers=match["num_takers"],
        field_length=match["field_length"],
        field_width=match["field_width"],
        cycle_time=match["cycle_time"],
        seed=match["seed"],
        first_episode=match.get("first_episode", 0),
    )
    agents = {}
    for player, name in enumerate(match["player_names"]):
        if "command" in told.get(name, {}):
            continue
        try:
            config = build(AgentConfig, told.get(name, {}))
        except AgentError as error:
            raise AgentError(
                f"{bag.reader.path}: {name} has settings of no player: {error}"
            ) from error
        agents[player] = agent = Agent(facts, player, config)
        if f"{name}.npz" in files:
            agent.use(read_weights(io.BytesIO(files[f"{name}.npz"])))
    return agents


def _perceived(track: Track, row: int, player: int, episode: int) -> Perceived:
    view = View(
        position=track.believed[row, player],
        age=track.age[row, player].astype(np.int32),
        cycles_to_ball=track.cycles_to_ball[row, player].astype(np.int32),
        ball_kickable=bool(track.kickable[row, player]),
        cycle=int(track.cycle[row]),
    )
    due = bool(track.due[row, player])
    return Perceived(episode, int(track.outcome[row]), due, view)


def _difference(track: Track, row: int, player: int, decision: Decision | None) -> str:
    """What of a decision is not as it was recorded; empty where all is, or nothing was recorded."""
    then = track.requested[row, player], track.requested_target[row, player]
    if decision is None or then[0] < 0:
        return ""
    if then != (decision.action, decision.target):
        return "the action"
    recorded = track.values[row, player]
    recorded = recorded[np.isfinite(recorded)]
    return "" if np.array_equal(recorded, decision.values) else "an action value"
