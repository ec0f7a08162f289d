"""The tissue of an insertion as VTU files in order of time, for ParaView and PyVista."""

from pathlib import Path

import numpy as np

from needlefem.fem.recovery import CellFields
from needlefem.insertion.result import Insertion
from needlefem.io.result_folder import ours, result_folder, writing
from needlefem.io.vtu import write_pvd, write_vtu
from needlefem.plotting.timeline import Timeline
from needlefem.scene.limits import check_count

DIGITS = 4
"""Of the numbers in file names."""


def write_snapshots(insertion: Insertion, folder: str | Path, count: int) -> Path:
    """Write moments evenly spaced in time; return the PVD file that lists them.

    ``insertion.pvd`` names the files ``insertion/0000.vtu`` and so on relative to itself. Each
    holds ``displacement`` (m) of the nodes, and of the cells ``largest_strain`` (1), the
    principal strain that is largest without its sign, and ``material``, its number.

    Parameters
    ----------
    insertion : Insertion
    folder : str or Path
    count : int
        At least two.
    """
    film, model, folder = Timeline(insertion), insertion.model, Path(folder)
    values = CellFields(model)
    written = []
    check_count(count, "snapshots", insertion.scene.limits)
    times = np.linspace(0.0, float(film.times[-1]), max(count, 2))
    with result_folder(folder, "run", "folder"):
        _remove_older(folder)
        for number, moment in enumerate(film.moments(times)):
            file = folder / "insertion" / f"{number:0{DIGITS}d}.vtu"
            cells = {
                "largest_strain": values.largest_strain(moment.u),
                "material": model.cell_materials.astype(np.int32),
            }
            write_vtu(file, model, {"displacement": model.nodal(moment.u)}, cells)
            written.append((moment.time, file))
        path = folder / "insertion.pvd"
        write_pvd(path, written)
    return path


def _remove_older(folder: Path) -> None:
    """Remove the snapshots that a file of an earlier call lists."""
    path = folder / "insertion.pvd"
    if path.is_file():
        with writing(folder):
            path.unlink()
            for file in ours(folder, "run"):
                if file.endswith(".vtu"):
                    (folder / file).unlink()
