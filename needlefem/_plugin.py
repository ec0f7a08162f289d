"""Code of the user's, named as ``module:Name``; imported only when that was allowed."""

import importlib
import sys
from pathlib import Path
from typing import Any

from needlefem.errors import CaseError

_allowed = False


def allow() -> None:
    """Allow cases to name code of the user's (``--allow-code``)."""
    global _allowed  # noqa: PLW0603  (a permission of the process, given once by the user)
    _allowed = True


def is_foreign(name: str) -> bool:
    """Say whether a name is ``module:Name``."""
    return ":" in name


def load(name: str, key: str) -> Any:
    """Import ``module:Name``, from the working directory or what is installed.

    Raises
    ------
    CaseError
        It was not allowed, or there is no such module or name.
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
