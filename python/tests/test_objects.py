"""Molecules from other packages' objects have the atoms and radii that a file has."""

import numpy as np
import ovoid
import pytest


def same(peptide, thing, **options):
    molecule = ovoid.molecule(thing, **options)
    assert molecule.xyz == pytest.approx(peptide.xyz, abs=1e-3)
    assert np.array_equal(molecule.radii, peptide.radii)
    assert molecule.radii_name == peptide.radii_name == "united"
    assert np.array_equal(molecule.atoms["name"], peptide.atoms["name"])
    assert np.array_equal(molecule.residues["number"], peptide.residues["number"])


def test_gemmi(peptide, peptide_path):
    gemmi = pytest.importorskip("gemmi")
    structure = gemmi.read_structure(str(peptide_path))
    same(peptide, structure)
    same(peptide, structure[0])
    with pytest.raises(TypeError, match="Structure or Model"):
        ovoid.molecule(structure[0][0])


def test_mdanalysis(peptide, peptide_path):
    mda = pytest.importorskip("MDAnalysis")
    universe = mda.Universe(str(peptide_path))
    same(peptide, universe)
    same(peptide, universe.atoms)
    assert np.array_equal(ovoid.molecule(universe.atoms[:5], radii=2.0).radii, [2.0] * 5)


def test_mdtraj(peptide, peptide_path):
    mdtraj = pytest.importorskip("mdtraj")
    same(peptide, mdtraj.load(str(peptide_path)))


def test_biotite(peptide, peptide_path):
    pdb = pytest.importorskip("biotite.structure.io.pdb")
    same(peptide, pdb.PDBFile.read(str(peptide_path)).get_structure(), frame=0)


def test_rdkit(peptide, peptide_path):
    chem = pytest.importorskip("rdkit.Chem")
    options = {"sanitize": False, "proximityBonding": False}
    same(peptide, chem.MolFromPDBFile(str(peptide_path), **options))
    with pytest.raises(ovoid.ArgumentError, match="no conformer"):
        ovoid.molecule(chem.MolFromSmiles("CCO"))


def test_ase(peptide, peptide_path):
    ase = pytest.importorskip("ase")
    water = ase.Atoms("OH2", positions=[[0, 0, 0], [0.96, 0, 0], [-0.24, 0.93, 0]])
    molecule = ovoid.molecule(water)
    assert molecule.radii_name == "bondi"
    assert molecule.radii == pytest.approx([1.52, 1.2, 1.2])


def test_trimesh(peptide):
    pytest.importorskip("trimesh")
    mesh = peptide.mesh(1.0)
    made = mesh.to_trimesh()
    assert made.is_watertight and made.volume == pytest.approx(mesh.flat_volume)
    assert np.array_equal(made.vertices, mesh.vertices)


def test_pyvista(peptide):
    pytest.importorskip("pyvista")
    mesh = peptide.mesh(1.0)
    made = mesh.to_pyvista()
    assert made.is_manifold and made.area == pytest.approx(mesh.flat_area)
    assert np.array_equal(made.point_data["Normals"], mesh.normals)


def test_arrays():
    made = ovoid.from_arrays(
        [[0, 0, 0], [1.5, 0, 0], [9, 0, 0]],
        ["C", "", "Zn"],
        names=["CA", "CB", "ZN"],
        residue_names=["ALA", "ALA", "ZN"],
        residue_numbers=[1, 1, 2],
        chains=["A", "A", "A"],
        hetero=[False, False, True],
        radii="bondi",
    )
    assert made.atoms["flags"].tolist() == [0, ovoid._molecule.GUESSED_RADIUS, 1]
    assert made.residues["first"].tolist() == [0, 2]
    with pytest.raises(ovoid.ArgumentError, match="names must have the shape"):
        ovoid.from_arrays([[0, 0, 0]], ["C"], names=["CA", "CB"])
