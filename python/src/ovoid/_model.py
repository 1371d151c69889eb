"""Models: a few ellipsoids, and the surface that they stand for."""

from __future__ import annotations

import ctypes
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _abi
from ._abi import lib
from ._context import Context, Handle, ProgressLike, encode, host_context, is_missing
from ._field import Field
from ._measure import Measures, measure_fields
from ._scene import Scene
from ._surface import DECAY, ISOVALUE, SPACING, Pictured
from ._views import Doubles, doubles, view
from .errors import ArgumentError, EmptyError, FileError, OutOfMemoryError

if TYPE_CHECKING:
    from ._fit import FitReport
    from ._molecule import Molecule


def _rotations(angles: Doubles) -> Doubles:
    """R = R_z(gamma) R_y(beta) R_x(alpha) with the paper's signs: rows are the axes."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(angles.T), np.sin(angles.T)
    rows = [
        [cb * cg, -ca * sg - sa * sb * cg, sa * sg - ca * cg * sb],
        [cb * sg, ca * cg - sa * sb * sg, -sa * cg - ca * sb * sg],
        [sb, cb * sa, ca * cb],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _angles(r: Doubles) -> Doubles:
    """The inverse, for proper rotations."""
    beta = np.arcsin(np.clip(r[:, 2, 0], -1, 1))
    locked = np.hypot(r[:, 2, 1], r[:, 2, 2]) < 1e-9
    alpha = np.where(
        locked,
        np.arctan2(-r[:, 0, 1] * np.sign(r[:, 2, 0]), r[:, 1, 1]),
        np.arctan2(r[:, 2, 1], r[:, 2, 2]),
    )
    gamma = np.where(locked, 0.0, np.arctan2(r[:, 1, 0], r[:, 0, 0]))
    return np.stack([alpha, beta, gamma], axis=1)


def _motions(placements: Any) -> npt.NDArray[np.void]:
    """Placements as an array of the library's, from that, those of a molecule, or pairs."""
    named = getattr(placements, "dtype", None) is not None and placements.dtype.names
    if named:
        rotations, translations = placements["rotation"], placements["translation"]
    else:
        pairs = list(placements)
        rotations = np.array([rotation for rotation, _ in pairs]).reshape(-1, 3, 3)
        translations = np.array([translation for _, translation in pairs]).reshape(-1, 3)
    turns = doubles(rotations, (None, 3, 3), "placements' rotations")
    motions = np.empty(len(turns), np.dtype(_abi.MOTION))
    motions["rotation"] = turns
    motions["translation"] = doubles(
        translations, (len(turns), 3), "placements' translations", " (Å)"
    )
    return motions


def _frozen(array: Any) -> Any:
    array.flags.writeable = False
    return array


class Model(Pictured):
    """Ellipsoids: Gaussians a·exp(-(x-μ)ᵀA(x-μ)) whose sum has a surface like a molecule's.

    It comes from `Molecule.fit` or `read_model`, or is made of arrays. All arrays are read-only.

    The model of a symmetric assembly is that of one unit, and its placements; its arrays, and all
    that is made of it, are those of all units.

    Parameters
    ----------
    centres : array_like, shape (n, 3)
        μ (Å).
    covariances : array_like, shape (n, 3, 3)
        Σ = A⁻¹/2 (Å²), symmetric and positive definite.
    amplitudes : array_like, shape (n,)
        a, above 0.
    decay, isovalue : float
        d (Å⁻²) and c of the surface that the model stands for.
    placements : array_like, optional
        The ellipsoids are those of a unit, which is in each of these: an array with the fields
        rotation (3, 3) and translation (Å), as `placements` of a model or a molecule is, or pairs
        of the two.

    Attributes
    ----------
    report : FitReport or None
        What is known of the fit that it comes from.
    molecule : Molecule or None
        What it was fitted to, as far as it is known.
    """

    report: FitReport | None
    molecule: Molecule | None

    def __init__(
        self,
        centres: npt.ArrayLike,
        covariances: npt.ArrayLike,
        amplitudes: npt.ArrayLike,
        *,
        decay: float = DECAY,
        isovalue: float = ISOVALUE,
        placements: Any = None,
    ) -> None:
        places = doubles(centres, (None, 3), "centres", " (Å)")
        n = len(places)
        shapes = doubles(covariances, (n, 3, 3), "covariances", " (Å²)")
        heights = doubles(amplitudes, (n,), "amplitudes")
        if not np.allclose(shapes, shapes.transpose(0, 2, 1), rtol=1e-6, atol=1e-9):
            raise ArgumentError("covariances must be symmetric")
        if n == 0:
            raise EmptyError("a model needs an ellipsoid, and centres has none")
        variance, axes = np.linalg.eigh((shapes + shapes.transpose(0, 2, 1)) / 2)
        if not (variance > 0).all():
            bad = int(np.argwhere(~(variance > 0).all(axis=1))[0, 0])
            raise ArgumentError(f"covariances[{bad}] is not positive definite")
        rows = axes.transpose(0, 2, 1)
        rows[np.linalg.det(rows) < 0, 2] *= -1
        table = np.column_stack([heights, 0.5 / variance, places, _angles(rows)])
        self._make(table, decay, isovalue, _motions([] if placements is None else placements))

    def _make(
        self, table: Doubles, decay: float, isovalue: float, motions: npt.NDArray[np.void]
    ) -> None:
        made = ctypes.c_void_p()
        array = np.ascontiguousarray(table)
        host_context()._call(
            lib.model_create_placed,
            array.ctypes.data,
            len(array),
            motions.ctypes.data,
            len(motions),
            decay,
            isovalue,
            ctypes.byref(made),
        )
        assert made.value
        self._handle = Handle(made.value, lib.model_destroy)
        self.report = None
        self.molecule = None

    @classmethod
    def _of(
        cls, address: int, report: FitReport | None = None, notes: dict[str, str] | None = None
    ) -> Model:
        model = cls.__new__(cls)
        model._handle = Handle(address, lib.model_destroy)
        model.report = report
        model.molecule = None
        if report is not None:
            model._annotate("program", f"ovoid {lib.version().decode()} (Python)")
        for key, value in (notes or {}).items():
            model._annotate(key, value)
        return model

    def _annotate(self, key: str, value: str) -> None:
        clean = "".join("?" if ord(c) < 32 or ord(c) == 127 else c for c in value)
        raw = clean.encode("utf-8", "surrogateescape").replace(b"\0", b"?")
        host_context()._call(lib.model_annotate, self._pointer, key.encode(), raw)

    @property
    def _pointer(self) -> ctypes.c_void_p:
        return self._handle.pointer

    def __len__(self) -> int:
        """How many ellipsoids there are, of all units."""
        return int(lib.model_size(self._pointer))

    def __repr__(self) -> str:
        n = len(self)
        text = f"<ovoid.Model of {n} ellipsoid{'s' * (n != 1)}"
        if self.report is not None:
            text += f" for {self.report.atoms} atoms"
            if self.report.distance >= 0:
                text += f", within {self.report.distance:.3g} Å"
        return text + ">"

    def __reduce__(self) -> Any:
        owner = None if self.owner is None else np.array(self.owner)
        unit = np.array(self.unit_ellipsoids), self.decay, self.isovalue, np.array(self.placements)
        return _restore, (*unit, self.report, owner, self.notes)

    # ---- ellipsoids ----

    @cached_property
    def ellipsoids(self) -> Doubles:
        """Array of float64, shape (n, 10), a view: amplitude, three decays (Å⁻²), centre (Å), and
        the three angles (radian) of the paper's convention, as in model files."""
        address = lib.model_ellipsoids(self._pointer)
        if not address:
            raise OutOfMemoryError(f"ovoid: no memory for {len(self)} ellipsoids")
        array: Doubles = view(address, np.float64, (len(self), 10), self._handle)
        return array

    @cached_property
    def placements(self) -> npt.NDArray[np.void]:
        """Structured array: rotation (3, 3) and translation (Å) of each placement of the unit;
        empty where the model is not made of any."""
        count = ctypes.c_size_t()
        address = lib.model_placements(self._pointer, ctypes.byref(count))
        array: npt.NDArray[np.void] = view(
            address, np.dtype(_abi.MOTION), (count.value,), self._handle
        )
        return array

    @cached_property
    def unit_ellipsoids(self) -> Doubles:
        """Array of float64, shape (m, 10), a view: as `ellipsoids`, those of the unit, before it is
        placed; of a model without placements all there are."""
        address = lib.model_unit_ellipsoids(self._pointer)
        count = int(lib.model_unit_size(self._pointer))
        array: Doubles = view(address, np.float64, (count, 10), self._handle)
        return array

    def expand(self) -> Model:
        """The same model without placements: all ellipsoids, also in its file.

        Returns
        -------
        Model
        """
        made = ctypes.c_void_p()
        host_context()._call(lib.model_expand, self._pointer, ctypes.byref(made))
        assert made.value
        model = Model._of(made.value)
        model.report = self.report
        model.molecule = self.molecule
        if "owner" in self.__dict__:
            model.__dict__["owner"] = self.owner
        return model

    @property
    def amplitudes(self) -> Doubles:
        """Array of float64, shape (n,), a view: a."""
        return self.ellipsoids[:, 0]

    @property
    def decays(self) -> Doubles:
        """Array of float64, shape (n, 3), a view: eigenvalues of A (Å⁻²)."""
        return self.ellipsoids[:, 1:4]

    @property
    def centres(self) -> Doubles:
        """Array of float64, shape (n, 3), a view: μ (Å)."""
        return self.ellipsoids[:, 4:7]

    @property
    def angles(self) -> Doubles:
        """Array of float64, shape (n, 3), a view: α, β, γ (radian) in the paper's convention."""
        return self.ellipsoids[:, 7:10]

    @cached_property
    def directions(self) -> Doubles:
        """Array of float64, shape (n, 3, 3): ``directions[i, p]`` is the unit vector along which
        ellipsoid i has ``decays[i, p]`` and ``axes[i, p]``."""
        array: Doubles = _frozen(_rotations(np.asarray(self.angles)))
        return array

    @cached_property
    def matrices(self) -> Doubles:
        """Array of float64, shape (n, 3, 3): A (Å⁻²)."""
        r = self.directions
        array: Doubles = _frozen(np.einsum("np,npi,npj->nij", self.decays, r, r))
        return array

    @cached_property
    def covariances(self) -> Doubles:
        """Array of float64, shape (n, 3, 3): Σ = A⁻¹/2 (Å²)."""
        r = self.directions
        array: Doubles = _frozen(np.einsum("np,npi,npj->nij", 0.5 / self.decays, r, r))
        return array

    @cached_property
    def axes(self) -> Doubles:
        """Array of float64, shape (n, 3): semi-axes (Å) of the surface on which the ellipsoid's own
        Gaussian is c; where it does not reach c, of that on which it has half its amplitude."""
        a = self.amplitudes
        reach = np.where(
            a > self.isovalue, np.log(np.maximum(a, 1e-300) / self.isovalue), np.log(2)
        )
        array: Doubles = _frozen(np.sqrt(reach[:, None] / self.decays))
        return array

    @cached_property
    def owner(self) -> npt.NDArray[np.uint32] | None:
        """Array of uint32, shape (atoms,), a view: the ellipsoid that each atom became part of,
        from 0. None where nobody knows: model files do not hold it."""
        address = lib.model_owner(self._pointer)
        if not address:
            return None
        count = lib.model_owner_count(self._pointer)
        array: npt.NDArray[np.uint32] = view(address, np.uint32, (count,), self._handle)
        return array

    @property
    def decay(self) -> float:
        """d of the surface that it stands for (Å⁻²)."""
        return float(lib.model_decay(self._pointer))

    @property
    def isovalue(self) -> float:
        """c of the surface that it stands for."""
        return float(lib.model_isovalue(self._pointer))

    @property
    def notes(self) -> dict[str, str]:
        """Header lines of its file, such as "settings"; the last one of a name counts."""
        found: dict[str, str] = {}
        index = 0
        while True:
            raw = lib.model_note(self._pointer, index)
            if raw is None:
                return found
            key, _, value = raw.decode("utf-8", "replace").partition(": ")
            found[key] = value
            index += 1

    # ---- what is made of it ----

    def field(
        self,
        decay: float | None = None,
        isovalue: float | None = None,
        *,
        context: Context | None = None,
    ) -> Field:
        """Its field, as `Field` makes it. Its decay and isovalue are its own."""
        return Field(self, decay=decay, isovalue=isovalue, context=context)

    def measure(
        self,
        molecule: Molecule,
        *,
        spacing: float = SPACING,
        isovalue: float | None = None,
        vertices: str = "exact",
        distances: bool = True,
        progress: ProgressLike = False,
        context: Context | None = None,
    ) -> Measures:
        """Compares its surface with the molecule's.

        Parameters
        ----------
        molecule : Molecule
        spacing : float
            Of both meshes (Å).
        isovalue : float, optional
            c of both surfaces; default: the model's.
        vertices : {"exact", "linear"}
            On the surface itself, or interpolated along the lattice's edges.
        distances : bool
            False leaves them out: they are NaN then.
        progress : bool or callable
            See `Molecule.fit`.
        context : Context, optional

        Returns
        -------
        Measures
        """
        original = molecule.field(self.decay, self.isovalue, context=context)
        return measure_fields(
            original,
            self.field(context=context),
            spacing,
            isovalue,
            vertices,
            distances,
            progress,
        )

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes a model file (.ovoid), whole or not at all."""
        host_context()._call(lib.model_write, self._pointer, encode(path))

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        """What a notebook shows: a `Scene` with the molecule that it was fitted to."""
        shown = Scene(self.molecule, self)._repr_mimebundle_()
        return {**shown, "text/plain": repr(self)}


def _restore(
    table: Any,
    decay: float,
    isovalue: float,
    placements: Any,
    report: Any,
    owner: Any,
    notes: dict[str, str],
) -> Model:
    model = Model.__new__(Model)
    model._make(table, decay, isovalue, placements)
    model.report = report
    model.__dict__["owner"] = owner
    for key, value in notes.items():
        model._annotate(key, value)
    return model


def read_model(path: str | os.PathLike[str]) -> Model:
    """Reads a model file (.ovoid).

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Model

    Raises
    ------
    FormatError
        With file, line and column of what cannot be understood.
    MissingFileError, FileError, EmptyError
    """
    made = ctypes.c_void_p()
    name = encode(path)
    try:
        host_context()._call(lib.model_read, name, ctypes.byref(made))
    except FileError as error:
        raise is_missing(error, name) from None
    assert made.value
    return Model._of(made.value)
