"""Reference problems, studies and benchmarks that prove this package."""
