"""Fields of molecules and models, and their values."""

from __future__ import annotations

import ctypes
import os
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from . import _abi
from ._abi import lib
from ._context import Context, Handle, ProgressLike, default_context, encode
from ._mesh import Mesh, mesh_field
from ._views import Doubles, doubles
from .errors import ArgumentError

if TYPE_CHECKING:
    from ._model import Model
    from ._molecule import Molecule

DECAY = 0.5
ISOVALUE = 1.0
SPACING = 0.5


class Field:
    """The field φ of a molecule or a model. It keeps its Gaussians on the device.

    Parameters
    ----------
    source : Molecule or Model
    decay : float, optional
        d of a molecule (Å⁻², default 0.5); a model has its own.
    isovalue : float, optional
        c of the surface that is meant where no other is named (default 1); a model has its own.
    context : Context, optional

    Examples
    --------
    >>> value, gradient = ovoid.Field(model)(points, gradient=True)      # doctest: +SKIP
    """

    def __init__(
        self,
        source: Molecule | Model,
        *,
        decay: float | None = None,
        isovalue: float | None = None,
        context: Context | None = None,
    ) -> None:
        from ._model import Model
        from ._molecule import Molecule

        self.context = context or default_context()
        made = ctypes.c_void_p()
        if isinstance(source, Molecule):
            self.context._call(
                lib.field_of_molecule,
                source._pointer,
                DECAY if decay is None else decay,
                ISOVALUE if isovalue is None else isovalue,
                ctypes.byref(made),
            )
        elif isinstance(source, Model):
            if decay is not None or isovalue is not None:
                raise ArgumentError("a model has its own decay and isovalue")
            self.context._call(lib.field_of_model, source._pointer, ctypes.byref(made))
        else:
            raise TypeError(f"a field is one of a Molecule or a Model, not {type(source).__name__}")
        assert made.value
        self._handle = Handle(made.value, lib.field_destroy, self.context)

    @property
    def _pointer(self) -> ctypes.c_void_p:
        return self._handle.pointer

    def __repr__(self) -> str:
        return f"<ovoid.Field of {len(self)} Gaussians>"

    def __len__(self) -> int:
        """How many Gaussians it is the sum of."""
        return int(lib.field_terms(self._pointer))

    @property
    def decay(self) -> float:
        """d (Å⁻²)."""
        return float(lib.field_decay(self._pointer))

    @property
    def isovalue(self) -> float:
        """c."""
        return float(lib.field_isovalue(self._pointer))

    @overload
    def __call__(self, points: npt.ArrayLike, gradient: Literal[False] = False) -> Doubles: ...

    @overload
    def __call__(
        self, points: npt.ArrayLike, gradient: Literal[True]
    ) -> tuple[Doubles, Doubles]: ...

    def __call__(self, points: npt.ArrayLike, gradient: bool = False) -> Any:
        """Values at points, computed in single precision on the device.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            Å.
        gradient : bool
            Whether to compute the gradient, too.

        Returns
        -------
        value : ndarray, shape (...)
            φ, to about 1e-6 of it; 0 where no Gaussian is as much as 1e-7.
        gradient : ndarray, shape (..., 3)
            ∇φ (Å⁻¹), only with ``gradient=True``.
        """
        given = np.asarray(points)
        if given.ndim == 0 or given.shape[-1] != 3:
            raise ArgumentError(f"points must have the shape (..., 3), not {given.shape}")
        places = doubles(given.reshape(-1, 3), (None, 3), "points", " (Å)")
        value = np.empty(len(places))
        slope = np.empty((len(places), 3)) if gradient else None
        if len(places):
            self.context._call(
                lib.field_evaluate,
                self._pointer,
                places.ctypes.data,
                len(places),
                value.ctypes.data,
                None if slope is None else slope.ctypes.data,
                needs_device=True,
            )
        shape = given.shape[:-1]
        if slope is None:
            return value.reshape(shape)
        return value.reshape(shape), slope.reshape((*shape, 3))

    def mesh(
        self,
        spacing: float = SPACING,
        isovalue: float | None = None,
        *,
        vertices: str = "exact",
        progress: ProgressLike = False,
    ) -> Mesh:
        """The closed triangle mesh of the surface φ = c, by marching cubes on the device.

        Parameters
        ----------
        spacing : float
            Of the lattice (Å).
        isovalue : float, optional
            c; default: the field's.
        vertices : {"exact", "linear"}
            On the surface itself, or interpolated along the lattice's edges.
        progress : bool or callable
            See `Molecule.fit`.

        Returns
        -------
        Mesh
        """
        return mesh_field(self, spacing, isovalue, vertices, progress)

    def export(
        self,
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        isovalue: float | None = None,
        spacing: float | None = None,
        colour: tuple[float, float, float] | None = None,
        opacity: float | None = None,
        max_gigabytes: float | None = None,
        progress: ProgressLike = False,
    ) -> None:
        """Writes a file for another program, whole or not at all.

        Parameters
        ----------
        path : path-like
            Its extension is the format: of a model .bild, .cxc (ChimeraX), .py (PyMOL), .gmm,
            .json, .xyz (OVITO), .lmp (LAMMPS), .pdb (ANISOU), .gltf (splats); of models and
            molecules maps, .mrc, .map, .ccp4 and .dx. `Scene.export` has more.
        format : str, optional
            The name of the format, where the extension does not tell.
        isovalue : float, optional
            Where an ellipsoid is drawn; default: the model's.
        spacing : float, optional
            Of a map (Å).
        colour : (red, green, blue), optional
            From 0 to 1, of drawn ellipsoids.
        opacity : float, optional
            From 0 to 1, of drawn ellipsoids.
        max_gigabytes : float, optional
            A map that would take more is refused.
        progress : bool or callable
            See `Molecule.fit`.
        """
        options = export_options(
            format,
            isovalue=isovalue,
            spacing=spacing,
            colour=colour,
            opacity=opacity,
            max_gigabytes=max_gigabytes,
        )
        with self.context._watching(progress):
            self.context._call(lib.field_export, self._pointer, encode(path), ctypes.byref(options))


def export_options(
    format: str | None,
    *,
    colour: tuple[float, float, float] | None = None,
    **values: float | None,
) -> Any:
    """The library's structure; None leaves what is the default there."""
    kind = 0
    if format is not None:
        kind = lib.export_format_find(format.encode())
        if kind == 0:
            raise ArgumentError(f"there is no format {format!r}")
    vector = None if colour is None else (ctypes.c_double * 3)(*colour)
    return _abi.filled(_abi.ExportOptions, format=kind, colour=vector, **values)
