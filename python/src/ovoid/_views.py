"""Arrays in and out of the library, without copies where the layouts allow it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError

Doubles = npt.NDArray[np.float64]


class _Memory:
    """Memory of an object of the library, which stays alive as long as an array looks at it."""

    def __init__(self, address: int, size: int, owner: object) -> None:
        self.owner = owner
        self.__array_interface__ = {
            "version": 3,
            "typestr": "|u1",
            "shape": (size,),
            "data": (address, True),
        }


def view(address: int | None, dtype: Any, shape: tuple[int, ...], owner: object) -> Any:
    """A read-only array over the library's memory."""
    kind = np.dtype(dtype)
    count = int(np.prod(shape, dtype=np.int64))
    if not address or count == 0:
        empty = np.empty(shape if count == 0 else (0,), kind)
        empty.flags.writeable = False
        return empty
    return np.asarray(_Memory(address, count * kind.itemsize, owner)).view(kind).reshape(shape)


def doubles(values: Any, shape: tuple[int | None, ...], name: str, unit: str = "") -> Doubles:
    """What was given as contiguous doubles of this shape (None: any length), checked."""
    wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
    wanted = wanted.replace("(n)", "(n,)")
    try:
        given = np.asanyarray(values)
        if given.dtype.kind not in "fiu":
            given = np.asarray(values, np.float64) if given.dtype.kind == "O" else given
        if given.dtype.kind not in "fiu":
            raise TypeError(f"an array of {given.dtype}")
        if isinstance(given, np.ma.MaskedArray) and np.any(given.mask):
            raise TypeError("an array with masked values")
        array: Doubles = np.ascontiguousarray(given, np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} must be numbers of shape {wanted}: {error}") from None
    if array.ndim == 0 or given.ndim != len(shape):
        raise ArgumentError(f"{name} must have the shape {wanted}, not {np.shape(given)}")
    for n, found in zip(shape, array.shape):
        if n is not None and n != found:
            raise ArgumentError(f"{name} must have the shape {wanted}, not {array.shape}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        where = ", ".join(str(int(k)) for k in bad[0])
        value = array[tuple(bad[0])]
        raise ArgumentError(f"{name}[{where}] is {value}: values must be finite{unit}")
    return array
