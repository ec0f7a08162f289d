"""The tasks of a benchmark, timed one by one as another process asks for them.

`against` runs this file in the folder of another checkout, so that the package that it imports is
the one there. A checkout is asked for no more than a benchmark which gives its tasks to
`needlefem.bench.timing.in_turn`.
"""

import contextlib
import importlib
import json
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

STANDARD_OUTPUT = sys.stdout


def serve(tasks: Mapping[str, Callable[[], object]], *_: Any, **__: Any) -> NoReturn:
    """Say which tasks there are; then read lines, 'count name', and say the seconds of each.

    Stands for `in_turn` in the benchmark; nothing after it is run.
    """
    _say(list(tasks))
    for line in sys.stdin:
        count, name = line.rstrip("\n").split(" ", 1)
        task = tasks[name]
        start = time.process_time()
        for _number in range(int(count)):
            task()
        _say(time.process_time() - start)
    raise SystemExit(0)


def _say(answer: object) -> None:
    print(json.dumps(answer), file=STANDARD_OUTPUT, flush=True)


def main(name: str, case: str) -> None:
    """Run a benchmark up to its first timing, and serve its tasks."""
    timing = importlib.import_module("needlefem.bench.timing")
    timing.in_turn = serve  # type: ignore[attr-defined]
    _say(timing.__file__)
    with contextlib.redirect_stdout(sys.stderr):
        importlib.import_module(f"needlefem.bench.{name}").run(case)


if __name__ == "__main__":
    main(*sys.argv[1:])
