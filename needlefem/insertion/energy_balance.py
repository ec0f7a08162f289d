"""The energy ledger: where the needle's work goes, every term from its own definition.

Work of the needle = strain energy + energy of the lateral hold + friction + cutting + snaps +
capture. All but the last are self-explanatory; capture is ``lateral force x gap / 2`` of
freshly cut material that the hold catches beside the axis: the tip follows the axis with its
kernel's mean, the shaft with its own line, and the hold closes the gap between the two. It is
negative, for it feeds the tissue, and below 0.1 % of the work on a resolved mesh.

Over a step from state 0 to state 1 the tip's dissipation is ``mean(R) e.dX`` plus the work of R
against the displacement gradient along dX. With the gradient part written as ``ubar(X1) -
ubar(X0)``, each field weighted by the other state's force, the ledger is an identity; with the
trapezoidal rule on ``e.grad(ubar) dX`` it closes to second order in each step. The first is the
default, the second an independent check of it.
"""

import numpy as np

from needlefem._arrays import Floats
from needlefem.insertion.fields import displacements, loads, means_of
from needlefem.insertion.result import EnergyTerms, Insertion, Rupture
from needlefem.insertion.state import State


# Kernel: energy balance of an insertion.
#     W = dE + dP + F + C + R + A
# W    work on the needle, sum of mean(force) ds, J (J/m in 2D)
# dE   strain energy, u1.K u1 / 2 - u0.K u0 / 2
# dP   lateral penalty, lambda^2 / (2 kappa w)
# F    friction, mean(t) (ds - du.e)
# C, R cutting and rupture: work of the tip force R against dX in the mean of both fields
# A    contact activation, lambda gap / 2 of new segments
# Source: definitions of the terms; docs/theory.md, equations (12) to (17).
def energy_terms(insertion: Insertion, *, trapezoidal: bool = False) -> EnergyTerms:
    """Return the energy ledger of an insertion; stepping keeps its own on the way.

    Parameters
    ----------
    insertion : Insertion
    trapezoidal : bool
        Integrate the gradient part of the tip's dissipation by the trapezoidal rule.
    """
    if insertion.energies is not None and not trapezoidal:
        return insertion.energies
    numbers = range(len(insertion.states))
    force = loads(insertion, numbers)
    moved = insertion.model.solve(force)
    energy = insertion.model.stiffness.energy(moved)
    along = _axial(insertion, moved)
    steps = [
        _Step(insertion, number, moved[:, number : number + 2], along[:, number : number + 2])
        for number in range(len(insertion.states) - 1)
    ]
    works = [step.work for step in steps]
    work, turnover = float(sum(works)), float(np.abs(works).sum())
    on_tissue = 0.5 * np.einsum("ij,ij->j", force[:, 1:] + force[:, :-1], np.diff(moved, axis=1))
    tip = [step.tip(trapezoidal=trapezoidal) for step in steps]
    rubbed = [step.friction() for step in steps]
    taken = [(f, c, s, f + c + s) for f, (c, s) in zip(rubbed, tip, strict=True)]
    return EnergyTerms(
        work=work,
        strain=float(energy[-1] - energy[0]),
        hold=_hold(insertion, insertion.states[-1]) - _hold(insertion, insertion.states[0]),
        friction=float(sum(rubbed)),
        cutting=float(sum(pair[0] for pair in tip)),
        snap=float(sum(pair[1] for pair in tip)),
        capture=float(sum(step.capture() for step in steps)),
        turnover=turnover,
        least=min((min(parts) for parts in taken), default=0.0),
        identity=float(np.max(np.abs(np.diff(energy) - on_tissue)) / work) if work else 0.0,
    )


def released(insertion: Insertion, snap: Rupture) -> float:
    """Return the energy that a snap of a march set free, J (J/m in 2D)."""
    moved = displacements(insertion, range(snap.first, snap.last + 1))
    along = np.zeros((0, moved.shape[1]))  # of the tip's work alone
    steps = [
        _Step(insertion, snap.first + n, moved[:, n : n + 2], along[:, n : n + 2])
        for n in range(snap.last - snap.first)
    ]
    return float(sum(step.tip(trapezoidal=False)[1] for step in steps))


def _axial(insertion: Insertion, moved: Floats) -> Floats:
    """Return the mean axial displacement of all pieces in all states, shape (npieces, nstates)."""
    pieces, model = insertion.pieces, insertion.model
    if not pieces:
        return np.zeros((0, moved.shape[1]))
    nodes, means = means_of(pieces)
    dofs, direction = model.node_dofs[nodes], insertion.axis.direction
    found: Floats = means @ sum(moved[dofs[:, i]] * direction[i] for i in range(model.dim))
    return found


def _hold(insertion: Insertion, state: State) -> float:
    compliance = np.array(
        [piece.compliance for piece in insertion.pieces[: len(state.friction_force)]]
    )
    return 0.5 * float(compliance @ np.sum(state.lateral_force**2, axis=1))


class _Step:
    """One step between states `number` and `number + 1`.

    `moved` are all dofs in both, `along` the pieces' axial displacements.
    """

    def __init__(self, insertion: Insertion, number: int, moved: Floats, along: Floats) -> None:
        self._along = along
        self.insertion, model = insertion, insertion.model
        self.old, self.new = insertion.states[number], insertion.states[number + 1]
        self.fields = [model.nodal(moved[:, 0]), model.nodal(moved[:, 1])]
        self.travel = self.new.depth - self.old.depth

    @property
    def work(self) -> float:
        return 0.5 * (self.old.force + self.new.force) * self.travel

    def _moved(self, number: int) -> Floats:
        """Displacement of a piece in both states in the needle's frame, shape (2, dim)."""
        piece = self.insertion.pieces[number]
        means = [piece.weights @ field[piece.nodes] for field in self.fields]
        return np.array(means) @ self.insertion.axis.frame.T

    def friction(self) -> float:
        """Mean traction times relative slip of all pieces."""
        count = len(self.new.friction_force)
        pull = self.new.friction_force.copy()
        pull[: len(self.old.friction_force)] += self.old.friction_force
        slip = self.travel - np.diff(self._along[:count], axis=1)[:, 0]
        return 0.5 * float(pull @ slip)

    def capture(self) -> float:
        """Work of the hold on the newest pieces, counted as spent (see the module)."""
        total = 0.0
        for number in range(len(self.old.friction_force), len(self.new.friction_force)):
            gap = self.insertion.pieces[number].offset + self._moved(number)[0, 1:]
            total += 0.5 * float(self.new.lateral_force[number] @ gap)
        return total

    def tip(self, *, trapezoidal: bool) -> tuple[float, float]:
        """Dissipation at the tip: of cutting, and of the excess force while it jumps."""
        gain = self._gradient_part() if trapezoidal else self._difference_part()
        ahead = float(self.insertion.axis.direction @ (self.new.tip - self.old.tip))
        cutting = np.array([self.old.cutting_force, self.new.cutting_force])
        force = np.array([self.old.tip_force, self.new.tip_force])
        excess = force - cutting
        if not np.any(self.old.tip != self.new.tip):
            return 0.0, 0.0
        spent = [0.5 * float(r.sum() * ahead + r @ gain) for r in (cutting, excess)]
        return spent[0], spent[1]

    def _difference_part(self) -> Floats:
        """``e.(ubar(X1) - ubar(X0))`` in the new field (for the old force) and the old one."""
        direction, (old, new) = self.insertion.axis.direction, (self.old, self.new)
        ahead = [
            (new.tip_weights @ field[new.tip_nodes] - old.tip_weights @ field[old.tip_nodes])
            @ direction
            for field in self.fields
        ]
        return np.array(ahead[::-1], dtype=float)

    def _gradient_part(self) -> Floats:
        """``e.grad(ubar) dX`` at the old and the new tip, each in its own field."""
        path = self.new.tip - self.old.tip
        length = float(np.linalg.norm(path))
        direction = self.insertion.axis.direction
        rates = []
        for state, field in zip((self.old, self.new), self.fields, strict=True):
            small = 1e-3 * path
            mean = self.insertion.instrument.tip
            ahead, behind = mean(state.tip + small), mean(state.tip - small)
            rates.append(float((ahead.of(field) - behind.of(field))[0] @ direction) / 2e-3)
        return np.array(rates) if length else np.zeros(2)
