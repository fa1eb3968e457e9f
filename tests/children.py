"""The worker processes of a training or a study."""

import contextlib

import psutil  # type: ignore[import-untyped]  # comes with distributed


def workers_of(process: int) -> list[psutil.Process]:
    """The workers of a process that live now: those that just ended are left out."""
    living = []
    for child in psutil.Process(process).children():
        with contextlib.suppress(psutil.NoSuchProcess):  # a zombie is one, too
            if "spawn_main" in " ".join(child.cmdline()):
                living.append(child)
    return living
