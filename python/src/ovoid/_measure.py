"""How well a model stands for a molecule."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

from . import _abi
from ._abi import lib
from ._context import ProgressLike
from ._field import Field
from ._mesh import Distances, distances_of


@dataclass(frozen=True)
class Pair:
    """A quantity of both surfaces.

    Attributes
    ----------
    original : float
        Of the molecule.
    model : float
        Of the model.
    error : float
        abs(model - original) / original.
    """

    original: float
    model: float
    error: float


@dataclass(frozen=True)
class Measures:
    """Areas, volumes and distances of a molecule's surface and a model's.

    Attributes
    ----------
    area, volume : Pair
        Of the whole surfaces (Å², Å³).
    area_outer, volume_outer : Pair
        Without the walls of cavities.
    pieces, pieces_outer : (int, int)
        Connected pieces of the molecule's surface, and of the model's.
    distances, distances_outer : Distances
        Of the whole surfaces, and without the walls of cavities.
    deviation : float
        Largest distance of a point of either outer surface from the other whole surface (Å): what
        a tolerance is about.
    deviation_bound : float
        No point of either outer surface's mesh, between vertices too, is farther than this from
        the other whole mesh (Å); nan of large surfaces, which are measured cell by cell.
    """

    area: Pair
    volume: Pair
    area_outer: Pair
    volume_outer: Pair
    pieces: tuple[int, int]
    pieces_outer: tuple[int, int]
    distances: Distances
    distances_outer: Distances
    deviation: float
    deviation_bound: float

    @property
    def hausdorff(self) -> float:
        """Hausdorff distance of the whole surfaces (Å)."""
        return self.distances.hausdorff

    @property
    def mean(self) -> float:
        """Mean distance of the whole surfaces (Å)."""
        return self.distances.mean


def _pair(raw: Any) -> Pair:
    return Pair(raw.original, raw.sparse, raw.error)


def measure_fields(
    original: Field,
    model: Field,
    spacing: float,
    isovalue: float | None,
    vertices: str,
    distances: bool,
    progress: ProgressLike,
) -> Measures:
    from ._fit import choice

    options = _abi.filled(
        _abi.MeasureOptions,
        spacing=spacing,
        isovalue=isovalue,
        vertices=choice(vertices, ("exact", "linear"), "vertices"),
        distances=distances,
    )
    raw = _abi.filled(_abi.Measures)
    with original.context._watching(progress):
        original.context._call(
            lib.measure,
            original._pointer,
            model._pointer,
            ctypes.byref(options),
            ctypes.byref(raw),
            needs_device=True,
        )
    return Measures(
        area=_pair(raw.area),
        volume=_pair(raw.volume),
        area_outer=_pair(raw.area_outer),
        volume_outer=_pair(raw.volume_outer),
        pieces=(raw.components_original, raw.components_sparse),
        pieces_outer=(raw.outer_original, raw.outer_sparse),
        distances=distances_of(raw.distances),
        distances_outer=distances_of(raw.distances_outer),
        deviation=raw.deviation,
        deviation_bound=raw.deviation_bound,
    )
