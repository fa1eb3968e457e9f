"""Progress where the output is no terminal: a line now and then, which says what is left."""

import os
import pty
import subprocess
import sys

from keepaway_sim.cli.progress import ProgressBar


def test_a_line_now_and_then_says_how_much_is_done_and_how_long_the_rest_takes(capsys):
    now = [0.0]
    with ProgressBar("train", 400, "episodes", period=10, clock=lambda: now[0]) as bar:
        for now[0], done in ((5.0, 50), (12.0, 100), (15.0, 150), (40.0, 300)):
            bar.show(done, "mean 7.0 s")
    assert capsys.readouterr().err.splitlines() == [
        "train: 100/400 episodes, mean 7.0 s, 00:36 left",
        "train: 300/400 episodes, mean 7.0 s, 00:13 left",
    ]


def test_what_estimates_by_itself_has_its_words_alone(capsys):
    with ProgressBar("study", 12, "trials", done=4, period=0, estimates=False) as bar:
        bar.show(8, "time left 1 min")
    assert capsys.readouterr().err == "study: 8/12 trials, time left 1 min\n"


def test_a_terminal_that_does_not_know_its_width_has_a_bar():
    program = (
        "from keepaway_sim.cli.progress import ProgressBar\n"
        "with ProgressBar('train', 2, 'episodes') as bar: bar.show(2, 'mean 7.0 s')"
    )
    ours, theirs = pty.openpty()
    done = subprocess.Popen([sys.executable, "-c", program], stderr=theirs)
    os.close(theirs)
    shown = b""
    try:
        while part := os.read(ours, 1000):
            shown += part
    except OSError:  # its end was closed
        pass
    assert done.wait() == 0
    assert b"2/2 [" in shown
    assert b"mean 7.0 s" in shown
