"""Triangle meshes of surfaces."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _abi
from ._abi import lib
from ._context import Context, Handle, ProgressLike, default_context, encode, host_context
from ._views import Doubles, doubles, view
from .errors import ArgumentError


@dataclass(frozen=True)
class Component:
    """A connected piece of a surface.

    Attributes
    ----------
    vertices, triangles : int
    area : float
        Å².
    volume : float
        Å³; negative for the wall of a cavity.
    outer : bool
        It encloses matter.
    euler : int
        Vertices - edges + triangles: 2 - 2 genus where closed.
    closed : bool
    """

    vertices: int
    triangles: int
    area: float
    volume: float
    outer: bool
    euler: int
    closed: bool


@dataclass(frozen=True)
class Distances:
    """Distances between two surfaces, from points of each to the nearest triangle of the other.

    Attributes
    ----------
    hausdorff : float
        The larger of `forward` and `backward` (Å).
    forward, backward : float
        Largest one from the first surface to the second, and back (Å).
    mean, rms : float
        Area-weighted, of both directions (Å).
    """

    hausdorff: float
    forward: float
    backward: float
    mean: float
    rms: float


def distances_of(raw: Any) -> Distances:
    return Distances(raw.hausdorff, raw.forward, raw.backward, raw.mean, raw.rms)


class Mesh:
    """A triangle mesh, as `Molecule.mesh`, `Model.mesh` and `Field.mesh` make it.

    The arrays are read-only views of the library's memory; copy what is to be changed.

    Parameters
    ----------
    vertices : array_like, shape (n, 3)
        Å.
    faces : array_like of int, shape (m, 3)
        Indices of each triangle's corners, counter-clockwise from outside.
    normals : array_like, shape (n, 3), optional
        Outward unit vectors; default: those of the triangles.
    """

    def __init__(
        self,
        vertices: npt.ArrayLike,
        faces: npt.ArrayLike,
        normals: npt.ArrayLike | None = None,
    ) -> None:
        places = doubles(vertices, (None, 3), "vertices", " (Å)")
        given = np.asarray(faces)
        if given.dtype.kind not in "iu" or given.ndim != 2 or given.shape[1] != 3:
            raise ArgumentError(f"faces must be integers of shape (m, 3), not {given.shape}")
        if given.size and not (given.min() >= 0 and given.max() < len(places)):
            raise ArgumentError(f"faces must be indices below {len(places)}, from 0")
        corners = np.ascontiguousarray(given, np.uint32)
        directions = None
        if normals is not None:
            checked = doubles(normals, (len(places), 3), "normals")
            directions = np.ascontiguousarray(checked, np.float32)
        made = ctypes.c_void_p()
        host_context()._call(
            lib.mesh_create,
            places.ctypes.data,
            None if directions is None else directions.ctypes.data,
            len(places),
            corners.ctypes.data,
            len(corners),
            ctypes.byref(made),
        )
        assert made.value
        self._handle = Handle(made.value, lib.mesh_destroy)

    @classmethod
    def _of(cls, address: int) -> Mesh:
        mesh = cls.__new__(cls)
        mesh._handle = Handle(address, lib.mesh_destroy)
        return mesh

    @property
    def _pointer(self) -> ctypes.c_void_p:
        return self._handle.pointer

    def __repr__(self) -> str:
        n, m = len(self.vertices), len(self.faces)
        pieces = f"{self.pieces} piece{'s' * (self.pieces != 1)}"
        return f"<ovoid.Mesh of {n} vertices, {m} faces, {pieces}>"

    def __reduce__(self) -> Any:
        return Mesh, (np.array(self.vertices), np.array(self.faces), np.array(self.normals))

    @cached_property
    def vertices(self) -> Doubles:
        """Array of float64, shape (n, 3): Å."""
        n = lib.mesh_vertices(self._pointer)
        array: Doubles = view(lib.mesh_xyz(self._pointer), np.float64, (n, 3), self._handle)
        return array

    @cached_property
    def normals(self) -> npt.NDArray[np.float32]:
        """Array of float32, shape (n, 3): outward unit vectors."""
        n = lib.mesh_vertices(self._pointer)
        array: npt.NDArray[np.float32] = view(
            lib.mesh_normals(self._pointer), np.float32, (n, 3), self._handle
        )
        return array

    @cached_property
    def faces(self) -> npt.NDArray[np.uint32]:
        """Array of uint32, shape (m, 3): corners, counter-clockwise from outside."""
        m = lib.mesh_triangles(self._pointer)
        array: npt.NDArray[np.uint32] = view(
            lib.mesh_corners(self._pointer), np.uint32, (m, 3), self._handle
        )
        return array

    @cached_property
    def component_of(self) -> npt.NDArray[np.uint32]:
        """Array of uint32, shape (n,): the piece that each vertex belongs to, from 0."""
        n = lib.mesh_vertices(self._pointer)
        array: npt.NDArray[np.uint32] = view(
            lib.mesh_component_of(self._pointer), np.uint32, (n,), self._handle
        )
        return array

    @cached_property
    def components(self) -> list[Component]:
        """The connected pieces."""
        pieces = []
        for i in range(lib.mesh_components(self._pointer)):
            raw = lib.mesh_component(self._pointer, i).contents
            pieces.append(Component(*(getattr(raw, name) for name, _ in raw._fields_)))
        return pieces

    @property
    def pieces(self) -> int:
        """How many connected pieces there are."""
        return int(lib.mesh_components(self._pointer))

    @property
    def area(self) -> float:
        """Of the smooth surface that vertices and normals lie on (Å²)."""
        return float(lib.mesh_smooth_area(self._pointer))

    @property
    def volume(self) -> float:
        """Within the smooth surface that vertices and normals lie on (Å³)."""
        return float(lib.mesh_smooth_volume(self._pointer))

    @property
    def flat_area(self) -> float:
        """Of the flat triangles (Å²)."""
        return float(lib.mesh_area(self._pointer))

    @property
    def flat_volume(self) -> float:
        """Within the flat triangles (Å³)."""
        return float(lib.mesh_volume(self._pointer))

    def distances(
        self, other: Mesh, *, outer_only: bool = False, context: Context | None = None
    ) -> Distances:
        """Distances to another surface, both ways.

        Parameters
        ----------
        other : Mesh
        outer_only : bool
            Leave out the walls of cavities, of both.
        context : Context, optional

        Returns
        -------
        Distances
        """
        raw = _abi.Distances()
        (context or default_context())._call(
            lib.mesh_distances,
            self._pointer,
            other._pointer,
            outer_only,
            ctypes.byref(raw),
            None,
            needs_device=True,
        )
        return distances_of(raw)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes a file by its extension: .ply, .obj, .stl, .off or .glb, whole or not at all."""
        host_context()._call(lib.mesh_write, self._pointer, encode(path))

    def to_trimesh(self) -> Any:
        """A `trimesh.Trimesh` with copies of vertices, faces and normals."""
        import trimesh

        return trimesh.Trimesh(
            np.array(self.vertices),
            np.array(self.faces, np.int64),
            vertex_normals=np.array(self.normals, np.float64),
            process=False,
        )

    def to_pyvista(self) -> Any:
        """A `pyvista.PolyData` with the normals as point data."""
        import pyvista

        faces = np.empty((len(self.faces), 4), np.int64)
        faces[:, 0] = 3
        faces[:, 1:] = self.faces
        surface = pyvista.PolyData(np.array(self.vertices), faces.ravel())
        surface.point_data["Normals"] = np.array(self.normals)
        surface.point_data.active_normals_name = "Normals"
        return surface


def mesh_field(
    field: Any, spacing: float, isovalue: float | None, vertices: str, progress: ProgressLike
) -> Mesh:
    from ._fit import choice

    options = _abi.filled(
        _abi.MeshOptions,
        spacing=spacing,
        isovalue=isovalue,
        vertices=choice(vertices, ("exact", "linear"), "vertices"),
    )
    made = ctypes.c_void_p()
    with field.context._watching(progress):
        field.context._call(
            lib.field_mesh,
            field._pointer,
            ctypes.byref(options),
            ctypes.byref(made),
            needs_device=True,
        )
    assert made.value
    return Mesh._of(made.value)
