"""A result does not depend on how many numbers the machine's processor works on at once."""

import os
import subprocess
import sys
from pathlib import Path

import llvmlite.binding
import pytest

PLAY = """
import hashlib
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, Trial, TrainerConfig, trial_seed
from keepaway_sim.task import Task

trainer = Trainer(TrainerConfig(Task.parse("4v3")), 4)
trials = (Trial(trial_seed(7, k), StopRule(max_episodes=10), "learn") for k in range(4))
digest = hashlib.sha256()
for result in trainer.run(trials):
    digest.update(result.durations.tobytes() + result.keeper_weights.tobytes())
fields = trainer._world.fields
for array in (*fields.truth, *fields.belief, *fields.memory):
    digest.update(array.tobytes())
print(digest.hexdigest())
"""
OTHERS = {"haswell": "avx2", "x86-64-v2": "sse4.2"}
"""Processors, and what a machine must have to run their code: 4 and 2 doubles at once."""


def start(env: dict[str, str], cache: Path) -> "subprocess.Popen[str]":
    env = {**os.environ, **env}
    if env.get("NUMBA_CPU_NAME"):
        env["NUMBA_CACHE_DIR"] = str(cache)
    return subprocess.Popen(
        [sys.executable, "-c", PLAY], env=env, stdout=subprocess.PIPE, text=True
    )


@pytest.mark.slow
def test_learning_gives_the_same_bits_on_processors_of_any_vector_width(tmp_path: Path) -> None:
    has = llvmlite.binding.get_host_cpu_features()
    others = [name for name, feature in OTHERS.items() if has.get(feature)]
    if not others:
        pytest.skip("a processor of another kind: it runs the code of no other")
    envs = [{"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ""} for name in others]
    running = [start(env, tmp_path) for env in ({}, *envs)]
    digests = [process.communicate()[0] for process in running]
    assert all(process.returncode == 0 for process in running)
    assert len(digests[0].strip()) == 64
    assert len(set(digests)) == 1
    assert len(list((tmp_path / "keepaway").glob("machine_code-*"))) == len(others)
