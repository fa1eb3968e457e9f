"""Everything that reads what others wrote, as the fuzzer calls it, with valid input for each."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bag_structures import structure_reader

from keepaway_agent.actions import Action, Role
from keepaway_agent.errors import AgentError, WeightsError
from keepaway_agent.learning.weights import read_weights, write_weights
from keepaway_agent.nodes.conversions import read_perception
from keepaway_agent.playing.agent import Agent, AgentConfig, MatchFacts, check_config
from keepaway_sim.bags.field_recorder import FieldRecorder, world_info
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.match.beginning import begin_match
from keepaway_sim.match.roster import Roster, checked_status
from keepaway_sim.match.settings import MatchSettings
from keepaway_sim.settings import build, flat
from keepaway_sim.task import Task
from keepaway_sim.view.live import LiveMatch
from keepaway_sim.wire import messages
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.field_messages import FieldMessages
from keepaway_sim.wire.messages import Request, action_request
from keepaway_sim.world.config import Config, profile
from keepaway_sim.world.world import World
from keepaway_transfer.errors import LogError, MappingError, StudyError
from keepaway_transfer.mapping import load_mapping, rho_mapping
from keepaway_transfer.reports.kwy import read_kwy, write_kwy
from keepaway_transfer.studies.results import read_results
from keepaway_transfer.studies.study import FOLDER as STUDIES
from keepaway_transfer.studies.study import load_study


class Target(NamedTuple):
    """One reader of what others wrote."""

    read: Callable[[bytes], object]  # None: refused without an exception
    valid: list[bytes]  # what the cases are made of
    refusals: tuple[type[Exception], ...]


def make_targets(folder: Path) -> dict[str, Target]:
    """Everything that reads what others wrote; files are written to the folder."""
    world = World(Task.parse("3v2"), Config())
    begin_match(world, 1)
    return {
        "weights file": Target(read_weights_file, weights_files(), (WeightsError,)),
        "bag": Target(bag_reader(folder / "case.mcap"), bags(folder), (KeepawayError,)),
        "bag's structure": Target(
            structure_reader(next((folder / "zstd").glob("*.mcap")), folder / "structures"),
            [bytes(8)],
            (KeepawayError,),
        ),
        **text_targets(folder),
        "request": Target(request_taker(world), requests(), (KeepawayError,)),
        "status": Target(
            lambda data: checked_status(data, 0, "keeper_1"), [status()], (KeepawayError,)
        ),
        "perception": Target(perceiver(), perceptions(world), (AgentError,)),
        "live page": Target(live_page(), live_messages(world), (KeepawayError,)),
        "simulator's parameters": Target(make_settings, [plain(MatchSettings())], (KeepawayError,)),
        "world's parameters": Target(make_world, world_parameters(), (KeepawayError,)),
        "player's parameters": Target(make_agent, [plain(AgentConfig())], (AgentError,)),
    }


def text_targets(folder: Path) -> dict[str, Target]:
    """Readers of text files."""
    mapping, study, log = (folder / name for name in ("mapping.toml", "study.toml", "log.kwy"))
    write_kwy(log, [60, 80], [True, False], num_keepers=3, num_takers=2, field_size=(25, 25))
    studies = [path.read_bytes() for path in sorted(STUDIES.glob("*.toml"))]
    return {
        "mapping": Target(
            file_reader(load_mapping, mapping),
            [rho_mapping(*tasks).to_toml().encode() for tasks in (("3v2", "4v3"), ("4v3", "5v4"))],
            (MappingError,),
        ),
        "study": Target(file_reader(load_study, study), studies, (StudyError,)),
        "results": Target(results_reader(folder / "results"), results(), (StudyError,)),
        "keepaway log": Target(file_reader(read_kwy, log), [log.read_bytes()], (LogError,)),
    }


def file_reader(read: Callable[[Path], object], path: Path) -> Callable[[bytes], object]:
    """A reader of bytes that go through a file."""

    def read_bytes(data: bytes) -> object:
        path.write_bytes(data)
        return read(path)

    return read_bytes


def weights_files() -> list[bytes]:
    """Small weights files: whole, uncompressed, and with a pickle inside."""
    facts = MatchFacts(2, 1, 5.0, 5.0, 0.1, seed=1)
    weights = Agent(facts, 0, AgentConfig(policy="learn")).learned("keeper_1")
    whole, plain_, evil = io.BytesIO(), io.BytesIO(), io.BytesIO()
    write_weights(whole, weights)
    with (
        zipfile.ZipFile(whole) as source,
        zipfile.ZipFile(plain_, "w") as stored,
        zipfile.ZipFile(evil, "w") as pickled,
    ):
        for name in source.namelist():
            stored.writestr(name, source.read(name))
        pickled.writestr("metadata.json", source.read("metadata.json"))
        array = io.BytesIO()
        np.lib.format.write_array(array, np.array([{}], dtype=object), allow_pickle=True)
        pickled.writestr("weights.npy", array.getvalue())
        pickled.writestr("../../metadata.json", b"{}")
    return [whole.getvalue(), plain_.getvalue(), evil.getvalue()]


def read_weights_file(data: bytes) -> object:
    """What is read must be finite, and of the size that its task has."""
    weights = read_weights(io.BytesIO(data))
    assert np.isfinite(weights.values).all()
    assert weights.values.shape == weights.tiling.weights_shape(len(weights.action_names))
    return weights


def bags(folder: Path) -> list[bytes]:
    """Short bags: finished, unfinished, with and without compression."""
    made = []
    for compression in ("zstd", "lz4", "none"):
        world = World(Task.parse("2v1"), Config())
        begin_match(world, 1)
        bag = BagWriter(folder / compression, world_info(world, 1), compression, 2000)
        recorder = FieldRecorder(bag, world, 0, 1)
        for _ in range(6):
            recorder.moment()
            world.step(world.truth.action, world.truth.target)
        bag.flush()
        made.append(folder.joinpath(compression, f"{compression}_0.mcap").read_bytes())
        bag.close()
        made.append(folder.joinpath(compression, f"{compression}_0.mcap").read_bytes())
    return made


def bag_reader(path: Path) -> Callable[[bytes], object]:
    """Reads a bag from its first message to its last, and decodes them."""

    def read(data: bytes) -> object:
        path.write_bytes(data)
        reader = BagReader(path)
        dict(reader.attachments())
        for message in reader.messages():
            reader.codec(message.topic).decode(message.data)
        return reader

    return read


def results() -> list[bytes]:
    """A results folder's two files, one after the other."""
    study = load_study("table2")
    head = {"study": {**study.settings, "trials": 1}, "command": "study.py", "code_version": "1"}
    trial = {"row": study.rows[0].name, "number": 0, "sources": [], "cycles": [50, 60]}
    trial |= {"greedy_cycles": [], "code_version": "1"}
    return [
        b"\0".join(json.dumps(part, allow_nan=False).encode() for part in (head, trial)) + b"\n"
    ]


def results_reader(folder: Path) -> Callable[[bytes], object]:
    """Reads a results folder."""
    folder.mkdir()

    def read(data: bytes) -> object:
        head, _, trials = data.partition(b"\0")
        folder.joinpath("study.json").write_bytes(head)
        folder.joinpath("trials.jsonl").write_bytes(trials)
        return read_results(folder)

    return read


def requests() -> list[bytes]:
    """A byte for the topic and the sender, then a request."""
    return [
        bytes([player]) + action_request(Request(player, episode, cycle, action, 1), values)
        for player in range(5)
        for episode, cycle in ((0, 0), (0, 1), (1, 0))
        for action, values in ((Action.HOLD_BALL, ()), (Action.PASS_BALL, (1.0, 2.0, 3.0)))
    ]


def request_taker(world: World) -> Callable[[bytes], object]:
    """Takes a request in a match that is running; whatever is then played, the world can play."""
    roster = Roster(world.task, world.config)
    for player in range(world.task.num_players):
        roster.take_seat(player, b"own")

    def take(data: bytes) -> object:
        roster.begin(world, 0.0)
        whose = data[0] if data else 0
        taken = False
        try:
            roster.take(whose % 5, data[1:], b"a stranger's" if whose >= 128 else b"own")
            taken = True
        finally:
            assert not (taken and whose >= 128)
            world.step(*roster.requests())
        return taken

    return take


def status() -> bytes:
    """A status of keeper_1."""
    said = {"name": "keeper_1", "policy": "hand", "ready": True, "episodes": 7}
    return codec(messages.AGENT_STATUS).encode(said)


def perceptions(world: World) -> list[bytes]:
    """What keeper_1 is sent: in play, with the ball, at the end of an episode."""
    sent = FieldMessages(world)
    made = [sent.perceptions()[0]]
    for changed in (world.belief.ball_kickable, world.belief.outcome):
        changed[0] = 1
        made.append(sent.perceptions()[0])
    begin_match(world, 1)
    return made


def perceiver() -> Callable[[bytes], object]:
    """Lets a keeper that learns perceive; what it answers must be something that it may do."""
    facts = MatchFacts(3, 2, 25.0, 25.0, 0.1, seed=1)
    agent = Agent(facts, 0, AgentConfig(policy="learn"))

    def perceive(data: bytes) -> object:
        perceived = read_perception(data, facts.num_players, 0)
        agent.moment = (-1, 0)  # whatever came before, this is new
        decision = agent.perceive(perceived)
        if decision is not None:
            assert decision.action in (Action.HOLD_BALL, Action.PASS_BALL, *NOT_HOLDING)
            assert decision.action != Action.PASS_BALL or 0 < decision.target < facts.num_keepers
            assert np.isfinite(decision.values).all()
        assert np.isfinite(agent.learners.weights).all()
        return perceived

    return perceive


NOT_HOLDING = (Action.GET_OPEN, Action.GO_TO_BALL)


def live_messages(world: World) -> list[bytes]:
    """A byte for the type, then a message of that type."""
    sent = FieldMessages(world)
    made = [sent.match(1, 0.0), sent.field_state(), sent.perceptions()[0], sent.episode(1)]
    made.append(action_request(Request(0, 0, 0, 0, 0), [1.0]))
    return [bytes([number]) + data for number, data in enumerate(made)]


def live_page() -> Callable[[bytes], object]:
    """Feeds a live page; what it sends to browsers must be JSON."""
    types = [messages.MATCH, messages.FIELD_STATE, messages.PERCEPTION, messages.EPISODE]
    types.append(messages.ACTION_REQUEST)
    page = LiveMatch(lambda event: json.loads(event[1]))

    def feed(data: bytes) -> object:
        names = page.feed(types[data[0] % len(types)] if data else messages.MATCH, data[1:])
        page.show()
        return names

    return feed


def plain(parameters: Any) -> bytes:
    """Settings as JSON."""
    return json.dumps(flat(parameters), allow_nan=False).encode()


def world_parameters() -> list[bytes]:
    """Every constant of the world by name, as JSON."""
    constants = {name: value for name, value in flat(Config()).items() if name != "profile"}
    return [json.dumps(constants, allow_nan=False).encode()]


def parameters_of(data: bytes, known: set[str]) -> dict[str, Any]:
    """Parameters as ROS would hand them on: known ones, each of a type that ROS has.

    Raises:
        KeepawayError: bytes that are no JSON object.
    """
    try:
        given = json.loads(data)
        assert isinstance(given, dict)
    except (ValueError, AssertionError, RecursionError) as error:
        raise KeepawayError(f"no parameters: {error}") from error
    return {name: value for name, value in given.items() if name in known}


def of_their_types(given: dict[str, Any], defaults: Any) -> dict[str, Any]:
    """Those whose type is their default's: ROS itself refuses others."""
    return {
        name: value for name, value in given.items() if type(value) is type(flat(defaults)[name])
    }


def make_settings(data: bytes) -> object:
    """A simulator's settings."""
    default = MatchSettings()
    return MatchSettings(**of_their_types(parameters_of(data, set(flat(default))), default))


def make_world(data: bytes) -> object:
    """A world's constants; with those that are taken a cycle can be played."""
    names = set(json.loads(world_parameters()[0]))
    given = {
        name: value for name, value in parameters_of(data, names).items() if type(value) is float
    }
    world = World(Task.parse("2v1"), profile("2005", **given))
    begin_match(world, 1)
    world.step(world.truth.action, world.truth.target)
    assert np.isfinite(world.truth.position).all()
    return world


def make_agent(data: bytes) -> object:
    """A player's settings."""
    default = AgentConfig()
    try:
        given = of_their_types(parameters_of(data, set(flat(default))), default)
    except KeepawayError as error:
        raise AgentError(str(error)) from error
    config = build(AgentConfig, given)
    check_config(Role.KEEPER, config)
    return config


# Limits.
