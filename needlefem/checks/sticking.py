"""Whether the tissue can tell apart what sticks to the needle."""

from needlefem.checks.result import CheckResult
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.sticking import STICK_CONDITION


def sticking_pieces(simulation: Simulation) -> CheckResult:
    """Check that the forces on segments of the path are determined when all of them stick.

    The condition of their axial response along the case's own line is found, as deep as the
    motion goes, with the tangential penalty that the simulation uses.

    Raises
    ------
    CaseError
        The scene's own penalty is too stiff for the mesh.
    """
    return CheckResult(
        name="sticking pieces",
        requirement="segments of the path are long enough, or needle.stick_stiffness is small "
        "enough, for the mesh to tell their sticking apart",
        value=simulation.sticking(simulation.entry_of_case()).condition,
        bound=STICK_CONDITION,
    )
