"""What molecules, models and fields do alike: meshes, pictures and files of their surfaces."""

from __future__ import annotations

import ctypes
import os
from typing import TYPE_CHECKING, Any

from . import _abi
from ._abi import lib
from ._context import Context, ProgressLike, encode
from ._mesh import Mesh, mesh_field
from .errors import ArgumentError

if TYPE_CHECKING:
    from ._field import Field
    from ._picture import Image

DECAY = 0.5
ISOVALUE = 1.0
SPACING = 0.5


class Surface:
    """What has a surface: the base of `Molecule`, `Model` and `Field`."""

    def field(
        self,
        decay: float | None = None,
        isovalue: float | None = None,
        *,
        context: Context | None = None,
    ) -> Field:
        """Its field, as `Field` makes it.

        Parameters
        ----------
        decay, isovalue : float, optional
            d (Å⁻², default 0.5) and c (default 1) of a molecule; models and fields have their own.
        context : Context, optional
            The device to work on; default: that of `use_device`, and of a field its own.

        Returns
        -------
        Field
        """
        raise NotImplementedError

    def mesh(
        self,
        spacing: float = SPACING,
        isovalue: float | None = None,
        *,
        decay: float | None = None,
        vertices: str = "exact",
        progress: ProgressLike = False,
        context: Context | None = None,
    ) -> Mesh:
        """The closed triangle mesh of the surface φ = c, by marching cubes on the device.

        Parameters
        ----------
        spacing : float
            Of the lattice (Å).
        isovalue : float, optional
            c; default: its own, of a molecule 1.
        decay : float, optional
            d of a molecule (Å⁻², default 0.5); models and fields have their own.
        vertices : {"exact", "linear"}
            On the surface itself, or interpolated along the lattice's edges.
        progress : bool or callable
            See `Molecule.fit`.
        context : Context, optional
            As `field` takes it.

        Returns
        -------
        Mesh
        """
        field = self.field(decay, context=context)
        return mesh_field(field, spacing, isovalue, vertices, progress)

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
        field = self.field()
        with field.context._watching(progress):
            field.context._call(
                lib.field_export, field._pointer, encode(path), ctypes.byref(options)
            )


class Pictured(Surface):
    """What pictures show: the base of `Molecule` and `Model`."""

    def render(
        self,
        other: Pictured | None = None,
        *,
        view: str | None = None,
        size: tuple[int, int] = (1200, 900),
        decay: float | None = None,
        isovalue: float | None = None,
        samples: int | None = None,
        rotation: tuple[float, float, float] | None = None,
        colour_by: str = "none",
        transparent: bool = False,
        progress: ProgressLike = False,
        context: Context | None = None,
    ) -> Image:
        """A picture of its surface, or of a molecule's and a model's.

        Parameters
        ----------
        other : Molecule or Model, optional
            The molecule of a model or a model of the molecule, which the views "overlay",
            "difference" and "panel" need.
        view : {"original", "model", "overlay", "difference", "ellipsoids", "panel"}, optional
            Default: "overlay" of two, else "original" of a molecule and "model" of a model.
        size : (width, height)
            Pixels.
        decay : float, optional
            d of a molecule by itself (Å⁻², default 0.5); with a model it is the model's.
        isovalue : float, optional
            c; default: the model's, and of a molecule by itself 1.
        samples : int, optional
            Rays across a pixel.
        rotation : (x, y, z), optional
            Radian about the screen's axes.
        colour_by : {"none", "radius", "unit"}
            "radius" colours one surface, or ellipsoids, by how far from the middle what is seen is,
            "unit" ellipsoids by the placement of the model's unit.
        transparent : bool
            Instead of the white background.
        progress : bool or callable
            See `Molecule.fit`.
        context : Context, optional
            As `field` takes it.

        Returns
        -------
        Image
        """
        from ._picture import render

        original, model = _fields(self, other, decay, context)
        alone = "model" if original is None else "original"
        return render(
            original,
            model,
            view or ("overlay" if other is not None else alone),
            size,
            samples=samples,
            isovalue=isovalue,
            rotation=rotation,
            colour_by=colour_by,
            transparent=transparent,
            progress=progress,
        )


def _fields(
    one: Pictured, other: Pictured | None, decay: float | None, context: Context | None
) -> tuple[Field | None, Field | None]:
    """The molecule's and the model's, with the decay and isovalue of the model."""
    from ._model import Model
    from ._molecule import Molecule

    shown = [one] if other is None else [one, other]
    molecules = [thing for thing in shown if isinstance(thing, Molecule)]
    models = [thing for thing in shown if isinstance(thing, Model)]
    if len(molecules) > 1 or len(models) > 1 or len(molecules) + len(models) < len(shown):
        kinds = " and ".join(f"a {type(thing).__name__}" for thing in shown)
        raise ArgumentError(f"a picture of two shows a Molecule and a Model, not {kinds}")
    if not models:
        return molecules[0].field(decay, context=context), None
    model = models[0].field(decay, context=context)
    if not molecules:
        return None, model
    return molecules[0].field(model.decay, model.isovalue, context=context), model


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
