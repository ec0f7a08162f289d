"""The public functions that take a scene or the path of a case file."""

from pathlib import Path
from typing import Any

from needlefem._arrays import SkfemMesh
from needlefem.casefile.load import load_case
from needlefem.errors import CaseError, short
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion import simulation
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
    raise CaseError("case", f"{short(case)} is no scene", "give a Scene or the path of a case.toml")


def simulate(case: Scene | str | Path) -> Insertion:
    """Let the needle of a scene do what its motion says, at its entry.

    Parameters
    ----------
    case : Scene, str or Path
        A scene, or the path of a case file.

    Returns
    -------
    Insertion
        With the path so far, and a status that says why, where the needle could not go on.

    Raises
    ------
    CaseError
        The scene can't be built, or its entry is missing or misses the skin.
    CheckFailedError
        The discretisation, or the needle in it, fails a check: nothing is simulated on it.
    """
    return simulation.simulate(scene_of(case))


def plan(
    case: Scene | str | Path,
    target: Any = None,
    search: str | None = None,
    *,
    all_solutions: bool = False,
    watch: Watch | None = None,
) -> Plan:
    """Find the release point from which a seed, biopsy or injection ends on the target.

    Where obstacles leave no height that hits, the scene's further directions are tried in turn; the
    first along which a plan succeeds wins, or else that with the least error.

    Parameters
    ----------
    case : Scene, str or Path
        A scene, or the path of a case file.
    target : array, list or tuple, shape (dim,), m, optional
        The case's own target when left out.
    search : str, optional
        ``"root"`` of the signed lateral miss; ``"golden"`` section on the error, as in the paper
        (R. Alterovitz et al., IROS 2003, section V.C); ``"grid"`` where the error is not
        unimodal. The case's choice when left out.
    all_solutions : bool
        Also scan the range for further heights that hit the target.
    watch : callable, optional
        Called with every state of every insertion.

    Raises
    ------
    CaseError
        The scene can't be built, or the target is missing or outside the tissue.
    CheckFailedError
        The discretisation fails a check: nothing is planned on it.
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
        A scene, or the path of a case file; its element is chosen where it is left open.
    mesh : skfem.Mesh, optional
        The scene's, when it is there already.
    floating : bool
        Without its supports.

    Raises
    ------
    CaseError
        The scene can't be built.
    """
    return build.build_model(scene_of(case), mesh, floating=floating)
