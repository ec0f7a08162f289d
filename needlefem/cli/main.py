"""``needlefem COMMAND``: arguments, dispatch, exit statuses.

0 done, 1 a check or expectation failed, 2 usage or case error, 3 the simulation could not go on,
was interrupted, or a file could not be written, 4 no renderer.
"""

import argparse
import gc
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import NoReturn

from needlefem._progress import doing, telling
from needlefem.cli import new as newoptions
from needlefem.cli import streams
from needlefem.errors import NeedlefemError, OutputError

COMMANDS = {
    "new": "create a case from contours, a label map or a mesh",
    "run": "simulate the motion of the needle in a case",
    "plan": "find the release point whose final position is the case's target",
    "render": "draw a case or a result: stills, panels, animations",
    "figures": "draw the figures of Alterovitz et al. 2003 next to the paper's numbers",
    "modes": "compute the vibration modes of the tissue of a case",
    "verify": "run the reference problems",
    "check": "check an element, a material law or an integrator",
    "study": "measure on what the results of a case depend",
    "bench": "measure computing times",
    "upgrade": "rewrite a case file of schema version 1 with the words of version 2",
    "info": "print what is installed, for bug reports",
}

LONGEST_ERROR = 400
"""Characters of a usage error that are shown."""

HANDLERS = {
    "bench": ("experiments", "run_benchmark"),
    "study": ("experiments", "run_study"),
    "check": ("qualify", "main"),
    "upgrade": ("new", "upgrade"),
}
"""Module and function of commands that have no module of their own name."""


def process() -> NoReturn:
    """Run the command line as a process of its own, and end it with the exit status.

    Imports leave no garbage and what there is at the end goes with the process: neither is looked
    through, nor is anything freed one by one.
    """
    gc.disable()
    streams.open_missing()
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, partial(_stop, os.getpid()))
    try:
        with telling(_title(sys.argv[1:])):
            status = main(imported=_spared)
    except KeyboardInterrupt:  # between the end of the command and that of the process
        status = 3
    except SystemExit as stop:  # help was asked for, or the arguments can't be used
        status = stop.code if isinstance(stop.code, int) else 0
    try:
        streams.flush()
    except OutputError as error:
        streams.tell(f"needlefem: {error}")
        status = error.exit_status
    os._exit(status)


def _stop(owner: int, number: int, _: object) -> None:
    """Stop the command as Ctrl-C does, so that it removes what it has half written."""
    if os.getpid() != owner:  # a process of a pool, which is stopped in this way
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    raise KeyboardInterrupt(f"stopped by {signal.Signals(number).name}")


def _title(arguments: Sequence[str]) -> str:
    """Return what lines of progress begin with: the command, and which study or benchmark."""
    words = arguments[: 2 if arguments[:1] in (["study"], ["bench"]) else 1]
    return " ".join(["needlefem", *(ascii(word)[1:-1] for word in words)])


def _spared() -> None:
    gc.freeze()
    gc.enable()


def main(
    arguments: Sequence[str] | None = None, imported: Callable[[], None] = lambda: None
) -> int:
    """Run the command line and return its exit status; call `imported` before work starts."""
    # the dense products here are small: threads only cost; must be set before numpy is imported
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    warnings.formatwarning = _warning_text
    given = sys.argv[1:] if arguments is None else arguments
    debug = "--debug" in given
    try:
        options = parser_of(given).parse_args(given)
        if options.allow_code:
            import_module("needlefem._plugin").allow()
        doing("importing")
        module, handler = HANDLERS.get(options.command, (options.command, "main"))
        command = getattr(import_module(f"needlefem.cli.{module}"), handler)
        doing("")
        imported()
        return int(command(options))
    except NeedlefemError as error:
        return _failed(str(error), error.exit_status, debug=debug)
    except KeyboardInterrupt as stop:
        return _failed(str(stop) or "interrupted", 3, debug=debug)
    except MemoryError as error:
        return _failed(f"the memory does not suffice: {error}".rstrip(": "), 3, debug=debug)
    except OSError as error:
        return _failed(_sentence(error), 3, debug=debug)


def _failed(sentence: str, status: int, *, debug: bool) -> int:
    """Say why the command ends early, and leave nothing half written; return the exit status."""
    if debug:
        traceback.print_exc()
    files = sys.modules.get("needlefem.io.result_folder")
    if files is not None:
        files.discard_parts()
    streams.tell(f"needlefem: {sentence}")
    return status


def _sentence(error: OSError) -> str:
    reason = (error.strerror or str(error) or type(error).__name__).lower()
    return f"'{error.filename}': {reason}" if error.filename else reason


def _warning_text(message: Warning | str, *_: object, **__: object) -> str:
    """Return a warning as a user reads it: without the line of code that gave it."""
    return f"needlefem: warning: {message}\n"


class Parser(argparse.ArgumentParser):
    """A parser whose errors are two lines: what is wrong, and where the options are listed."""

    def error(self, message: str) -> NoReturn:
        """End the process with a usage error."""
        text = " ".join(message.split())
        shown = text if len(text) <= LONGEST_ERROR else f"{text[: LONGEST_ERROR - 3]}..."
        streams.tell(f"{self.prog}: {shown}")
        streams.tell(f"'{self.prog} --help' lists what can be given")
        raise SystemExit(2)


def parser_of(given: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser of all commands; with arguments, the options of their command alone."""
    parser = Parser(prog="needlefem", description=__doc__.splitlines()[0])
    parser.set_defaults(debug=False)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, sentence in COMMANDS.items():
        if given and given[0] in COMMANDS and given[0] != name:
            continue
        sub = commands.add_parser(name, help=sentence, description=sentence)
        sub.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
        sub.add_argument("--debug", action="store_true", help="show a traceback with an error")
        sub.add_argument(
            "--allow-code", action="store_true",
            help="run code of yours that a case or option names as module:Name",
        )  # fmt: skip
        _OPTIONS[name](sub)
    return parser


def _case(parser: argparse.ArgumentParser, *, optional: bool = False) -> None:
    parser.add_argument(
        "case", nargs="?" if optional else None, default="", help="path of a case.toml"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help='replace a key of the case, as in --set needle.tip_radius="1 mm"',
    )  # fmt: skip


def _output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", metavar="DIR", help="write results and pictures there")
    parser.add_argument("--no-pictures", action="store_true", help="write no pictures")


def _run(parser: argparse.ArgumentParser) -> None:
    _case(parser)
    _output(parser)
    parser.add_argument(
        "--snapshots", type=int, default=0, metavar="N",
        help="with --out: N states of the tissue as VTU files for ParaView, in insertion.pvd",
    )  # fmt: skip


def _plan(parser: argparse.ArgumentParser) -> None:
    _case(parser)
    _output(parser)
    parser.add_argument("--search", choices=("root", "golden", "grid"), help="how to search")
    parser.add_argument(
        "--method", choices=("own", "paper"), default="own",
        help="'paper': conforming coupling, golden section; compared with the default",
    )  # fmt: skip
    parser.add_argument(
        "--all-solutions", action="store_true", help="search further offsets that reach the target"
    )


def _render(parser: argparse.ArgumentParser) -> None:
    _case(parser)
    parser.add_argument(
        "--out", metavar="FILE", default="out/picture.png",
        help="picture (.png, .webp, .jpg) or animation (.gif, .webp, .mp4)",
    )  # fmt: skip
    parser.add_argument("--setup", action="store_true", help="the scene, before any simulation")
    parser.add_argument("--compare", metavar="CASE", help="a second case or result on the right")
    _renamed(parser, "--beside", "compare")
    parser.add_argument(
        "--field", default="", help="displacement, strain, von-mises, pressure or validity"
    )
    parser.add_argument(
        "--texture", default="", metavar="FILE",
        help="image of the undeformed tissue, deformed with it; 'synthetic' makes ultrasound up",
    )  # fmt: skip
    parser.add_argument("--time", metavar="TIME", help='a still at a time, as in "3 s"')
    parser.add_argument("--depth", metavar="DEPTH", help='a still at a depth, as in "3 cm"')
    parser.add_argument("--panels", type=int, metavar="N", help="N states next to each other")
    parser.add_argument("--frames", type=int, help="of an animation; 60 when left out")
    parser.add_argument("--rate", type=float, help="frames a second; 12 when left out")
    parser.add_argument("--size", default="1280x720", help="pixels, width x height")


def _figures(parser: argparse.ArgumentParser) -> None:
    _case(parser)
    parser.add_argument("--out", metavar="DIR", default="out/figures", help="page and pictures")


def _modes(parser: argparse.ArgumentParser) -> None:
    _case(parser)
    _output(parser)
    parser.add_argument("--count", type=int, default=6, help="how many, from the lowest")
    parser.add_argument("--unsupported", action="store_true", help="without the supports")
    parser.add_argument("--free", action="store_true", dest="unsupported", help=argparse.SUPPRESS)


def _verify(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", help="problems to run; all when left out")
    _check(parser, hidden=True)  # `verify` accepts the options that `check` has now
    parser.add_argument(
        "--problems", default="verification", metavar="DIR", help="folder of the problems"
    )
    parser.add_argument(
        "--update-baseline", action="store_true",
        help="store the results as the baseline of later runs",
    )  # fmt: skip
    _renamed(parser, "--record", "update_baseline", "store_true")
    parser.add_argument("--quick", action="store_true", help="coarse meshes only, within a minute")
    parser.add_argument("--report", metavar="DIR", help="write an HTML page and JSON there")
    stress = parser.add_argument_group("stress tests")
    stress.add_argument(
        "--stress", choices=("scenes", "inputs"), help="run random scenes, or damaged input files"
    )
    stress.add_argument("--count", type=int, metavar="N", help="how many; 2000 or 5000")
    stress.add_argument("--start", type=int, default=0, metavar="I", help="number of the first")
    stress.add_argument("--seed", type=int, default=1, help="of the random numbers")
    stress.add_argument("--only", type=int, metavar="I", help="number I of the seed alone")
    stress.add_argument("--processes", type=int, default=1, metavar="N", help="to work in")
    stress.add_argument("--out", metavar="DIR", help="with --only: write its files there")


def _check(parser: argparse.ArgumentParser, *, hidden: bool = False) -> None:
    def told(sentence: str) -> str:
        return argparse.SUPPRESS if hidden else sentence

    parser.add_argument("--element", help=told("element of the catalogue, or 'all'; default P2"))
    parser.add_argument("--material", help=told("material law, or 'all'; default isotropic"))
    parser.add_argument(
        "--integrator", help=told("time integrator, or 'all', instead of an element")
    )
    parser.add_argument(
        "--plane", choices=("strain", "stress"), default="strain",
        help=told("plane strain or stress"),
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], metavar="CONSTANT=VALUE", dest="settings",
        help=told('constant of the material law, as in --set youngs_modulus="3 kPa"'),
    )  # fmt: skip


def _upgrade(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("case", help="path of a case.toml, which is rewritten")


def _renamed(parser: argparse.ArgumentParser, old: str, target: str, action: str = "store") -> None:
    """Accept an option under its old name, which the help does not list."""
    suppressed = argparse.SUPPRESS
    parser.add_argument(old, dest=target, action=action, default=suppressed, help=suppressed)


def _study(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", help="name of the study; 'list' names them")
    _case(parser, optional=True)
    parser.add_argument("--against", metavar="CASE", help="second case of a study that needs one")
    _renamed(parser, "--on", "against")


def _bench(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("benchmark", help="name of the benchmark; 'list' names them")
    parser.add_argument(
        "case", nargs="?", default="", help="path of a case.toml, or of the reference problems"
    )
    parser.add_argument("--out", metavar="DIR", help="write JSON and charts there")
    parser.add_argument(
        "--against", metavar="CHECKOUT",
        help="compare the costs with those in another checkout of needlefem, in turn",
    )  # fmt: skip


def _info(parser: argparse.ArgumentParser) -> None:
    """``needlefem info`` has no options of its own."""


_OPTIONS = {
    "new": newoptions.add,
    "run": _run,
    "plan": _plan,
    "render": _render,
    "figures": _figures,
    "modes": _modes,
    "check": _check,
    "upgrade": _upgrade,
    "verify": _verify,
    "study": _study,
    "bench": _bench,
    "info": _info,
}

if __name__ == "__main__":
    sys.exit(main())
