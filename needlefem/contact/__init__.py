"""Contact of needle and tissue: functionals, condensed equations, friction."""
