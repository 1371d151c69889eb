"""Pictures, ray-marched on the device."""

from __future__ import annotations

import ctypes
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _abi
from ._abi import lib
from ._context import Handle, ProgressLike, encode, host_context
from ._field import Field
from ._views import view

COLOURINGS = ("none", "radius", "unit")
VIEWS = ("original", "model", "overlay", "difference", "ellipsoids", "panel")


class Image:
    """A picture, shown by a notebook as it is.

    Attributes
    ----------
    pixels : ndarray of uint8, shape (height, width, 4)
        Red, green, blue and opacity (sRGB), rows from the top.
    range : float
        Of the view "difference", what its colours reach to either side (Å); else 0.
    """

    def __init__(self, address: int) -> None:
        self._handle = Handle(address, lib.image_destroy)
        pointer = self._handle.pointer
        shape = (lib.image_height(pointer), lib.image_width(pointer), 4)
        start = ctypes.addressof(lib.image_pixels(pointer).contents)
        self.pixels: npt.NDArray[np.uint8] = view(start, np.uint8, shape, self._handle)
        self.range = float(lib.image_range(pointer))

    def __repr__(self) -> str:
        height, width, _ = self.pixels.shape
        return f"<ovoid.Image of {width} by {height} pixels>"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes a PNG file, whole or not at all."""
        host_context()._call(lib.image_write, self._handle.pointer, encode(path))

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "picture.png")
            self.write(path)
            return path.read_bytes()


def render(
    original: Field | None,
    model: Field | None,
    view_name: str,
    size: tuple[int, int],
    *,
    samples: int | None = None,
    isovalue: float | None = None,
    rotation: tuple[float, float, float] | None = None,
    colour_by: str = "none",
    transparent: bool = False,
    progress: ProgressLike = False,
) -> Image:
    from ._fit import choice

    options = _abi.filled(
        _abi.PictureOptions,
        view=choice(view_name, VIEWS, "view"),
        width=size[0],
        height=size[1],
        samples=samples,
        isovalue=isovalue,
        rotation=None if rotation is None else (ctypes.c_double * 3)(*rotation),
        colouring=choice(colour_by, COLOURINGS, "colour_by"),
        background=0xFFFFFF00 if transparent else None,
    )
    made = ctypes.c_void_p()
    field: Any = original if original is not None else model
    with field.context._watching(progress):
        field.context._call(
            lib.render,
            None if original is None else original._pointer,
            None if model is None else model._pointer,
            ctypes.byref(options),
            ctypes.byref(made),
            needs_device=True,
        )
    assert made.value
    return Image(made.value)
