"""The figures of Alterovitz et al. 2003, drawn from our own answers, beside the paper's numbers."""
