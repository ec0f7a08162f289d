"""The public functions that take a scene or the path of a case file."""

from pathlib import Path

from numpy.typing import ArrayLike

from needlefem._arrays import SkfemMesh
from needlefem.casefile.load import load_case
from needlefem.errors import CaseError, short
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion import simulation
from needlefem.insertion.insertion_run import SaveAt
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Watch
from needlefem.planning import plan as planning
from needlefem.planning.result import Plan
from needlefem.scene import Scene, build


def scene_of(case: Scene | str | Path) -> Scene:
    """Return a scene as it is, or that of a case file.

    Raises
    ------
    CaseError
        Neither a scene nor a path, or a case that can't be used.
    """
    if isinstance(case, Scene):
        return case
    if isinstance(case, str | Path):
        return load_case(case)
    raise CaseError(
        "case", f"{short(case)} is not a scene", "give a Scene or the path of a case.toml"
    )


def simulate(case: Scene | str | Path, save: SaveAt | None = None) -> Insertion:
    """Simulate the motion of a scene's needle at its entry.

    Parameters
    ----------
    case : Scene, str or Path
        A scene, or the path of a case file.
    save : SaveAt, optional
        Which states are kept, and whether they hold the displacement of the tissue.

    Returns
    -------
    Insertion
        The result so far. Its status states why a motion ended early.

    Raises
    ------
    CaseError
        The scene is not valid, or its entry is missing or not on the skin.
    CheckFailedError
        The discretisation, or the needle in it, fails a check; no insertion is simulated.
    """
    return simulation.simulate(scene_of(case), save)


def plan(
    case: Scene | str | Path,
    target: ArrayLike | None = None,
    search: str | None = None,
    *,
    all_solutions: bool = False,
    watch: Watch | None = None,
) -> Plan:
    """Find the release point from which a seed, biopsy or injection ends on the target.

    If obstacles block all offsets with a solution, the scene's further directions are tried in
    turn. The result is the first successful plan, or else the one with the smallest error.

    Parameters
    ----------
    case : Scene, str or Path
        A scene, or the path of a case file.
    target : array, list or tuple, shape (dim,), m, optional
        By default the target of the case.
    search : str, optional
        ``"root"`` of the signed lateral error; ``"golden"`` section on the error, as in the paper
        (R. Alterovitz et al., IROS 2003, section V.C); ``"grid"`` if the error is not unimodal. By
        default the choice of the case.
    all_solutions : bool
        Also search the range for further lateral offsets whose error is zero.
    watch : callable, optional
        Called with each state of each insertion.

    Raises
    ------
    CaseError
        The scene is not valid, or the target is missing or outside of the tissue.
    CheckFailedError
        The discretisation fails a check; no insertion is simulated.
    """
    scene = scene_of(case)
    return planning.plan(scene, target, search, all_solutions=all_solutions, watch=watch)


def build_model(
    case: Scene | str | Path, mesh: SkfemMesh | None = None, *, floating: bool = False
) -> TissueModel:
    """Return the discretised tissue of a scene.

    Parameters
    ----------
    case : Scene, str or Path
        A scene, or the path of a case file. An element that is left open is resolved.
    mesh : skfem.Mesh, optional
        An existing mesh of the scene.
    floating : bool
        Omit the supports.

    Raises
    ------
    CaseError
        The scene is not valid.
    """
    return build.build_model(scene_of(case), mesh, floating=floating)
