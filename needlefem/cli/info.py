"""``needlefem info``: versions, machine, threads, renderer."""

import argparse
import os
import platform
from importlib import metadata
from typing import TypedDict

from needlefem import __version__
from needlefem.cli.common import say, say_json
from needlefem.errors import NoRendererError
from needlefem.plotting.images import renderer

PACKAGES = (
    "numpy", "scipy", "scikit-fem", "meshio", "pyvista", "vtk", "SimpleITK", "contourpy",
    "scikit-sparse",
)  # fmt: skip
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Machine(TypedDict):
    """Versions by package (None: not installed), machine and threads."""

    needlefem: str
    python: str
    packages: dict[str, str | None]
    system: str
    processor: str
    cores: int
    memory: float
    threads: dict[str, str | None]


class Info(Machine):
    """`Machine` with the window class and the driver of the renderer, or why there is none."""

    renderer: dict[str, str | None]


def info() -> Info:
    """Return versions by package (None: not installed), machine, threads and renderer.

    The renderer is tried, in a process of its own: this takes seconds.
    """
    return {**machine(), "renderer": _renderer()}


def machine() -> Machine:
    """Return versions by package (None: not installed), machine and threads."""
    return {
        "needlefem": __version__,
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in PACKAGES},
        "system": f"{platform.system()} {platform.release()}",
        "processor": platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "memory": _memory(),
        "threads": {name: os.environ.get(name) for name in THREADS},
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _memory() -> float:
    """Return the machine's memory, bytes."""
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _renderer() -> dict[str, str | None]:
    """Return what draws, or the sentence that says why nothing does."""
    try:
        pv = renderer()
    except NoRendererError as error:
        return {"window": None, "driver": None, "problem": str(error)}
    driver = pv.GPUInfo()
    return {
        "window": os.environ["VTK_DEFAULT_OPENGL_WINDOW"],
        "driver": f"{driver.renderer}, OpenGL {driver.version}",
        "problem": None,
    }


def lines(found: Info) -> list[str]:
    """Return the record of `info` as two lines of text."""
    versions = [f"needlefem {found['needlefem']}", f"Python {found['python']}"]
    versions += [f"{name} {v or 'not installed'}" for name, v in found["packages"].items()]
    threads = ", ".join(f"{name}={v}" for name, v in found["threads"].items() if v is not None)
    machine = (
        f"{found['system']} {found['processor']}, {found['cores']} cores, "
        f"{found['memory'] / 2**30:.1f} GiB; threads: {threads or 'as many as there are cores'}"
    )
    drawn = found["renderer"]
    pictures = drawn["problem"] or f"pictures by {drawn['window']} ({drawn['driver']})"
    return [", ".join(versions), f"{machine}; {pictures}"]


# ``needlefem info``.


def main(options: argparse.Namespace) -> int:
    """Print what is installed and what this runs on; return the exit status."""
    found = info()
    if options.json:
        say_json(found)
    else:
        say("\n".join(lines(found)))
    return 0
