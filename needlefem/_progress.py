"""Progress of long work: a line on standard error that says what is being done.

Code that takes long says what it does by `doing`, wherever it is; that costs next to nothing. A
process of the command line wraps its work in `telling`, which prints nothing within the first two
seconds, and then a line from time to time, on a terminal or not, with ``--json`` or without:
results go to standard output alone.
"""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

FIRST = 2.0
"""After how many seconds the first line is printed."""
NEXT, LONGEST = 10.0, 60.0
"""Seconds between the first two lines; they grow by a half, up to the longest."""
FEW_STEPS = 100
"""Number of time steps up to which a line of progress does not name it."""
_activity = [""]
_steps = [0]


def doing(text: str) -> None:
    """Say what is being done from now on, for the next line of progress."""
    _activity[0] = text


def activity() -> str:
    """Return what is being done, empty if nobody said."""
    if _activity[0] and _steps[0] > FEW_STEPS:
        return f"{_activity[0]}, of about {_steps[0]:,} time steps"
    return _activity[0]


def expect_steps(steps: float) -> None:
    """Say about how many time steps the motion of a needle takes that begins; 0 when it ends."""
    _steps[0] = round(steps)


def expected_steps() -> int:
    """Return about how many time steps the needle's motion takes, 0 without time steps."""
    return _steps[0]


@contextmanager
def telling(title: str) -> Iterator[None]:
    """Tell on standard error what is being done, as long as it lasts.

    Parameters
    ----------
    title : str
        What every line begins with.
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
        except (OSError, ValueError):  # nobody reads it any more
            return
        wait, pause = pause, min(1.5 * pause, LONGEST)
