"""A molecule and its models together: a page to turn them in, and what a notebook shows."""

from __future__ import annotations

import base64
import ctypes
import html
import os
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _abi
from ._abi import lib
from ._context import Context, ProgressLike, default_context, encode
from ._fit import choice
from ._surface import export_options
from .errors import ArgumentError, OvoidError, OvoidWarning

if TYPE_CHECKING:
    from ._model import Model
    from ._molecule import Molecule


COLOURINGS = ("plain", "difference", "chain", "residue", "ellipsoid")


class Scene:
    """A molecule, models of it, or both, to be looked at.

    A notebook shows it as a page in which the surfaces, their difference and the ellipsoids can be
    turned.

    Parameters
    ----------
    molecule : Molecule or None
    *models : Model
        Levels of detail, the finest first.
    title : str, optional
        Default: the name of the molecule's file.
    context : Context, optional

    Examples
    --------
    >>> ovoid.Scene(molecule, fine, coarse).export("view.html")          # doctest: +SKIP
    """

    def __init__(
        self,
        molecule: Molecule | None,
        *models: Model,
        title: str | None = None,
        context: Context | None = None,
    ) -> None:
        if molecule is None and not models:
            raise ArgumentError("a scene needs a molecule or a model")
        self.molecule = molecule
        self.models = models
        name = None if molecule is None else molecule._name
        self.title = title or (os.path.basename(name) if name else None)
        self.context = context

    def __repr__(self) -> str:
        parts = ([] if self.molecule is None else [self.molecule]) + list(self.models)
        return f"<ovoid.Scene of {', '.join(map(repr, parts))}>"

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
        range: float | None = None,
        max_triangles: float | None = None,
        colouring: str | None = None,
        progress: ProgressLike = False,
    ) -> None:
        """Writes a file, whole or not at all.

        Parameters
        ----------
        path : path-like
            Its extension is the format: .html is a page, one file that needs no network; .ply,
            .glb and .3mf are surfaces with colours, .vert (and .face) those of MSMS with the
            nearest atoms, .cif is IHMCIF; .xyz (OVITO), .lmp (LAMMPS), .pdb (ANISOU), .gltf
            (splats) and the extensions of `Field.export` take the first model.
        format, isovalue, spacing, colour, opacity, max_gigabytes
            As there.
        range : float, optional
            Of the difference's colours, to either side (Å).
        max_triangles : float, optional
            Of a surface in a page.
        colouring : {"plain", "difference", "chain", "residue", "ellipsoid"}, optional
            Of the surface in a .ply, .glb or .3mf file. Default: the difference where there are a
            molecule and a model.
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
            range=range,
            max_triangles=max_triangles,
        )
        if colouring is not None:
            options.colouring = choice(colouring, COLOURINGS, "colouring") + 1
        pointers = (ctypes.c_void_p * len(self.models))(*(m._pointer.value for m in self.models))
        scene = _abi.filled(
            _abi.Scene,
            molecule=None if self.molecule is None else self.molecule._pointer,
            models=ctypes.cast(pointers, ctypes.POINTER(ctypes.c_void_p)) if self.models else None,
            model_count=len(self.models),
            title=None if self.title is None else self.title.encode("utf-8", "replace"),
        )
        context = self.context or default_context()
        with context._watching(progress):
            context._call(
                lib.scene_export,
                ctypes.byref(scene),
                encode(path),
                ctypes.byref(options),
                needs_device=True,
            )

    def to_html(self, **options: Any) -> str:
        """The page as text; the options are those of `export`."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "ovoid.html")
            self.export(path, **options)
            return path.read_text("utf-8")

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        """The page in a frame of its own, and a picture for what shows no scripts."""
        shown = {"text/plain": repr(self)}
        try:
            page = html.escape(self.to_html(max_triangles=2e5))
            shown["text/html"] = (
                f'<iframe srcdoc="{page}" title="Ovoid" allowfullscreen '
                'style="width: 100%; height: 600px; border: 0"></iframe>'
            )
            picture = self._picture()._repr_png_()
            shown["image/png"] = base64.b64encode(picture).decode()
        except OvoidError as error:
            warnings.warn(f"nothing is shown: {error}", OvoidWarning, stacklevel=2)
        return shown

    def _picture(self) -> Any:
        size = 800, 600
        if not self.models:
            assert self.molecule is not None
            return self.molecule.render(size=size, context=self.context)
        return self.models[0].render(view="ellipsoids", size=size, context=self.context)
