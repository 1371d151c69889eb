"""Analyses for MDAnalysis: ``from ovoid.mdanalysis import FitAnalysis, SurfaceAnalysis``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from MDAnalysis.analysis.base import AnalysisBase

from ._context import Context
from ._objects import molecule
from ._options import SurfaceOptions, spelled_out
from ._surface import SPACING
from ._trajectory import Fits, Surfaces, columns

if TYPE_CHECKING:
    from typing_extensions import Unpack


class SurfaceAnalysis(AnalysisBase):  # type: ignore[misc]
    """Area and volume of the Gaussian surface in each frame.

    Parameters
    ----------
    atoms : AtomGroup
    radii : optional
        As `ovoid.molecule` takes them.
    decay, isovalue, spacing, vertices, context : optional
        As `ovoid.measure_trajectory` takes them.

    Attributes
    ----------
    results : MDAnalysis.analysis.results.Results
        ``area`` (Å²), ``volume`` (Å³), ``pieces`` and ``seconds``, arrays of shape (frames,).

    Examples
    --------
    >>> surfaces = SurfaceAnalysis(universe.select_atoms("protein")).run()     # doctest: +SKIP
    >>> surfaces.results.area                                                  # doctest: +SKIP
    """

    def __init__(
        self,
        atoms: Any,
        *,
        radii: Any = None,
        decay: float | None = None,
        isovalue: float | None = None,
        spacing: float = SPACING,
        vertices: str = "exact",
        context: Context | None = None,
        **others: Any,
    ) -> None:
        super().__init__(atoms.universe.trajectory, **others)
        self._group = atoms.atoms
        self._radii = radii
        self._options = {"decay": decay, "isovalue": isovalue, "spacing": spacing}
        self._more = {"vertices": vertices, "context": context}

    def _prepare(self) -> None:
        first = molecule(self._group, radii=self._radii)
        self._steps: Any = Surfaces(first, **self._options, **self._more)  # type: ignore[arg-type]
        self._rows: list[dict[str, Any]] = []

    def _single_frame(self) -> None:
        self._rows.append(self._steps.step(self._group.positions))

    def _conclude(self) -> None:
        self.results.update(columns(self._rows, self._steps.names))


class FitAnalysis(SurfaceAnalysis):
    """A model for each frame, each beginning with the one before.

    Parameters
    ----------
    atoms : AtomGroup
    tolerance, ellipsoids, ratio, radii, fresh_every, measure, keep_models, effort, context
        As `ovoid.fit_trajectory` takes them.
    **surface
        decay, isovalue, spacing, padding and mesh_spacing, as there.

    Attributes
    ----------
    results : MDAnalysis.analysis.results.Results
        The columns of `ovoid.FitTrajectory`, arrays of shape (frames,), and ``models``, a list.
    """

    @spelled_out(SurfaceOptions)
    def __init__(
        self,
        atoms: Any,
        tolerance: float | None = None,
        ellipsoids: int | None = None,
        ratio: float | None = None,
        *,
        radii: Any = None,
        fresh_every: int = 0,
        measure: bool = True,
        keep_models: bool = True,
        effort: int | None = None,
        context: Context | None = None,
        verbose: bool = False,
        **surface: Unpack[SurfaceOptions],
    ) -> None:
        super().__init__(atoms, radii=radii, context=context, verbose=verbose)
        goal = {"tolerance": tolerance, "ellipsoids": ellipsoids, "ratio": ratio, "effort": effort}
        self._fits = {"goal": goal, "surface": surface, "fresh_every": fresh_every}
        self._fits.update(measure=measure, keep_models=keep_models, context=context)

    def _prepare(self) -> None:
        first = molecule(self._group, radii=self._radii)
        self._steps = Fits(first, **self._fits)  # type: ignore[arg-type]
        self._rows = []

    def _conclude(self) -> None:
        super()._conclude()
        self.results.models = self._steps.models
