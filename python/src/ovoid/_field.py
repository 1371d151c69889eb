"""Fields of molecules and models, and their values."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from ._abi import lib
from ._context import Context, Handle, default_context
from ._surface import DECAY, ISOVALUE, Surface
from ._views import Doubles, doubles
from .errors import ArgumentError

if TYPE_CHECKING:
    from ._model import Model
    from ._molecule import Molecule


class Field(Surface):
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

    def field(
        self,
        decay: float | None = None,
        isovalue: float | None = None,
        *,
        context: Context | None = None,
    ) -> Field:
        """Itself."""
        if decay is not None or isovalue is not None:
            raise ArgumentError("a field has its own decay and isovalue")
        if context is not None and context is not self.context:
            raise ArgumentError("a field belongs to the context that it was made with")
        return self

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
