"""Studies that prove this package."""
