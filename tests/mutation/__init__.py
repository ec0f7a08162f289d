"""Measurement of the tests by wrong changes to the source."""
