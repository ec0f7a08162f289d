"""Public names of a package, whose modules are imported when a name is first used.

Each folder of the package names its interface in ``__init__.py``: in ``__all__``, for a reader;
in imports under ``TYPE_CHECKING``, for type checkers and editors; and in the table that
`lazy_exports` takes, for the interpreter. ``tests/test_public_surface.py`` compares the three.
"""

import sys
from collections.abc import Callable
from importlib import import_module


def lazy_exports(
    package: str, **names: str
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return the functions ``__getattr__`` and ``__dir__`` of a package.

    Parameters
    ----------
    package : str
        Its name, ``__name__``.
    **names : str
        The names that a module exports, with spaces between them, by the module's name in the
        package.

    Returns
    -------
    tuple of two callables
        The first imports the module of a name and returns what the name stands for; it raises
        AttributeError for every other name. The second lists the package's ``__all__``.
    """
    homes = {name: module for module, text in names.items() for name in text.split()}

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        # not kept in the package: a name always is what its module says, also in a test that
        # replaces it there for a while
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    def public_names() -> list[str]:
        return sorted(sys.modules[package].__all__)

    return get, public_names
