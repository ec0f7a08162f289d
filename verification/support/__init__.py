"""Models and closed forms that several reference problems use."""
