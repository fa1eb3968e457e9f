"""Weights files: what goes in comes out, and everything else is refused in words."""

import dataclasses
import io
import json
import math
import os
import pickle
import signal
import subprocess
import sys
import time
import tracemalloc
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from keepaway_agent.actions import Role
from keepaway_agent.errors import WeightsError
from keepaway_agent.learning import weights as weights_module
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.learning.weights import (
    LearnedWeights,
    check_fits,
    load_weights,
    read_weights,
    save_weights,
    to_metadata,
    write_weights,
)
from keepaway_sim import task


def make_weights(
    num_keepers: int = 3, num_takers: int = 2, role: Role = Role.KEEPER, **changes: Any
) -> LearnedWeights:
    tiling = make_tiling(role, num_keepers, num_takers)
    rng = np.random.default_rng(3)
    parts: dict[str, Any] = {
        "values": rng.normal(size=tiling.weights_shape(num_keepers)),
        "role": role,
        "num_keepers": num_keepers,
        "num_takers": num_takers,
        "field_length": 25.0,
        "field_width": 25.0,
        "tiling": tiling,
        "sarsa": SarsaConfig(lambda_=0.5),
        "episodes": 1234,
        "hours": 5.5,
        "seed": 7,
        "player": "keeper_2",
        "code_version": "0.1.0+g123",
        "created_by": "scripts/train.py --task 3v2",
    }
    return LearnedWeights(**(parts | changes))


def as_bytes(weights: LearnedWeights) -> bytes:
    file = io.BytesIO()
    write_weights(file, weights)
    return file.getvalue()


WHOLE = as_bytes(make_weights(2, 1))


def with_members(members: dict[str, bytes]) -> io.BytesIO:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return file


def members_of(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def with_metadata(**changes: Any) -> io.BytesIO:
    members = members_of(WHOLE)
    metadata = json.loads(members["metadata.json"]) | changes
    return with_members(members | {"metadata.json": json.dumps(metadata).encode()})


def npy(array: np.ndarray, allow_pickle: bool = False) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, array, allow_pickle=allow_pickle)
    return file.getvalue()


@pytest.mark.parametrize("role", list(Role))
def test_what_was_saved_is_loaded(tmp_path, role):
    weights = make_weights(role=role)
    path = tmp_path / "new" / "folder" / "keeper_2.npz"
    save_weights(path, weights)
    loaded = load_weights(path)
    np.testing.assert_array_equal(loaded.values, weights.values)
    assert to_metadata(loaded) == to_metadata(weights)
    assert [file.name for file in path.parent.iterdir()] == ["keeper_2.npz"]


def test_numpy_alone_reads_a_file(tmp_path):
    path = tmp_path / "keeper_1.npz"
    save_weights(path, make_weights())
    with np.load(path, allow_pickle=False) as archive:
        assert archive["weights"].shape == (3, 13, 19, 32)
        metadata = json.loads(archive["metadata.json"])
    assert metadata["tiling"]["feature_names"][0] == "dist_k1_c"
    assert metadata["action_names"] == ["hold", "pass_k2", "pass_k3"]
    assert metadata["role"] == "keeper"


def test_equal_weights_make_equal_files():
    assert as_bytes(make_weights()) == as_bytes(make_weights())


def test_a_file_that_is_there_is_replaced_only_when_asked(tmp_path):
    path = tmp_path / "keeper_1.npz"
    save_weights(path, make_weights(episodes=1))
    with pytest.raises(WeightsError, match=r"keeper_1.npz is there already: overwrite it or name"):
        save_weights(path, make_weights(episodes=2))
    assert load_weights(path).episodes == 1
    save_weights(path, make_weights(episodes=2), overwrite=True)
    assert load_weights(path).episodes == 2
    assert len(list(tmp_path.iterdir())) == 1


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(WeightsError, match=r"file/keeper_1\.npz cannot be written"):
        save_weights(tmp_path / "file" / "keeper_1.npz", make_weights())


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(WeightsError, match=r"none.npz cannot be read"):
        load_weights(tmp_path / "none.npz")
    with pytest.raises(WeightsError, match="cannot be read"):
        load_weights(tmp_path)


WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_weights import make_weights
from keepaway_agent.learning.weights import save_weights
episodes = 0
while True:
    save_weights(Path(sys.argv[1]), make_weights(episodes=episodes), overwrite=True)
    episodes += 1
    print(episodes, flush=True)
"""


def test_a_writer_killed_at_any_moment_leaves_a_whole_file(tmp_path):
    path = tmp_path / "keeper_1.npz"
    rng = np.random.default_rng(0)
    for _ in range(3):
        command = [sys.executable, "-c", WRITER, str(path), str(Path(__file__).parent)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            assert writer.stdout.readline()
            time.sleep(rng.uniform(0.0, 0.05))
            os.kill(writer.pid, signal.SIGKILL)
        assert load_weights(path).values.any()


@settings(max_examples=300, deadline=None)
@given(where=st.integers(0, len(WHOLE) - 1), bit=st.integers(0, 7))
@example(where=0, bit=0)
@example(where=len(WHOLE) - 1, bit=7)
def test_a_flipped_bit_is_refused_or_changes_nothing(where, bit):
    broken = bytearray(WHOLE)
    broken[where] ^= 1 << bit
    try:
        weights = read_weights(io.BytesIO(bytes(broken)))
    except WeightsError:
        return
    assert as_bytes(weights) == WHOLE  # a bit that nobody reads, such as a member's attributes


@settings(max_examples=100, deadline=None)
@given(length=st.integers(0, len(WHOLE) - 1))
def test_a_truncated_file_is_refused(length):
    with pytest.raises(WeightsError):
        read_weights(io.BytesIO(WHOLE[:length]))


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300))
def test_foreign_bytes_are_refused(data):
    with pytest.raises(WeightsError):
        read_weights(io.BytesIO(data))


@settings(max_examples=200, deadline=None)
@given(
    metadata=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from([*json.loads(members_of(WHOLE)["metadata.json"]), "x"]), inner
            )
        ),
    )
)
def test_foreign_metadata_are_refused(metadata):
    members = members_of(WHOLE) | {"metadata.json": json.dumps(metadata).encode()}
    with pytest.raises(WeightsError):
        read_weights(with_members(members))


@settings(max_examples=300, deadline=None)
@given(
    entry=st.sampled_from(sorted(json.loads(members_of(WHOLE)["metadata.json"]))),
    value=st.none()
    | st.booleans()
    | st.floats(max_value=-1)
    | st.just(math.nan)
    | st.lists(st.integers())
    | st.dictionaries(st.text(), st.integers()),
)
def test_a_wrong_entry_is_refused(entry, value):
    with pytest.raises(WeightsError):
        read_weights(with_metadata(**{entry: value}))


def test_a_newer_version_is_refused_with_the_way_out():
    with pytest.raises(WeightsError, match=r"format version 2, but .* up to 1: update it"):
        read_weights(with_metadata(format_version=2))


def test_another_kind_of_file_is_refused():
    with pytest.raises(WeightsError, match="metadata do not say so"):
        read_weights(with_metadata(format="something else"))
    with pytest.raises(WeightsError, match="not a whole weights file"):
        read_weights(with_members({"weights.npy": npy(np.zeros(3))}))


def test_a_pickle_is_not_opened():
    class Trap:
        def __reduce__(self):
            return (os.abort, ())

    members = members_of(WHOLE)
    trap = np.array([Trap()], dtype=object)
    with pytest.raises(WeightsError, match="object"):
        read_weights(with_members(members | {"weights.npy": npy(trap, allow_pickle=True)}))
    with pytest.raises(WeightsError):
        read_weights(io.BytesIO(pickle.dumps(Trap())))


def test_a_header_that_promises_more_than_there_is_is_not_believed():
    header = io.BytesIO()
    shape = (2**40, 7)
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    members = members_of(WHOLE) | {"weights.npy": header.getvalue()}
    with pytest.raises(WeightsError, match="1099511627776"):
        read_weights(with_members(members))


def peak_of_refusing(file: io.BytesIO, words: str) -> int:
    """Bytes that reading the file takes at most, until it is refused with these words."""
    tracemalloc.start()
    try:
        with pytest.raises(WeightsError, match=words) as refused:
            read_weights(file)
        assert len(str(refused.value)) < 1000
        assert str(refused.value).isprintable()
        assert "zip" not in str(refused.value)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def deflated(
    members: dict[str, bytes],
    method: int = zipfile.ZIP_DEFLATED,
    says: dict[str, int] | None = None,
) -> bytes:
    """An archive; its list of members says that some unpack to these numbers of bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
        for name, size in (says or {}).items():
            archive.getinfo(name).file_size = size
    return file.getvalue()


@pytest.mark.parametrize("name", ["metadata.json", "weights.npy"])
def test_what_unpacks_to_more_than_weights_have_is_not_unpacked(name):
    members = members_of(WHOLE)
    bomb = {**members, name: bytes(2**27)}
    honest = io.BytesIO(deflated(bomb))
    assert peak_of_refusing(honest, f"{name} has 134217728 bytes") < 2**22
    lying = io.BytesIO(deflated(bomb, says={name: len(members[name])}))
    assert peak_of_refusing(lying, "Bad CRC") < 2**22


def test_other_ways_of_packing_are_refused():
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):  # unpack without a bound
        packed = deflated(members_of(WHOLE), method)
        assert peak_of_refusing(io.BytesIO(packed), "is packed by method") < 2**20


def test_an_archive_of_many_members_is_not_listed():
    many = {f"{number}": b"" for number in range(20_000)}
    archive = deflated(members_of(WHOLE) | many)
    assert peak_of_refusing(io.BytesIO(archive), "more than 16 members") < 2 * len(archive)


def test_a_file_larger_than_weights_are_is_not_read_to_its_end(monkeypatch):
    monkeypatch.setattr(weights_module, "MAX_BYTES", 1000)
    monkeypatch.setattr(weights_module, "MAX_METADATA_BYTES", 1000)
    assert peak_of_refusing(io.BytesIO(bytes(10**6)), "more than 2000 bytes") < 10**5


def test_what_is_no_ordinary_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(WeightsError, match="pipe: no ordinary file"):
        load_weights(tmp_path / "pipe")


HUGE = 10**9
TILING = json.loads(members_of(WHOLE)["metadata.json"])["tiling"]


@pytest.mark.parametrize(
    "entry",
    [
        {"num_keepers": HUGE},
        {"num_takers": HUGE},
        {"num_keepers": 12},
        {"num_keepers": 2.0},
        {"num_keepers": 10**4000},
        {"episodes": 2**63},
        {"seed": 10**4000},
        {"format_version": 10**4000},
        {"field_length": 1e300},
        {"hours": 10**4000},
        {"tiling": TILING | {"widths": [1e-300] * 7}},
        {"tiling": TILING | {"highs": [1e300] * 7}},
        {"tiling": TILING | {"lows": [-1e300] * 7}},
        {"tiling": TILING | {"widths": [True] * 7}},
        {"tiling": TILING | {"feature_names": ["\x1b[31m" * 1000] * 7}},
        {"player": "\x1b]0;owned\x07keeper_1"},
        {"player": "keeper_1\nkeeper_2"},
        {"player": "../../keeper_1"},
        {"player": "..\\keeper_1"},
        {"player": "keeper_\u202e1"},
        {"player": "k" * 100_000},
        {"created_by": "\x1b[2J"},
        {"code_version": "1\x00"},
        {"ordering": "\x1b[2J" * 1000},
        {"role": "\x1b[2J" * 1000},
        {"action_names": ["\x1b[2J" * 1000]},
        {"\x1b[2J" * 1000: 1},
        {"sarsa": {"alpha": "\x1b[2J" * 1000}},
        {"sarsa": {"\x1b[2J" * 1000: 1}},
    ],
)
def test_numbers_and_texts_are_checked_before_anything_is_made_of_them(entry):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert peak_of_refusing(with_metadata(**entry), ".") < 2**22


def test_the_greatest_teams_are_those_of_the_simulator():
    assert weights_module.MAX_TEAM_SIZE == task.MAX_TEAM_SIZE
    assert weights_module.MAX_FIELD_SIDE == task.MAX_FIELD_SIDE
    side = task.MAX_FIELD_SIDE
    largest = make_tiling(Role.KEEPER, 11, 11, side, side)
    assert 4 * 8 * np.prod(largest.weights_shape(11)) < weights_module.MAX_BYTES


def test_weights_of_a_size_that_nobody_learns_are_refused():
    for value in (1e308, -1e308, 2e9):
        values = make_weights().values.copy()
        values[1, 2, 3, 4] = value
        with pytest.raises(WeightsError, match=r"not all finite and within \+-1e\+09"):
            make_weights(values=values)
    assert make_weights(values=np.full_like(make_weights().values, 1e9)).values.max() == 1e9


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_weights_that_are_not_finite_are_refused(value):
    values = make_weights().values.copy()
    values[1, 2, 3, 4] = value
    with pytest.raises(WeightsError, match="not all finite"):
        make_weights(values=values)
    members = members_of(WHOLE)
    small = make_weights(2, 1).values.copy()
    small[0, 0, 0, 0] = value
    with pytest.raises(WeightsError, match="not all finite"):
        read_weights(with_members(members | {"weights.npy": npy(small)}))


def test_parts_that_do_not_fit_together_are_refused():
    with pytest.raises(WeightsError, match=r"shape \(3, 13, 19, 32\): 4v3 .* \(4, 19, 19, 32\)"):
        make_weights(4, 3, values=make_weights().values)
    with pytest.raises(WeightsError, match="a keeper in 3v2 has dist_k1_c"):
        make_weights(tiling=make_tiling(Role.KEEPER, 4, 3))
    with pytest.raises(WeightsError, match="num_keepers=1"):
        dataclasses.replace(make_weights(), num_keepers=1)
    with pytest.raises(WeightsError, match="ordering='size'"):
        make_weights(ordering="size")
    with pytest.raises(WeightsError, match=r"action_names=.*\['hold', 'pass_k2'\]"):
        read_weights(with_metadata(action_names=["pass_k2", "hold"]))
    with pytest.raises(WeightsError, match="num_tilings=16"):
        read_weights(with_metadata(num_tilings=16))


def test_weights_for_something_else_are_refused_with_the_way_out():
    weights = make_weights()
    tiling = weights.tiling
    check_fits(weights, Role.KEEPER, 3, 2, tiling, "ball")
    with pytest.raises(WeightsError, match="keeper in 3v2, not of a keeper in 4v3: transfer them"):
        check_fits(weights, Role.KEEPER, 4, 3, make_tiling(Role.KEEPER, 4, 3), "ball")
    with pytest.raises(WeightsError, match="not of a taker in 3v2"):
        check_fits(weights, Role.TAKER, 3, 2, make_tiling(Role.TAKER, 3, 2), "ball")
    with pytest.raises(WeightsError, match="ordered by 'ball', not by 'k1'"):
        check_fits(weights, Role.KEEPER, 3, 2, tiling, "k1")
    framework = make_tiling(Role.KEEPER, 3, 2, profile="framework")
    with pytest.raises(WeightsError, match="other tiles"):
        check_fits(weights, Role.KEEPER, 3, 2, framework, "ball")
