"""The needle: insertion axis, tip kernel, properties along the cut path, and clearances."""
