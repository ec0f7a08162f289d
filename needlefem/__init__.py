"""needlefem: needle insertion into soft tissue by finite elements, simulated and planned.

The public names below are imported when first used, so that ``import needlefem`` is cheap.
"""

import sys
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


_SHOWN_IN_NOTEBOOKS = (
    ("needlefem.scene.schema", "Scene"),
    ("needlefem.insertion.result", "Insertion"),
    ("needlefem.planning.result", "Plan"),
    ("needlefem.io.saved_result", "SavedResult"),
)


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'needlefem' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])


def _html_of(result: Any) -> str:
    from needlefem.plotting.notebook import html_of  # noqa: PLC0415  (in notebooks only)

    return html_of(result)


def _png_of(result: Any) -> bytes | None:
    from needlefem.plotting.notebook import png_of  # noqa: PLC0415  (in notebooks only)

    return png_of(result)


def _register_formatters(shell: Any) -> None:
    """Let an IPython shell show scenes and results as a table, with a picture if it can draw."""
    formatters = shell.display_formatter.formatters
    for module, name in _SHOWN_IN_NOTEBOOKS:
        formatters["text/html"].for_type_by_name(module, name, _html_of)
        formatters["image/png"].for_type_by_name(module, name, _png_of)


if "IPython" in sys.modules and (_shell := sys.modules["IPython"].get_ipython()) is not None:
    _register_formatters(_shell)
