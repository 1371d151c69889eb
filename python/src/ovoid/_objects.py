"""Molecules from the objects of other packages, none of which is imported here."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _abi
from ._abi import NO_NUMBER, lib
from ._context import encode, host_context
from ._molecule import HETERO, RADII, Molecule
from ._views import doubles
from .errors import ArgumentError, EmptyError


@dataclass
class _Atoms:
    """What an object says of its atoms; None where it says nothing."""

    xyz: Any
    elements: Any
    names: Any = None
    residue_names: Any = None
    residue_numbers: Any = None
    chains: Any = None
    insertions: Any = None
    hetero: Any = None
    radii: Any = None


def _text(values: Any, width: int, count: int, name: str) -> Any:
    """Texts as the library holds them: bytes, cut to `width`."""
    if values is None:
        return np.zeros(count, f"S{width}")
    array = np.asarray(values)
    if array.shape != (count,):
        raise ArgumentError(f"{name} must have the shape ({count},), not {array.shape}")
    if array.dtype.kind == "S":
        return array.astype(f"S{width}")
    words = [str("" if word is None else word).strip().encode("ascii", "replace") for word in array]
    return np.array([word[:width] for word in words], f"S{width}")


def _numbers(values: Any, count: int) -> Any:
    if values is None:
        return np.full(count, NO_NUMBER, np.int32)
    array = np.asarray(values)
    if array.shape != (count,) or array.dtype.kind not in "iu":
        raise ArgumentError(f"residue_numbers must be integers of shape ({count},)")
    return array.astype(np.int32)


def _guess_elements(elements: Any, names: Any, residues: Any) -> Any:
    """Elements from the names of atoms, for objects that hold none: the first letter, but for
    ions, whose residue is called as the atom is."""
    elements = np.array([e if e.isalpha() else b"" for e in elements.tolist()], elements.dtype)
    if names is None or np.any(elements != b""):
        return elements
    guessed = elements.copy()
    for i, (name, residue) in enumerate(zip(names, residues)):
        letters = bytes(c for c in name if chr(c).isalpha())
        ion = len(letters) == 2 and letters.upper() == residue.upper()
        guessed[i] = letters if ion else letters[:1]
    return guessed


def _identity(given: _Atoms, count: int) -> tuple[Any, Any]:
    """The library's arrays of atoms and residues. A residue ends where what it is called by
    changes."""
    atoms = np.zeros(count, _abi.ATOM)
    elements = _text(given.elements, 2, count, "elements")
    names = None if given.names is None else _text(given.names, 7, count, "names")
    residue_names = _text(given.residue_names, 7, count, "residue_names")
    atoms["element"] = _guess_elements(elements, names, residue_names)
    atoms["name"] = atoms["element"] if names is None else names
    atoms["serial"] = np.arange(1, count + 1)
    if given.hetero is not None:
        atoms["flags"] = np.where(np.asarray(given.hetero, bool), HETERO, 0)
    each = np.zeros(count, _abi.RESIDUE)
    each["name"] = residue_names
    each["chain"] = _text(given.chains, 11, count, "chains")
    each["number"] = _numbers(given.residue_numbers, count)
    each["insertion"] = _text(given.insertions, 1, count, "insertions")
    begins = np.ones(count, bool)
    begins[1:] = False
    for key in ("name", "chain", "number", "insertion"):
        begins[1:] |= each[key][1:] != each[key][:-1]
    atoms["residue"] = np.cumsum(begins) - 1
    return atoms, np.ascontiguousarray(each[begins])


def _known(given: _Atoms, radii: Any) -> Molecule:
    places = doubles(given.xyz, (None, 3), "xyz", " (Å)")
    count = len(places)
    if count == 0:
        raise EmptyError("a molecule needs an atom, and xyz has none")
    own = given.radii
    kind = RADII.index("default")
    file = None
    if isinstance(radii, str) and radii in RADII[1:5]:
        kind = RADII.index(radii)
    elif isinstance(radii, (str, os.PathLike)):
        kind, file = RADII.index("file"), encode(radii, "radii")
    elif radii is not None:
        own = np.full(count, radii) if np.ndim(radii) == 0 else radii
        kind = RADII.index("own")
    elif own is not None:
        kind = RADII.index("own")
    if kind == RADII.index("own") and own is None:
        raise ArgumentError("radii='own', but the object has none")
    xyzr = np.zeros((count, 4))
    xyzr[:, :3] = places
    if kind == RADII.index("own"):
        xyzr[:, 3] = doubles(own, (count,), "radii", " (Å)")
    return _create(xyzr, *_identity(given, count), kind, file)


def _create(xyzr: Any, atoms: Any, residues: Any, kind: int, file: bytes | None) -> Molecule:
    made = ctypes.c_void_p()
    host_context()._call(
        lib.molecule_create_known,
        xyzr.ctypes.data,
        atoms.ctypes.data,
        len(atoms),
        residues.ctypes.data,
        len(residues),
        kind,
        file,
        ctypes.byref(made),
    )
    assert made.value
    return Molecule._of(made.value, None)


def restore(xyz: Any, radii: Any, atoms: Any, residues: Any) -> Molecule:
    """What a molecule was before it was pickled."""
    return _create(np.column_stack([xyz, radii]), atoms, residues, RADII.index("own"), None)


def from_arrays(
    xyz: npt.ArrayLike,
    elements: Any,
    *,
    radii: Any = None,
    names: Any = None,
    residue_names: Any = None,
    residue_numbers: Any = None,
    chains: Any = None,
    insertions: Any = None,
    hetero: Any = None,
) -> Molecule:
    """Makes a molecule of atoms that are known, with radii as for a structure's file.

    Parameters
    ----------
    xyz : array_like, shape (n, 3)
        Coordinates (Å).
    elements : sequence of str, length n
        Symbols, such as ``"C"`` or ``"Zn"``; ``""`` where unknown.
    radii : str, path-like, float or array_like, optional
        As `ovoid.read` takes it, or the radii themselves (Å). Default: "united" where there are no
        hydrogens, else "bondi".
    names, residue_names : sequence of str, optional
        Such as ``"CA"`` and ``"ALA"``: radii "united" go by them.
    residue_numbers : sequence of int, optional
    chains, insertions : sequence of str, optional
    hetero : sequence of bool, optional
        Not of a polymer, as HETATM records are.

    Returns
    -------
    Molecule
    """
    given = _Atoms(
        *(xyz, elements, names, residue_names, residue_numbers, chains, insertions, hetero)
    )
    return _known(given, radii)


# ---- objects ------------------------------------------------------------------------------------


def _optional(group: Any, name: str) -> Any:
    """An attribute of MDAnalysis, None where the topology has it not."""
    try:
        values = getattr(group, name)
    except Exception:  # NoDataError, of a package that is not imported here
        return None
    return values if len(values) else None


def _mdanalysis(group: Any, frame: int | None) -> _Atoms:
    group = group.atoms
    if frame is not None:
        group.universe.trajectory[frame]
    chains = _optional(group, "chainIDs")
    if chains is None or not any(str(c).strip() for c in chains):
        chains = _optional(group, "segids")
    types = _optional(group, "record_types")
    return _Atoms(
        xyz=group.positions,
        elements=_optional(group, "elements"),
        names=_optional(group, "names"),
        residue_names=_optional(group, "resnames"),
        residue_numbers=_optional(group, "resids"),
        chains=chains,
        insertions=_optional(group, "icodes"),
        hetero=None if types is None else np.asarray(types) == "HETATM",
        radii=_optional(group, "radii"),
    )


def _mdtraj(trajectory: Any, frame: int | None) -> _Atoms:
    atoms = list(trajectory.topology.atoms)
    return _Atoms(
        xyz=10.0 * np.asarray(trajectory.xyz[frame or 0], np.float64),  # of nm
        elements=["" if a.element is None else a.element.symbol.replace("VS", "") for a in atoms],
        names=[a.name for a in atoms],
        residue_names=[a.residue.name for a in atoms],
        residue_numbers=[a.residue.resSeq for a in atoms],
        chains=[getattr(a.residue.chain, "chain_id", None) or a.residue.chain.index for a in atoms],
    )


def _biotite(array: Any, frame: int | None) -> _Atoms:
    if np.ndim(array.coord) == 3:
        array = array[frame or 0]
    return _Atoms(
        xyz=array.coord,
        elements=array.element,
        names=array.atom_name,
        residue_names=array.res_name,
        residue_numbers=array.res_id,
        chains=array.chain_id,
        insertions=array.ins_code,
        hetero=array.hetero,
    )


def _gemmi(structure: Any, frame: int | None) -> _Atoms:
    if type(structure).__name__ == "Structure":
        structure = structure[frame or 0]
    if type(structure).__name__ != "Model":
        raise TypeError(f"give a gemmi.Structure or Model, not a {type(structure).__name__}")
    model = structure.clone()
    model.remove_alternative_conformations()
    rows = [(a, r, c) for c in model for r in c for a in r]
    return _Atoms(
        xyz=np.array([a.pos.tolist() for a, _, _ in rows]).reshape(-1, 3),
        elements=["" if a.element.name == "X" else a.element.name for a, _, _ in rows],
        names=[a.name for a, _, _ in rows],
        residue_names=[r.name for _, r, _ in rows],
        residue_numbers=[r.seqid.num for _, r, _ in rows],
        chains=[c.name for _, _, c in rows],
        insertions=[r.seqid.icode for _, r, _ in rows],
        hetero=[r.het_flag == "H" for _, r, _ in rows],
    )


def _rdkit(molecule: Any, frame: int | None) -> _Atoms:
    if molecule.GetNumConformers() == 0:
        raise ArgumentError("the molecule has no conformer: embed it first")
    atoms = list(molecule.GetAtoms())
    conformers = list(molecule.GetConformers())
    if frame is not None and not -len(conformers) <= frame < len(conformers):
        raise ArgumentError(f"frame is {frame}, and there are {len(conformers)} conformers")
    made = _Atoms(
        xyz=conformers[frame or 0].GetPositions(),
        elements=[a.GetSymbol().replace("*", "") for a in atoms],
    )
    known = [a.GetPDBResidueInfo() for a in atoms]
    if all(info is not None for info in known):
        made.names = [info.GetName() for info in known]
        made.residue_names = [info.GetResidueName() for info in known]
        made.residue_numbers = [info.GetResidueNumber() for info in known]
        made.chains = [info.GetChainId() for info in known]
        made.insertions = [info.GetInsertionCode() for info in known]
        made.hetero = [info.GetIsHeteroAtom() for info in known]
    return made


def _ase(atoms: Any, frame: int | None) -> _Atoms:
    if frame is not None:
        raise ArgumentError("Atoms of ASE have one frame")
    symbols = ["" if s == "X" else s for s in atoms.get_chemical_symbols()]
    known = atoms.arrays  # with names where they were read from a PDB file
    return _Atoms(
        xyz=atoms.get_positions(),
        elements=symbols,
        names=known.get("atomtypes"),
        residue_names=known.get("residuenames"),
        residue_numbers=known.get("residuenumbers"),
    )


# By the package that the object's class, or one that it derives from, comes from.
_READERS: dict[str, Callable[[Any, int | None], _Atoms]] = {
    "MDAnalysis": _mdanalysis,
    "mdtraj": _mdtraj,
    "biotite": _biotite,
    "gemmi": _gemmi,
    "rdkit": _rdkit,
    "ase": _ase,
}


def molecule(thing: Any, *, radii: Any = None, frame: int | None = None) -> Molecule:
    """Makes a molecule of an object of another package, with all atoms that it holds.

    Parameters
    ----------
    thing : object
        A Universe or AtomGroup of MDAnalysis, a Trajectory of MDTraj, an AtomArray or
        AtomArrayStack of Biotite, a Structure or Model of gemmi (one conformer of each residue is
        taken), a Mol of RDKit with a conformer, Atoms of ASE.
    radii : str, path-like, float or array_like, optional
        As `ovoid.read` takes it, or the radii themselves (Å). Default: those of the object, if
        it has any; else "united" where there are no hydrogens, else "bondi".
    frame : int, optional
        Of a trajectory or stack, the model of a structure, or a molecule's conformer, from 0.
        Default: the current one of MDAnalysis, else the first.

    Returns
    -------
    Molecule
    """
    if isinstance(thing, Molecule):
        return thing
    for base in type(thing).__mro__:
        reader = _READERS.get((base.__module__ or "").partition(".")[0])
        if reader is not None:
            return _known(reader(thing, frame), radii)
    known = ", ".join(sorted(_READERS, key=str.lower))
    raise TypeError(
        f"a {type(thing).__module__}.{type(thing).__qualname__} is no object of {known}; "
        "ovoid.from_arrays takes arrays"
    )
