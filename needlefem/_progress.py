"""Progress messages of long computations on standard error.

Any function can announce its activity with `doing`, at negligible cost. The command line runs its
work in `telling`. It prints no message within the first two seconds, and then one line from time to
time, on a terminal or not, with ``--json`` or without. Results are printed on standard output only.
"""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

FIRST = 2.0
"""Seconds before the first message."""
NEXT, LONGEST = 10.0, 60.0
"""Seconds between the first two messages; the interval grows by a half up to the largest."""
FEW_STEPS = 100
"""Number of time steps up to which a message does not state it."""
_activity = [""]
_steps = [0]


def doing(text: str) -> None:
    """Set the activity for the next message."""
    _activity[0] = text


def activity() -> str:
    """Return the activity; empty if none was set."""
    if _activity[0] and _steps[0] > FEW_STEPS:
        return f"{_activity[0]}, of about {_steps[0]:,} time steps"
    return _activity[0]


def expect_steps(steps: float) -> None:
    """Set the approximate number of time steps of the present motion; 0 at its end."""
    _steps[0] = round(steps)


def expected_steps() -> int:
    """Return the approximate number of time steps of the motion; 0 without time steps."""
    return _steps[0]


@contextmanager
def telling(title: str) -> Iterator[None]:
    """Print progress messages on standard error within this context.

    Parameters
    ----------
    title : str
        Beginning of each message.
    """
    ended = threading.Event()
    start = time.monotonic()
    teller = threading.Thread(target=_tell, args=(title, start, ended), daemon=True)
    teller.start()
    try:
        yield
    finally:
        ended.set()
        teller.join(timeout=1.0)


def _tell(title: str, start: float, ended: threading.Event) -> None:
    wait, pause = FIRST, NEXT
    while not ended.wait(wait):
        seconds = time.monotonic() - start
        what = f", {activity()}" if activity() else ""
        try:
            sys.stderr.write(f"{title}: {seconds:.0f} s{what}\n")
            sys.stderr.flush()
        except (OSError, ValueError):  # standard error is closed
            return
        wait, pause = pause, min(1.5 * pause, LONGEST)
