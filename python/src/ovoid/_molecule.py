"""Molecules: atoms as spheres, and who they are."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _abi
from ._abi import MOLECULE_COUNTS, lib
from ._context import Context, Handle, ProgressLike, encode, host_context, is_missing
from ._field import Field
from ._fit import Fitter, choice
from ._options import FitOptions, SearchOptions, SurfaceOptions, part, spelled_out
from ._surface import Pictured
from ._views import Doubles, doubles, view
from .errors import ArgumentError, EmptyError, FileError

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._model import Model

FORMATS = ("auto", "pqr", "xyzr", "pdb", "mmcif")
RADII = ("default", "own", "bondi", "paper", "united", "file")

#: Of `Molecule.atoms`: flags
HETERO, ZERO_OCCUPANCY, GUESSED_RADIUS = 1, 2, 4


@dataclass(frozen=True)
class Assembly:
    """An assembly that a file describes.

    Attributes
    ----------
    id : str
    placements : int
        Of all its parts.
    atoms : int
        That it would have.
    """

    id: str
    placements: int
    atoms: int


class Molecule(Pictured):
    """Atoms with a place and a radius.

    Parameters
    ----------
    xyz : array_like, shape (n, 3)
        Coordinates (Å).
    radii : array_like, shape (n,), or float
        Å, from 0 to 100.

    See Also
    --------
    ovoid.read : from a file
    ovoid.molecule : from objects of MDAnalysis, MDTraj, Biotite, gemmi, RDKit and ASE

    Examples
    --------
    >>> import ovoid
    >>> pair = ovoid.Molecule([[0, 0, 0], [1.2, 0, 0]], radii=[1.5, 1.7])
    >>> len(pair)
    2
    """

    def __init__(self, xyz: npt.ArrayLike, radii: npt.ArrayLike) -> None:
        places = doubles(xyz, (None, 3), "xyz", " (Å)")
        if len(places) == 0:
            raise EmptyError("a molecule needs an atom, and xyz has none")
        if np.ndim(radii) == 0:
            radii = np.full(len(places), radii)
        sizes = doubles(radii, (None,), "radii", " (Å)")
        if len(sizes) != len(places):
            raise ArgumentError(f"there are {len(places)} atoms and {len(sizes)} radii")
        made = ctypes.c_void_p()
        both = np.column_stack([places, sizes])
        host_context()._call(lib.molecule_create, both.ctypes.data, len(both), ctypes.byref(made))
        assert made.value
        self._handle = Handle(made.value, lib.molecule_destroy)
        self._name: str | None = None

    @classmethod
    def _of(cls, address: int, name: str | None) -> Molecule:
        molecule = cls.__new__(cls)
        molecule._handle = Handle(address, lib.molecule_destroy)
        molecule._name = name
        return molecule

    @property
    def _pointer(self) -> ctypes.c_void_p:
        return self._handle.pointer

    def __repr__(self) -> str:
        name = f" {os.path.basename(self._name)!r}" if self._name else ""
        kinds = "" if self.radii_name == "own" else f", radii {self.radii_name}"
        return f"<ovoid.Molecule{name} of {len(self)} atom{'s' * (len(self) != 1)}{kinds}>"

    def __len__(self) -> int:
        """How many atoms there are."""
        return int(lib.molecule_atoms(self._pointer))

    def __reduce__(self) -> Any:
        """A copy of its atoms with their radii; an assembly becomes atoms that nobody knows."""
        plain = np.array(self.xyz), np.array(self.radii), self._name
        if self.atoms is None or self.is_assembly:
            return _restore, plain
        return _restore, (*plain, np.array(self.atoms), np.array(self.residues))

    # ---- atoms ----

    @cached_property
    def xyzr(self) -> Doubles:
        """Array of float64, shape (n, 4): x, y, z and radius (Å), read-only."""
        if self.is_assembly:
            host_context()._call(lib.molecule_expand, self._pointer)
        address = lib.molecule_xyzr(self._pointer)
        array: Doubles = view(address, np.float64, (len(self), 4), self._handle)
        return array

    @property
    def xyz(self) -> Doubles:
        """Array of float64, shape (n, 3): coordinates (Å), a read-only view."""
        return self.xyzr[:, :3]

    @property
    def radii(self) -> Doubles:
        """Array of float64, shape (n,): radii (Å), a read-only view."""
        return self.xyzr[:, 3]

    @property
    def radii_name(self) -> str:
        """Where the radii came from: ``"own"``, ``"bondi"``, ``"paper"``, ``"united"`` or
        ``"file"``."""
        return str(lib.radii_name(lib.molecule_radii(self._pointer)).decode())

    @cached_property
    def atoms(self) -> npt.NDArray[np.void] | None:
        """Structured array of who the atoms are: name, element, altloc, serial, residue (index in
        `residues`), flags. Of an assembly those of its unit. None where nobody knows."""
        address = lib.molecule_identity(self._pointer)
        if not address:
            return None
        count = lib.molecule_unit_atoms(self._pointer)
        array: npt.NDArray[np.void] = view(address, _abi.ATOM, (count,), self._handle)
        return array

    @cached_property
    def residues(self) -> npt.NDArray[np.void] | None:
        """Structured array of the residues: name, chain, number, insertion, first (its first
        atom). None where nobody knows."""
        count = ctypes.c_size_t()
        address = lib.molecule_residues(self._pointer, ctypes.byref(count))
        if not address:
            return None
        array: npt.NDArray[np.void] = view(address, _abi.RESIDUE, (count.value,), self._handle)
        return array

    @property
    def counts(self) -> dict[str, int]:
        """What the reader met: atoms that were left out, by reason, guessed radii, and so on."""
        raw = lib.molecule_read_counts(self._pointer).contents
        return {name: getattr(raw, name) for name in MOLECULE_COUNTS}

    # ---- assemblies ----

    @property
    def assemblies(self) -> list[Assembly]:
        """The assemblies that the file describes."""
        count = ctypes.c_size_t()
        raw = lib.molecule_assemblies(self._pointer, ctypes.byref(count))
        entries = [raw[i] for i in range(count.value)]
        return [Assembly(e.id.decode(), e.placements, e.atoms) for e in entries]

    @cached_property
    def placements(self) -> npt.NDArray[np.void]:
        """Structured array of a molecule that was read as an assembly: rotation (3, 3),
        translation (Å), part, first (index of its first atom); else empty."""
        count = ctypes.c_size_t()
        address = lib.molecule_placements(self._pointer, ctypes.byref(count))
        array: npt.NDArray[np.void] = view(
            address, np.dtype(_abi.PLACEMENT), (count.value,), self._handle
        )
        return array

    @property
    def is_assembly(self) -> bool:
        """Whether it is made of placements of a unit."""
        return len(self.placements) > 0

    # ---- what is made of it ----

    def field(
        self,
        decay: float | None = None,
        isovalue: float | None = None,
        *,
        context: Context | None = None,
    ) -> Field:
        """Its field, as `Field` makes it."""
        return Field(self, decay=decay, isovalue=isovalue, context=context)

    @spelled_out(FitOptions)
    def fit(
        self,
        tolerance: float | None = None,
        ellipsoids: int | None = None,
        ratio: float | None = None,
        *,
        context: Context | None = None,
        **options: Unpack[FitOptions],
    ) -> Model:
        """Finds a few ellipsoids whose surface is near the molecule's.

        Parameters
        ----------
        tolerance : float, optional
            The outer surfaces are nowhere further apart (Å). One goal is given at most; the
            default is a tolerance of 0.5 Å.
        ellipsoids : int, optional
            So many, no more than atoms.
        ratio : float, optional
            So many per atom.
        method : {"adaptive", "l1"}
        decay, isovalue : float, optional
            d (Å⁻², default 0.5) and c (default 1) of the surface.
        spacing, padding : float, optional
            Of the points where the fields are compared, and room for them about the atoms (Å).
        mesh_spacing : float, optional
            Of the meshes on which surfaces are compared (Å, default 0.5).
        effort : int, optional
            1 (default) to 10: more starts and repairs, more time. 0, of so many ellipsoids:
            the largest distances are not brought down, in a fraction of the time; to a
            tolerance: soon content, with some more ellipsoids.
        steps : int, optional
            Of each refinement at most (default 60).
        part_atoms : int, optional
            Fits the molecule in parts of at most so many atoms, from 64, so that memory follows a
            part; default: parts of 16384 where there are more than 65536 atoms.
        jobs : int, optional
            So many parts side by side on each device; the model stays the same. Default: one for
            each two cores up to 4, while memory is plenty.
        l1 : mapping, optional
            Options of method l1 by their names in the C interface, such as ``{"iterations": 500}``.
        time_limit : float, optional
            Ends the search after so many seconds with the best model that held by then;
            `Cancelled` where nothing held yet.
        progress : bool or callable
            True shows a bar, if there is tqdm. A function is called with a `Progress` several
            times a second, and stops the fit by returning False, which raises `Cancelled` with the
            best model that held as its ``model``.
        context : Context, optional
            The device to work on; default: that of `use_device`.

        Returns
        -------
        Model
            Its ``report`` says whether the goal was reached; a `GoalWarning` does where not.

        Raises
        ------
        Interrupted
            Ctrl-C. It is a KeyboardInterrupt, and its ``model`` is the best one that held, if any.
        """
        fitter = Fitter(self, context=context, **part(options, SurfaceOptions))
        model = fitter.fit(tolerance, ellipsoids, ratio, **part(options, SearchOptions))
        if self._name:
            model._annotate("input", self._name)
        return model


def _restore(
    xyz: Any, radii: Any, name: str | None, atoms: Any = None, residues: Any = None
) -> Molecule:
    if atoms is None:
        made = Molecule(xyz, radii)
    else:
        from ._objects import restore

        made = restore(xyz, radii, atoms, residues)
    made._name = name
    return made


def read(
    path: str | os.PathLike[str],
    *,
    select: str | None = None,
    assembly: str | None = None,
    model: int | None = None,
    radii: str | os.PathLike[str] | None = None,
    waters: bool = False,
    hydrogens: bool = True,
    format: str | None = None,
    progress: ProgressLike = False,
) -> Molecule:
    """Reads a molecule from a PDB, mmCIF, PQR or XYZR file, gzipped or not.

    Parameters
    ----------
    path : path-like
    select : str, optional
        Atoms to keep, in gemmi's syntax, such as ``"A,B"``, ``"A/10-60"`` or ``"[!C]"``.
    assembly : str, optional
        Make the molecule this assembly of the file, such as ``"1"``; default: the atoms as they
        are there. `Molecule.assemblies` lists them.
    model : int, optional
        Its number in the file; default: the first.
    radii : str or path-like, optional
        ``"bondi"``, ``"paper"``, ``"united"`` (for structures without hydrogens), or a file with
        lines "residue atom radius" or "element radius". Default: the file's own, and of PDB and
        mmCIF files "united" where there are no hydrogens, else "bondi".
    waters : bool
        Keep those of PDB and mmCIF files.
    hydrogens : bool
        False leaves them out.
    format : {"pqr", "xyzr", "pdb", "mmcif"}, optional
        Default: by the extension, else by the contents.
    progress : bool or callable
        See `Molecule.fit`.

    Returns
    -------
    Molecule

    Raises
    ------
    FormatError
        With file, line and column of what cannot be understood.
    MissingFileError, FileError, EmptyError, ArgumentError
    """
    options = _abi.filled(_abi.ReadOptions, waters=waters, no_hydrogens=not hydrogens)
    if format is not None:
        options.format = choice(format, FORMATS[1:], "format") + 1
    if radii is not None:
        if isinstance(radii, str) and radii in RADII[1:5]:
            options.radii = RADII.index(radii)
        else:
            options.radii = RADII.index("file")
            options.radii_file = encode(radii, "radii")
    if select is not None:
        options.select = select.encode()
    if assembly is not None:
        options.assembly = str(assembly).encode()
    if model is not None:
        if not 0 < model < 2**31:
            raise ArgumentError(f"model is {model}: numbers of models begin with 1")
        options.model = model
    name = encode(path)
    made = ctypes.c_void_p()
    context = host_context()
    try:
        with context._watching(progress):
            context._call(lib.molecule_read_with, name, ctypes.byref(options), ctypes.byref(made))
    except FileError as error:
        raise is_missing(error, name) from None
    assert made.value
    return Molecule._of(made.value, os.fsdecode(name))
