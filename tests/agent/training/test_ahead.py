"""What was compiled ahead is not compiled again."""

import subprocess
import sys

AHEAD = [sys.executable, "-m", "keepaway_agent.training.ahead"]
PLAY = """
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, Trial, TrainerConfig, trial_seed
from keepaway_sim.task import Task
trainer = Trainer(TrainerConfig(Task(5, 4)), 2)
print(len(list(trainer.run([Trial(trial_seed(1, 0), StopRule(max_episodes=1))]))))
"""


def test_what_was_compiled_ahead_serves_every_task():
    subprocess.run(AHEAD, check=True)
    again = subprocess.run(AHEAD, check=True, capture_output=True, text=True)
    assert again.stderr == ""
    played = subprocess.run(
        [sys.executable, "-c", PLAY], check=True, capture_output=True, text=True
    )
    assert (played.stdout, played.stderr) == ("1\n", "")
