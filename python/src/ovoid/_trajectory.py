"""Molecules in motion: surfaces and models, frame after frame."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._context import Context, default_context
from ._field import Field
from ._fit import Fitter
from ._measure import measure_fields
from ._mesh import mesh_field
from ._model import Model
from ._molecule import Molecule
from ._objects import _READERS, molecule
from ._options import SurfaceOptions, spelled_out
from ._surface import SPACING
from ._views import Doubles, doubles
from .errors import ArgumentError

if TYPE_CHECKING:
    from typing_extensions import Unpack

Frame = tuple[int, float, Any]  # number, time (ps, NaN unknown), coordinates (Å)


class _Table:
    """Arrays of one length, by name."""

    def as_dict(self) -> dict[str, Any]:
        """The arrays by their names."""
        made = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        return {name: column for name, column in made.items() if isinstance(column, np.ndarray)}

    def to_dataframe(self) -> Any:
        """A `pandas.DataFrame` with a row for each frame."""
        import pandas

        return pandas.DataFrame(self.as_dict()).set_index("frame")

    def __len__(self) -> int:
        """How many frames there are."""
        return len(next(iter(self.as_dict().values())))


@dataclass(frozen=True, repr=False)
class SurfaceTrajectory(_Table):
    """Surfaces of a trajectory. All are arrays of shape (frames,).

    Attributes
    ----------
    frame : ndarray of int
    time : ndarray
        ps; NaN where it is not known.
    area, volume : ndarray
        Of the whole surface (Å², Å³).
    pieces : ndarray of int
        Connected pieces of the surface.
    seconds : ndarray
        That each frame took.
    """

    frame: npt.NDArray[np.int64]
    time: Doubles
    area: Doubles
    volume: Doubles
    pieces: npt.NDArray[np.int64]
    seconds: Doubles

    def __repr__(self) -> str:
        return f"<ovoid.SurfaceTrajectory of {len(self)} frames>"


@dataclass(frozen=True, repr=False)
class FitTrajectory(_Table):
    """Models along a trajectory. All but `models` are arrays of shape (frames,).

    Attributes
    ----------
    frame : ndarray of int
    time : ndarray
        ps; NaN where it is not known.
    area, volume, model_area, model_volume : ndarray
        Of the molecule's surface and the model's (Å², Å³); NaN where they were not measured.
    ellipsoids : ndarray of int
    deviation : ndarray
        Largest distance between the outer surfaces (Å).
    reached : ndarray of bool
        The goal.
    fresh_ellipsoids, fresh_deviation : ndarray
        Of a fit from the atoms, where there was one; else NaN.
    seconds, fresh_seconds : ndarray
        That the frame's fit took, and the fresh one.
    models : list of Model
        One for each frame. Empty where they were not to be kept.
    """

    frame: npt.NDArray[np.int64]
    time: Doubles
    area: Doubles
    volume: Doubles
    model_area: Doubles
    model_volume: Doubles
    ellipsoids: npt.NDArray[np.int64]
    deviation: Doubles
    reached: npt.NDArray[np.bool_]
    fresh_ellipsoids: Doubles
    fresh_deviation: Doubles
    seconds: Doubles
    fresh_seconds: Doubles
    models: list[Model]

    def __repr__(self) -> str:
        return f"<ovoid.FitTrajectory of {len(self)} frames>"


_KINDS = {"frame": np.int64, "ellipsoids": np.int64, "pieces": np.int64, "reached": np.bool_}


def columns(rows: list[dict[str, Any]], names: list[str]) -> dict[str, Any]:
    """Arrays of what each row has under these names."""
    return {
        name: np.array([row[name] for row in rows], _KINDS.get(name, np.float64)) for name in names
    }


# ---- frames -------------------------------------------------------------------------------------


def _package(source: Any) -> str:
    for base in type(source).__mro__:
        package = (base.__module__ or "").partition(".")[0]
        if package in _READERS:
            return package
    return ""


def _arrays(source: Any, atoms: Molecule | None, radii: Any) -> tuple[Molecule, Any]:
    places = np.asarray(source)
    if places.ndim != 3 or places.shape[2] != 3:
        raise ArgumentError(
            f"coordinates of a trajectory have the shape (frames, atoms, 3), not {places.shape}"
        )
    if len(places) == 0:
        raise ArgumentError("the trajectory has no frame")
    if atoms is None:
        if radii is None:
            raise ArgumentError("coordinates alone need radii=, or the molecule as atoms=")
        atoms = Molecule(places[0], radii)
    if len(atoms) != places.shape[1]:
        raise ArgumentError(f"the molecule has {len(atoms)} atoms, a frame {places.shape[1]}")
    return atoms, places


def _frames(
    source: Any, atoms: Molecule | None, radii: Any, frames: slice
) -> tuple[Molecule, int, Iterator[Frame]]:
    """The molecule, how many frames there are, and the frames."""
    package = _package(source)
    if package == "MDAnalysis":
        group = source.atoms
        part = group.universe.trajectory[frames]
        if len(part) == 0:
            raise ArgumentError("the trajectory has no such frame")
        part[0]
        first = atoms or molecule(group, radii=radii)
        moving = ((int(ts.frame), float(ts.time), group.positions) for ts in part)
        return first, len(part), moving
    if package == "mdtraj":
        numbers = range(*frames.indices(len(source)))
        first = atoms or molecule(source, radii=radii)
        moving = ((i, float(source.time[i]), 10.0 * source.xyz[i]) for i in numbers)
        return first, len(numbers), moving
    if package:
        if package != "biotite" or np.ndim(source.coord) != 3:
            raise TypeError(f"a {type(source).__name__} of {package} is no trajectory")
        atoms = atoms or molecule(source, radii=radii)
        source = source.coord
    first, places = _arrays(source, atoms, radii)
    numbers = range(*frames.indices(len(places)))
    return first, len(numbers), ((i, float("nan"), places[i]) for i in numbers)


def _shown(moving: Iterator[Frame], count: int, progress: bool) -> Iterator[Frame]:
    if not progress:
        return moving
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return moving
    shown: Iterator[Frame] = iter(tqdm(moving, total=count, desc="ovoid", unit="frame"))
    return shown


# ---- one frame after the other ------------------------------------------------------------------


class Surfaces:
    """Areas and volumes, frame after frame."""

    names = ["area", "volume", "pieces", "seconds"]

    def __init__(
        self,
        atoms: Molecule,
        *,
        decay: float | None,
        isovalue: float | None,
        spacing: float,
        vertices: str,
        context: Context | None,
    ) -> None:
        self.radii = np.array(atoms.radii)
        self.field = {"decay": decay, "isovalue": isovalue, "context": context}
        self.mesh = spacing, vertices

    def step(self, xyz: Any) -> dict[str, Any]:
        begin = time.perf_counter()
        field = Field(Molecule(xyz, self.radii), **self.field)  # type: ignore[arg-type]
        mesh = mesh_field(field, self.mesh[0], None, self.mesh[1], False)
        exact = self.mesh[1] == "exact"
        return {
            "area": mesh.area if exact else mesh.flat_area,
            "volume": mesh.volume if exact else mesh.flat_volume,
            "pieces": mesh.pieces,
            "seconds": time.perf_counter() - begin,
        }


class Fits:
    """Models, each beginning with the one before."""

    names = ["area", "volume", "model_area", "model_volume", "ellipsoids", "deviation", "reached"]
    names += ["fresh_ellipsoids", "fresh_deviation", "seconds", "fresh_seconds"]

    def __init__(
        self,
        atoms: Molecule,
        *,
        goal: dict[str, Any],
        surface: SurfaceOptions,
        fresh_every: int,
        measure: bool,
        keep_models: bool,
        context: Context | None,
    ) -> None:
        if fresh_every < 0:
            raise ArgumentError(f"fresh_every is {fresh_every}")
        self.context = context or default_context()
        self.fitter = Fitter(atoms, context=self.context, **surface)
        self.radii = np.array(atoms.radii)
        self.goal = goal
        self.fresh_every = fresh_every
        self.measure = measure
        self.spacing = surface.get("mesh_spacing") or SPACING
        self.keep_models = keep_models
        self.models: list[Model] = []
        self.done = 0

    def step(self, xyz: Any) -> dict[str, Any]:
        places = doubles(xyz, (len(self.radii), 3), "xyz", " (Å)")
        begin = time.perf_counter()
        self.fitter.move(places)
        model = self.fitter.fit(**self.goal)
        seconds = time.perf_counter() - begin
        report = model.report
        assert report is not None
        row = dict.fromkeys(self.names, float("nan"))
        row.update(ellipsoids=report.ellipsoids, deviation=report.distance, reached=report.reached)
        row["seconds"] = seconds
        if self.fresh_every and self.done % self.fresh_every == 0:
            row.update(self._fresh(model) if self.done else self._same(row))
        if self.measure:
            row.update(self._measure(places, model))
        if self.keep_models:
            self.models.append(model)
        self.done += 1
        return row

    def _same(self, row: dict[str, Any]) -> dict[str, Any]:
        """The first frame's fit is a fresh one."""
        return {
            "fresh_ellipsoids": row["ellipsoids"],
            "fresh_deviation": row["deviation"],
            "fresh_seconds": row["seconds"],
        }

    def _fresh(self, model: Model) -> dict[str, Any]:
        """A fit from the atoms, beside which the model goes on."""
        begin = time.perf_counter()
        self.fitter.start_from(None)
        fresh = self.fitter.fit(**self.goal).report
        self.fitter.start_from(model)
        assert fresh is not None
        return {
            "fresh_ellipsoids": fresh.ellipsoids,
            "fresh_deviation": fresh.distance,
            "fresh_seconds": time.perf_counter() - begin,
        }

    def _measure(self, places: Doubles, model: Model) -> dict[str, Any]:
        original = Field(
            Molecule(places, self.radii),
            decay=model.decay,
            isovalue=model.isovalue,
            context=self.context,
        )
        sparse = model.field(context=self.context)
        found = measure_fields(original, sparse, self.spacing, None, "exact", False, False)
        return {
            "area": found.area.original,
            "volume": found.volume.original,
            "model_area": found.area.model,
            "model_volume": found.volume.model,
        }


# ---- whole trajectories -------------------------------------------------------------------------


def measure_trajectory(
    trajectory: Any,
    atoms: Molecule | None = None,
    *,
    radii: Any = None,
    start: int | None = None,
    stop: int | None = None,
    step: int | None = None,
    decay: float | None = None,
    isovalue: float | None = None,
    spacing: float = SPACING,
    vertices: str = "exact",
    progress: bool = False,
    context: Context | None = None,
) -> SurfaceTrajectory:
    """Area and volume of the Gaussian surface in each frame, without a fit.

    Parameters
    ----------
    trajectory : object or array_like, shape (frames, atoms, 3)
        A Universe or AtomGroup of MDAnalysis, a Trajectory of MDTraj, an AtomArrayStack of Biotite,
        or coordinates (Å).
    atoms : Molecule, optional
        Whose radii are taken; default: what `ovoid.molecule` makes of the trajectory.
    radii : optional
        As `ovoid.molecule` takes them; with coordinates alone the radii themselves (Å).
    start, stop, step : int, optional
        Which frames, as in a slice.
    decay, isovalue : float, optional
        d (Å⁻², default 0.5) and c (default 1) of the surface.
    spacing : float
        Of the marching-cubes lattice (Å).
    vertices : {"exact", "linear"}
        "linear" is faster and less exact.
    progress : bool
        Show a bar of tqdm, if it is there.
    context : Context, optional

    Returns
    -------
    SurfaceTrajectory
    """
    first, count, moving = _frames(trajectory, atoms, radii, slice(start, stop, step))
    surfaces = Surfaces(
        first, decay=decay, isovalue=isovalue, spacing=spacing, vertices=vertices, context=context
    )
    rows = []
    for number, at, xyz in _shown(moving, count, progress):
        rows.append({"frame": number, "time": at, **surfaces.step(xyz)})
    return SurfaceTrajectory(**columns(rows, ["frame", "time", *Surfaces.names]))


@spelled_out(SurfaceOptions)
def fit_trajectory(
    trajectory: Any,
    atoms: Molecule | None = None,
    tolerance: float | None = None,
    ellipsoids: int | None = None,
    ratio: float | None = None,
    *,
    radii: Any = None,
    start: int | None = None,
    stop: int | None = None,
    step: int | None = None,
    fresh_every: int = 0,
    measure: bool = True,
    keep_models: bool = True,
    effort: int | None = None,
    progress: bool = False,
    context: Context | None = None,
    **surface: Unpack[SurfaceOptions],
) -> FitTrajectory:
    """Fits a model to each frame of a trajectory, each beginning with the one before.

    The ellipsoids move along with the atoms that they own, so that an ellipsoid of one frame is the
    same as that of the next, as long as none has to be added or taken away.

    Parameters
    ----------
    trajectory, atoms, radii, start, stop, step
        See `measure_trajectory`.
    tolerance, ellipsoids, ratio : optional
        The goal of each frame, as in `Molecule.fit`. With a number of ellipsoids they keep their
        identity in all frames.
    fresh_every : int
        Every so many frames a fit from the atoms is made as well, to compare with; 0: never.
    measure : bool
        Whether to measure areas and volumes of both surfaces.
    keep_models : bool
    decay, isovalue, spacing, padding, mesh_spacing, effort : optional
        See `Molecule.fit`.
    progress : bool
        Show a bar of tqdm, if it is there.
    context : Context, optional

    Returns
    -------
    FitTrajectory
    """
    first, count, moving = _frames(trajectory, atoms, radii, slice(start, stop, step))
    goal = {"tolerance": tolerance, "ellipsoids": ellipsoids, "ratio": ratio, "effort": effort}
    fits = Fits(
        first,
        goal=goal,
        surface=surface,
        fresh_every=fresh_every,
        measure=measure,
        keep_models=keep_models,
        context=context,
    )
    rows = []
    for number, at, xyz in _shown(moving, count, progress):
        rows.append({"frame": number, "time": at, **fits.step(xyz)})
    made = columns(rows, ["frame", "time", *Fits.names])
    return FitTrajectory(**made, models=fits.models)
