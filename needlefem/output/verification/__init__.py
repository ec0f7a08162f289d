"""The report of the verification suite."""
