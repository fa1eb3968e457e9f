"""A signal ends a program once, not in the middle of what must be whole, with a shell's code."""

import os
import signal

import pytest

from keepaway_sim.cli import interrupts
from keepaway_sim.cli.interrupts import Interruption, Stopped


def send(number: int) -> None:
    os.kill(os.getpid(), number)


@pytest.fixture(autouse=True)
def _as_before():
    before = {each: signal.getsignal(each) for each in interrupts.SIGNALS}
    yield
    for each, handler in before.items():
        signal.signal(each, handler)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_a_signal_stops_with_the_code_that_shells_expect(number, code):
    with pytest.raises(Stopped) as stopped, Interruption():
        send(number)
    assert stopped.value.code == code
    assert signal.getsignal(number) == signal.SIG_IGN  # it is ending


def test_a_second_signal_changes_nothing(monkeypatch):
    monkeypatch.setattr(interrupts, "GRACE", 1000.0)
    done = []

    def save_when_stopped() -> None:
        try:
            send(signal.SIGINT)
        finally:
            send(signal.SIGINT)
            send(signal.SIGTERM)
            done.append("saved")

    with pytest.raises(Stopped), Interruption():
        save_when_stopped()
    assert done == ["saved"]


def test_a_program_that_does_not_end_can_be_asked_again(monkeypatch):
    monkeypatch.setattr(interrupts, "GRACE", 0.0)
    with Interruption():
        for _ in range(2):
            with pytest.raises(Stopped):
                send(signal.SIGINT)


def test_what_must_be_whole_is_done_first():
    done = []

    def write_and_go_on(interruption: Interruption) -> None:
        with interruption.shield():
            send(signal.SIGTERM)
            done.append("written")
        done.append("next")

    with pytest.raises(Stopped), Interruption() as interruption:
        write_and_go_on(interruption)
    assert done == ["written"]


def test_without_a_signal_all_is_as_before():
    before = signal.getsignal(signal.SIGTERM)
    with Interruption() as interruption, interruption.shield():
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before


def test_what_nohup_ignores_is_ignored():
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Interruption():
        send(signal.SIGHUP)
