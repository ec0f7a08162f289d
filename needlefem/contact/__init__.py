"""Contact between needle and tissue: linear functionals, condensed equations, friction."""
