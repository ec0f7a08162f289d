"""needlefem: needle insertion into soft tissue by finite elements, simulated and planned.

The public names below are imported when first used, so that ``import needlefem`` is cheap.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from needlefem.api import build_model, plan, simulate
    from needlefem.casefile.load import load_case
    from needlefem.io.saved_result import load_result
    from needlefem.plotting.render import render

__version__ = "0.1.0"
__all__ = ["build_model", "load_case", "load_result", "plan", "render", "simulate"]

_HOMES = {
    "build_model": "needlefem.api",
    "load_case": "needlefem.casefile.load",
    "load_result": "needlefem.io.saved_result",
    "simulate": "needlefem.api",
    "plan": "needlefem.api",
    "render": "needlefem.plotting.render",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'needlefem' has no attribute '{name}'")
