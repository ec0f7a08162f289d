"""Results in notebooks: a table, and a picture where one can be drawn."""

from importlib import import_module


class Shown:
    """Gives a result the methods that notebooks ask for.

    What they say is `needlefem.plotting.notebook`'s, imported only when a notebook asks.
    """

    def _repr_html_(self) -> str:
        """Return the result as a small HTML table."""
        return str(import_module("needlefem.plotting.notebook").html_of(self))

    def _repr_png_(self) -> bytes | None:
        """Return a picture as PNG, or None where nothing can draw."""
        found: bytes | None = import_module("needlefem.plotting.notebook").png_of(self)
        return found
