"""From a molecule to a model."""

from __future__ import annotations

import ctypes
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from . import _abi
from ._abi import UNKNOWN, lib
from ._context import Context, Handle, _outside, default_context
from ._options import SearchOptions, SurfaceOptions, spelled_out
from ._views import doubles
from .errors import ArgumentError, Cancelled, GoalWarning, Interrupted

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._model import Model
    from ._molecule import Molecule

METHODS = ("adaptive", "l1")
GOALS = ("tolerance", "ellipsoids", "ratio")
KERNELS = ("ellipsoid", "sphere")
FIRST_STEPS = ("secant", "grow")
VERDICTS = ("reached", "missed", "no surface", "no model surface", "coarse", "no goal")
_WHY = {
    "missed": "the model is not as close, or has not as many ellipsoids, as was asked for",
    "no surface": "there is no surface to be near to: the molecule's field is nowhere above the "
    "isovalue",
    "no model surface": "the model has no surface",
    "coarse": "mesh_spacing is too coarse to tell",
}


@dataclass(frozen=True)
class FitReport:
    """What is known of a fit.

    Attributes
    ----------
    method : str
        ``"adaptive"`` or ``"l1"``.
    atoms, ellipsoids : int
    sparse_ratio : float
        Ellipsoids per atom.
    reached : bool
        The goal, as measured.
    verdict : str
        ``"reached"``, ``"missed"``, ``"no surface"``, ``"no model surface"``, ``"coarse"`` or, of
        method l1, ``"no goal"``.
    distance : float
        Largest distance between the outer surfaces, measured (Å); NaN where it is not known.
    stopped : bool
        A time limit ended the search.
    spacing : float
        Of the constrained points (Å).
    points, iterations : int
    parts : int
        That the molecule, or one unit of it, was cut into; 1 as a whole.
    units : int
        Of a symmetric assembly, of which one was fitted; 1: all atoms were.
    sample_seconds, fit_seconds : float
    rms_error, max_error : float
        Of method l1, of the field at the constrained points; else NaN.
    """

    method: str
    atoms: int
    ellipsoids: int
    sparse_ratio: float
    reached: bool
    verdict: str
    distance: float
    stopped: bool
    spacing: float
    points: int
    iterations: int
    parts: int
    units: int
    sample_seconds: float
    fit_seconds: float
    rms_error: float
    max_error: float


def choice(value: str, names: tuple[str, ...], what: str) -> int:
    """The place of a name."""
    if value not in names:
        raise ArgumentError(f"{what} is one of {', '.join(map(repr, names))}, not {value!r}")
    return names.index(value)


def _goal(
    options: Any, tolerance: float | None, ellipsoids: int | None, ratio: float | None
) -> None:
    given = {"tolerance": tolerance, "ellipsoids": ellipsoids, "ratio": ratio}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise ArgumentError(f"a fit has one goal, not {' and '.join(named)}")
    for name in named:
        options.adaptive.goal = GOALS.index(name)
    if tolerance is not None:
        options.adaptive.tolerance = tolerance
    if ellipsoids is not None:
        if not 0 < ellipsoids < 2**32:
            raise ArgumentError(f"ellipsoids is {ellipsoids}, and must be above 0")
        options.adaptive.ellipsoids = ellipsoids
    if ratio is not None:
        options.adaptive.ratio = ratio


def _set_l1(options: Any, l1: Mapping[str, Any]) -> None:
    known = [field[0] for field in _abi.L1Options._fields_]
    for name, value in l1.items():
        if name not in known:
            raise ArgumentError(f"l1 has no option {name!r}; there are {', '.join(known)}")
        if name == "kernel":
            value = choice(value, KERNELS, "kernel")
        elif name == "first_step":
            value = choice(value, FIRST_STEPS, "first_step")
        setattr(options, name, value)


def options_of(
    tolerance: float | None = None,
    ellipsoids: int | None = None,
    ratio: float | None = None,
    *,
    method: str = "adaptive",
    effort: int | None = None,
    steps: int | None = None,
    l1: Mapping[str, Any] | None = None,
    part_atoms: int | None = None,
    jobs: int | None = None,
    mesh_spacing: float | None = None,
    **points: float | None,
) -> Any:
    """The library's structure; None leaves what is the default there."""
    options = _abi.filled(
        _abi.FitOptions,
        method=choice(method, METHODS, "method"),
        **points,
    )
    goal = any(value is not None for value in (tolerance, ellipsoids, ratio))
    if method == "l1" and goal:
        raise ArgumentError("method l1 has no goal: leave out tolerance, ellipsoids and ratio")
    if method != "l1" and l1:
        raise ArgumentError("l1 holds options of method='l1'")
    _goal(options, tolerance, ellipsoids, ratio)
    for kind, name, value in (
        (options.adaptive, "effort", effort),
        (options.adaptive, "steps", steps),
        (options.parts, "atoms", part_atoms),
        (options.parts, "jobs", jobs),
    ):
        if value is not None:
            if not 0 <= value < 2**32:
                raise ArgumentError(f"{name} is {value}")
            setattr(kind, name, value)
    if mesh_spacing is not None:
        options.adaptive.mesh_spacing = mesh_spacing
    _set_l1(options.l1, l1 or {})
    return options


def _report(result: Any, atoms: int, stopped: bool) -> FitReport:
    def count(value: int) -> int:
        return 0 if value == UNKNOWN else value

    return FitReport(
        method=METHODS[result.method],
        atoms=atoms,
        ellipsoids=count(result.ellipsoids),
        sparse_ratio=count(result.ellipsoids) / atoms if atoms else math.nan,
        reached=result.reached,
        verdict=VERDICTS[result.verdict],
        distance=result.distance,
        stopped=stopped,
        spacing=result.spacing,
        points=count(result.points),
        iterations=count(result.iterations),
        parts=count(result.parts) or 1,
        units=count(result.units) or 1,
        sample_seconds=result.sample_seconds,
        fit_seconds=result.fit_seconds,
        rms_error=result.l1.rms_error,
        max_error=result.l1.max_error,
    )


def settings_of(options: Any, report: FitReport) -> str:
    """One line for model files, in the words of the tool's options."""
    words = [f"method {report.method}", f"spacing {report.spacing:.9g}"]
    words.append(f"padding {options.padding:.9g}")
    if report.method == "adaptive":
        goal = GOALS[options.adaptive.goal]
        words.append(f"{goal} {getattr(options.adaptive, goal):.9g}")
        words += [f"effort {options.adaptive.effort}", f"steps {options.adaptive.steps}"]
        words.append(f"mesh-spacing {options.adaptive.mesh_spacing:.9g}")
        if report.parts > 1:
            words.append(f"parts {report.parts}")
        if report.units > 1:
            words.append(f"units {report.units}")
    else:
        words += [f"iterations {options.l1.iterations}", f"kernel {KERNELS[options.l1.kernel]}"]
    return ", ".join(words)


class Fitter:
    """A session that fits one molecule again and again, and prepares it once.

    Parameters
    ----------
    molecule : Molecule
    decay, isovalue, spacing, padding, mesh_spacing : float, optional
        The surface, as in `Molecule.fit`. They hold for all fits of the session.
    context : Context, optional

    Examples
    --------
    >>> fitter = ovoid.Fitter(molecule)                       # doctest: +SKIP
    >>> coarse = fitter.fit(tolerance=1.0)                    # doctest: +SKIP
    >>> fine = fitter.fit(tolerance=0.5)                      # doctest: +SKIP
    >>> fitter.move(next_frame)                               # doctest: +SKIP
    >>> next = fitter.fit(tolerance=0.5)                      # doctest: +SKIP
    """

    @spelled_out(SurfaceOptions)
    def __init__(
        self,
        molecule: Molecule,
        *,
        context: Context | None = None,
        **surface: Unpack[SurfaceOptions],
    ) -> None:
        self._surface = surface
        self.context = context or default_context()
        self.atoms = len(molecule)
        self.molecule: Molecule | None = molecule  # None where its atoms have moved
        options = options_of(**self._surface)
        made = ctypes.c_void_p()
        self.context._call(
            lib.fitter_create, molecule._pointer, ctypes.byref(options), ctypes.byref(made)
        )
        assert made.value
        self._handle = Handle(made.value, lib.fitter_destroy, self.context)

    def __repr__(self) -> str:
        return f"<ovoid.Fitter of {self.atoms} atoms>"

    @spelled_out(SearchOptions)
    def fit(
        self,
        tolerance: float | None = None,
        ellipsoids: int | None = None,
        ratio: float | None = None,
        **search: Unpack[SearchOptions],
    ) -> Model:
        """Fits a model to the surface. The parameters are those of `Molecule.fit`.

        Returns
        -------
        Model
        """
        from ._model import Model

        wanted: dict[str, Any] = {**search, **self._surface}
        time_limit = wanted.pop("time_limit", None)
        progress = wanted.pop("progress", False)
        options = options_of(tolerance, ellipsoids, ratio, **wanted)
        if time_limit is not None and not time_limit > 0:
            raise ArgumentError(f"time_limit is {time_limit}, and must be above 0 s")
        result = _abi.filled(_abi.FitResult)
        made = ctypes.c_void_p()

        def model(stopped: bool) -> Model | None:
            if not made.value:
                return None
            report = _report(result, self.atoms, stopped)
            used = self.context.used_devices[: None if report.parts > 1 else 1]
            texts = [f"{one.name} ({one.platform}, driver {one.driver})" for one in used]
            notes = {"device": ", ".join(dict.fromkeys(texts))}  # alike ones are one
            notes["settings"] = settings_of(options, report)
            if report.method == "adaptive":
                notes["goal"] = "reached" if report.reached else "not reached"
            if math.isfinite(report.distance):
                notes["distance"] = f"{report.distance:.6g}"
            if stopped:
                notes["stopped"] = "by a time limit or the caller"
            fitted = Model._of(made.value, report=report, notes=notes)
            fitted.molecule = self.molecule
            return fitted

        with self.context._watching(progress, time_limit) as watch:
            try:
                self.context._call(
                    lib.fitter_reach,
                    self._handle.pointer,
                    ctypes.byref(options),
                    ctypes.byref(made),
                    ctypes.byref(result),
                    needs_device=True,
                )
            except (Cancelled, Interrupted) as stop:
                held = model(stopped=True)
                if held is not None and watch.out_of_time:
                    return held
                stop.model = held
                raise
        found = model(stopped=False)
        assert found is not None and found.report is not None
        why = _WHY.get(found.report.verdict)
        if why is not None:
            reached = f" ({found.report.distance:.4g} Å)" if found.report.distance >= 0 else ""
            text = f"the goal was not reached: {why}{reached}; this is the best model found"
            warnings.warn(text, GoalWarning, stacklevel=_outside())
        return found

    def start_from(self, model: Model | None) -> None:
        """Method adaptive begins with this model from now on; None: with the atoms.

        Parameters
        ----------
        model : Model or None
            Of the same decay and isovalue, with no more ellipsoids than there are atoms.
        """
        pointer = None if model is None else model._pointer
        self.context._call(lib.fitter_start_from, self._handle.pointer, pointer)

    def move(self, xyz: npt.ArrayLike) -> None:
        """Moves the atoms, and the last model with them: the next fit begins there.

        Parameters
        ----------
        xyz : array_like, shape (atoms, 3)
            New coordinates (Å) of the same atoms.
        """
        places = doubles(xyz, (self.atoms, 3), "xyz", " (Å)")
        self.context._call(lib.fitter_move, self._handle.pointer, places.ctypes.data)
        self.molecule = None
