"""Case files; see `load`."""
