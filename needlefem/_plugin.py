"""Code of the user, named ``module:Name``; it is imported only with the user's permission."""

import importlib
import sys
from pathlib import Path

from needlefem.errors import CaseError

_allowed = False


def allow() -> None:
    """Permit cases to name code of the user (``--allow-code``)."""
    global _allowed  # noqa: PLW0603  (the permission belongs to the process)
    _allowed = True


def is_foreign(name: str) -> bool:
    """Return whether a name has the form ``module:Name``."""
    return ":" in name


def load(name: str, key: str) -> object:
    """Import ``module:Name`` from the working directory or an installed package.

    Raises
    ------
    CaseError
        The permission is missing, or the module or name does not exist.
    """
    if not _allowed:
        remedy = "pass --allow-code if you trust it (or call needlefem._plugin.allow())"
        raise CaseError(key, f"'{name}' is code, which is not run unasked", remedy)
    module, _, attribute = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        return getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        remedy = "run where it is, or install it"
        raise CaseError(key, f"'{name}': {error}", remedy) from None
    except AttributeError:
        raise CaseError(key, f"no '{attribute}' in '{module}'", "correct the name") from None
