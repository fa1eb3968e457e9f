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
NARROWER = {"avx512f": "haswell", "avx2": "x86-64-v2"}
"""By what a machine has: a processor that works on half as many doubles at once, 4 or 2."""


def start(env: dict[str, str], cache: Path) -> "subprocess.Popen[str]":
    env = {**os.environ, **env}
    if env.get("NUMBA_CPU_NAME"):
        env["NUMBA_CACHE_DIR"] = str(cache)
    return subprocess.Popen(
        [sys.executable, "-c", PLAY], env=env, stdout=subprocess.PIPE, text=True
    )


@pytest.mark.slow
def test_learning_gives_the_same_bits_on_processors_of_another_vector_width(tmp_path: Path) -> None:
    has = llvmlite.binding.get_host_cpu_features()
    other = next((name for feature, name in NARROWER.items() if has.get(feature)), None)
    if other is None:
        pytest.skip("a processor of another kind: it runs the code of no other")
    envs: list[dict[str, str]] = [{}, {"NUMBA_CPU_NAME": other, "NUMBA_CPU_FEATURES": ""}]
    running = [start(env, tmp_path) for env in envs]
    digests = [process.communicate()[0] for process in running]
    assert [process.returncode for process in running] == [0, 0]
    assert len(digests[0].strip()) == 64
    assert digests[0] == digests[1]
    assert len(list((tmp_path / "keepaway").glob("machine_code-*"))) == 1
