"""needlefem: needle insertion into soft tissue by finite elements, simulated and planned.

The public names below are imported when first used, so that ``import needlefem`` is cheap.
"""

import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.api import build_model, plan, simulate
    from needlefem.casefile.load import load_case
    from needlefem.io.saved_result import load_result
    from needlefem.plotting.render import render

__version__ = "0.1.0"
__all__ = [
    "__version__",
    "build_model",
    "load_case",
    "load_result",
    "plan",
    "render",
    "simulate",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        **{
            "api": "build_model plan simulate",
            "casefile.load": "load_case",
            "io.saved_result": "load_result",
            "plotting.render": "render",
        },
    )

_SHOWN_IN_NOTEBOOKS = (
    ("needlefem.scene.schema", "Scene"),
    ("needlefem.insertion.result", "Insertion"),
    ("needlefem.planning.result", "Plan"),
    ("needlefem.io.saved_result", "SavedResult"),
)


if TYPE_CHECKING:

    class _Formatter(Protocol):
        """A `DisplayFormatter` of IPython for one kind of content."""

        def for_type_by_name(
            self, module: str, name: str, show: Callable[[object], str | bytes | None], /
        ) -> object: ...

    class _Formatters(Protocol):
        """The formatters of IPython by the kind of their content."""

        formatters: Mapping[str, _Formatter]

    class _Shell(Protocol):
        """An `InteractiveShell` of IPython."""

        display_formatter: _Formatters


def _html_of(result: object) -> str:
    from needlefem.plotting.notebook import html_of  # noqa: PLC0415  (in notebooks only)

    return html_of(result)


def _png_of(result: object) -> bytes | None:
    from needlefem.plotting.notebook import png_of  # noqa: PLC0415  (in notebooks only)

    return png_of(result)


def _register_formatters(shell: "_Shell") -> None:
    """Register an IPython formatter that shows scenes and results as a table with a picture."""
    formatters = shell.display_formatter.formatters
    for module, name in _SHOWN_IN_NOTEBOOKS:
        formatters["text/html"].for_type_by_name(module, name, _html_of)
        formatters["image/png"].for_type_by_name(module, name, _png_of)


if "IPython" in sys.modules and (_shell := sys.modules["IPython"].get_ipython()) is not None:
    _register_formatters(_shell)
