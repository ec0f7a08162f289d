"""The method of Alterovitz et al. (IROS 2003), from which the project started."""
