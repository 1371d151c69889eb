#!/usr/bin/env python3
"""structures.py LIBRARY FOLDER

Reads structures with Ovoid's library and with gemmi, and compares atoms, names, places, selections
and assemblies. The structures are those of Debian's pymol-data, of FOLDER (or OVOID_MOLECULES), and
some that are written here. Exits with 77 where gemmi is not there.
"""

import ctypes
import glob
import gzip
import os
import sys
import tempfile

try:
    import gemmi
except ImportError:
    print("skipped: there is no python3-gemmi")
    sys.exit(77)


class Options(ctypes.Structure):
    _fields_ = [("size", ctypes.c_size_t), ("format", ctypes.c_int), ("radii", ctypes.c_int),
                ("radii_file", ctypes.c_char_p), ("select", ctypes.c_char_p),
                ("model", ctypes.c_int32), ("waters", ctypes.c_bool),
                ("no_hydrogens", ctypes.c_bool), ("assembly", ctypes.c_char_p)]


class Atom(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char * 8), ("element", ctypes.c_char * 3),
                ("altloc", ctypes.c_char), ("serial", ctypes.c_int32),
                ("residue", ctypes.c_uint32), ("flags", ctypes.c_uint32)]


class Residue(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char * 8), ("chain", ctypes.c_char * 12),
                ("number", ctypes.c_int32), ("insertion", ctypes.c_char),
                ("reserved", ctypes.c_char * 3), ("first", ctypes.c_uint32)]


assert ctypes.sizeof(Atom) == 24 and ctypes.sizeof(Residue) == 32


class Ovoid:
    def __init__(self, path):
        self.lib = lib = ctypes.CDLL(path)
        for name, result in (("ovoid_molecule_xyzr", ctypes.POINTER(ctypes.c_double)),
                             ("ovoid_molecule_atoms", ctypes.c_size_t),
                             ("ovoid_molecule_origin", ctypes.c_size_t),
                             ("ovoid_molecule_identity", ctypes.POINTER(Atom)),
                             ("ovoid_molecule_residues", ctypes.POINTER(Residue)),
                             ("ovoid_context_error", ctypes.c_char_p)):
            getattr(lib, name).restype = result
        self.context = ctypes.c_void_p()
        assert lib.ovoid_context_create(ctypes.byref(self.context)) == 0

    def read(self, path, **options):
        """(name, element, residue, chain, number, insertion code, x, y, z) of each atom."""
        lib, o, molecule = self.lib, Options(), ctypes.c_void_p()
        lib.ovoid_read_options_init(ctypes.byref(o), ctypes.c_size_t(ctypes.sizeof(o)))
        for key, value in options.items():
            setattr(o, key, value.encode() if isinstance(value, str) else value)
        if lib.ovoid_molecule_read_with(self.context, path.encode(), ctypes.byref(o),
                                        ctypes.byref(molecule)) != 0:
            raise ValueError(lib.ovoid_context_error(self.context).decode())
        count = ctypes.c_size_t()
        xyzr = lib.ovoid_molecule_xyzr(molecule)
        atoms = lib.ovoid_molecule_identity(molecule)
        residues = lib.ovoid_molecule_residues(molecule, ctypes.byref(count))
        result = []
        for i in range(lib.ovoid_molecule_atoms(molecule)):
            a = atoms[lib.ovoid_molecule_origin(molecule, ctypes.c_size_t(i), None)]
            r = residues[a.residue]
            result.append((a.name.decode(), a.element.decode(), r.name.decode(), r.chain.decode(),
                           r.number, r.insertion.decode().strip("\0"), *xyzr[4 * i:4 * i + 3]))
        lib.ovoid_molecule_destroy(ctypes.byref(molecule))
        return result


def listed(model):
    """The same of a model of gemmi's."""
    return [(a.name, "" if a.element.name == "X" else a.element.name, r.name, c.name, r.seqid.num,
             r.seqid.icode.strip(), *a.pos) for c in model for r in c for a in r]


def key(atom):
    return atom[:6] + tuple(round(x, 2) for x in atom[6:])


def compare(what, ours, theirs, names=True):
    """Both lists hold the same atoms, in any order; places to 0.01 angstrom."""
    if len(ours) != len(theirs):
        sys.exit(f"{what}: {len(ours)} atoms, of gemmi {len(theirs)}")
    if not names:
        ours, theirs = [a[6:] for a in ours], [a[6:] for a in theirs]
        for a, b in zip(sorted(ours), sorted(theirs)):
            if max(abs(p - q) for p, q in zip(a, b)) > 0.01:
                sys.exit(f"{what}: {a}, of gemmi {b}")
        return
    for a, b in zip(sorted(ours, key=key), sorted(theirs, key=key)):
        if a[:6] != b[:6] or max(abs(p - q) for p, q in zip(a[6:], b[6:])) > 0.01:
            sys.exit(f"{what}: {a}, of gemmi {b}")


def conformers(structure):
    """Without waters; where a residue has conformers that differ in occupancy, gemmi's choice is not
    ours, so these files are compared by number of atoms alone."""
    structure.remove_waters()
    alternative = any(a.has_altloc() for m in structure for c in m for r in c for a in r)
    structure.remove_alternative_conformations()
    structure.remove_empty_chains()
    return alternative


def check_file(ovoid, path):
    try:
        structure = gemmi.read_structure(path)
    except RuntimeError as error:
        print(f"{os.path.basename(path)}: {len(ovoid.read(path))} atoms, not read by gemmi: {error}")
        return
    if len(structure) == 0 or structure[0].count_atom_sites() == 0:
        return
    everything = gemmi.read_structure(path)
    alternative = conformers(structure)
    base = os.path.basename(path)
    if len(structure) == 0 or structure[0].count_atom_sites() == 0:  # nothing but waters
        compare(f"{base} waters", ovoid.read(path, waters=True), listed(everything[0]))
        return
    ours, theirs = ovoid.read(path), listed(structure[0])
    if alternative:
        assert len(ours) == len(theirs), f"{base}: {len(ours)} atoms, of gemmi {len(theirs)}"
    else:
        compare(base, ours, theirs)
        for text in ("[C]", "A/5-20", "(ALA,GLY)", "//A//CA", ";b>20"):
            chosen = gemmi.Selection(text)
            copy = structure.clone()
            chosen.remove_not_selected(copy)
            atoms = listed(copy[0]) if len(copy) else []
            try:
                found = ovoid.read(path, select=text)
            except ValueError as error:
                if atoms or "no atoms left" not in str(error):
                    raise
                found = []
            compare(f"{base} {text}", found, atoms)
    if len(everything) > 1:
        last = len(everything)
        compare(f"{base} model {last}", ovoid.read(path, model=last), listed(everything[last - 1]))
    for assembly in everything.assemblies:
        if len(structure[0]) == 0 or alternative:
            continue
        made = gemmi.make_assembly(assembly, structure[0], gemmi.HowToNameCopiedChain.Dup)
        ours = ovoid.read(path, assembly=assembly.name)
        compare(f"{base} assembly {assembly.name}", ours, listed(made))
        print(f"{base} assembly {assembly.name}: {len(ours)} atoms")
    print(f"{base}: {len(theirs)} atoms")


BIOMT = """\
REMARK 350 BIOMOLECULE: 1
REMARK 350 APPLY THE FOLLOWING TO CHAINS: A
REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000
REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000
REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000
REMARK 350   BIOMT1   2 -1.000000  0.000000  0.000000       10.00000
REMARK 350   BIOMT2   2  0.000000 -1.000000  0.000000       20.00000
REMARK 350   BIOMT3   2  0.000000  0.000000  1.000000       30.00000
REMARK 350 APPLY THE FOLLOWING TO CHAINS: B,
REMARK 350                    AND CHAINS: C
REMARK 350   BIOMT1   3  0.000000 -1.000000  0.000000        1.00000
REMARK 350   BIOMT2   3  1.000000  0.000000  0.000000        2.00000
REMARK 350   BIOMT3   3  0.000000  0.000000  1.000000        3.00000
REMARK 350 BIOMOLECULE: 2
REMARK 350 APPLY THE FOLLOWING TO CHAINS: C
REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000
REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000
REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000
"""


def pdb_atom(serial, name, residue, chain, number, x, element):
    return (f"ATOM  {serial:5d} {name:<4s} {residue:3s} {chain}{number:4d}    {x:8.3f}{1.5:8.3f}"
            f"{-2.5:8.3f}{1:6.2f}{20:6.2f}          {element:>2s}\n")


def check_generators(ovoid, folder):
    """Different operators for different chains."""
    path = os.path.join(folder, "generators.pdb")
    with open(path, "w", encoding="ascii") as file:
        file.write(BIOMT)
        for i, chain in enumerate("AABCD"):
            file.write(pdb_atom(i + 1, " CA", "ALA", chain, i + 1, i * 4.0, "C"))
        file.write("END\n")
    check_file(ovoid, path)
    atoms = ovoid.read(path, assembly="1")
    assert [a[3] for a in atoms] == list("AAAABC"), atoms
    assert [round(a[6], 3) for a in atoms] == [0, 4, 10, 6, -0.5, -0.5], atoms


CIF = """\
data_test
loop_
_pdbx_struct_assembly_gen.assembly_id
_pdbx_struct_assembly_gen.oper_expression
_pdbx_struct_assembly_gen.asym_id_list
1 '(1,2)(X,3)' A,B
2 1,3 A
2 '(2-3)' B
loop_
_pdbx_struct_oper_list.id
_pdbx_struct_oper_list.matrix[1][1]
_pdbx_struct_oper_list.matrix[1][2]
_pdbx_struct_oper_list.matrix[1][3]
_pdbx_struct_oper_list.vector[1]
_pdbx_struct_oper_list.matrix[2][1]
_pdbx_struct_oper_list.matrix[2][2]
_pdbx_struct_oper_list.matrix[2][3]
_pdbx_struct_oper_list.vector[2]
_pdbx_struct_oper_list.matrix[3][1]
_pdbx_struct_oper_list.matrix[3][2]
_pdbx_struct_oper_list.matrix[3][3]
_pdbx_struct_oper_list.vector[3]
1 1 0 0 0 0 1 0 0 0 0 1 0
2 0 -1 0 5 1 0 0 6 0 0 1 7
3 1 0 0 100 0 1 0 200 0 0 1 300
X -1 0 0 0 0 -1 0 0 0 0 1 0
loop_
_atom_site.id
_atom_site.type_symbol
_atom_site.label_atom_id
_atom_site.label_alt_id
_atom_site.label_comp_id
_atom_site.label_asym_id
_atom_site.auth_asym_id
_atom_site.auth_seq_id
_atom_site.Cartn_x
_atom_site.Cartn_y
_atom_site.Cartn_z
_atom_site.occupancy
_atom_site.B_iso_or_equiv
1 C "C1'" . LIG A Z 1 1.0 2.0 3.0 1 20
2 O O2 . LIG B Z 2 4.0 5.0 6.0 1 20
"""


def check_products(ovoid, folder):
    """Products of operators, which gemmi passes over: the right one is applied first."""
    path = os.path.join(folder, "products.cif")
    with open(path, "w", encoding="ascii") as file:
        file.write(CIF)
    places = [tuple(round(x, 6) for x in a[6:]) for a in ovoid.read(path, assembly="1")]
    operators = {"1": lambda p: p, "2": lambda p: (5 - p[1], 6 + p[0], 7 + p[2]),
                 "3": lambda p: (p[0] + 100, p[1] + 200, p[2] + 300),
                 "X": lambda p: (-p[0], -p[1], p[2])}
    unit = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    expected = [operators[left](operators[right](p)) for left in "12" for right in "X3"
                for p in unit]
    assert places == expected, (places, expected)
    places = [tuple(a[6:]) for a in ovoid.read(path, assembly="2")]
    assert places == [unit[0], operators["3"](unit[0]), operators["2"](unit[1]),
                      operators["3"](unit[1])], places


def check_pqr_assemblies(ovoid, folder, molecules):
    """REMARK 350 in a PQR's header: gemmi reads the same lines in front of one atom."""
    for name in ("1ihm_asu.pqr.gz",):
        path = os.path.join(molecules, name)
        if not os.path.exists(path):
            continue
        with gzip.open(path, "rt") as file:
            remarks = [line for line in file if line.startswith("REMARK 350")]
        pdb = os.path.join(folder, "remarks.pdb")
        with open(pdb, "w", encoding="ascii") as file:
            file.writelines(remarks)
            file.write(pdb_atom(1, " CA", "ALA", "A", 1, 7.0, "C") + "END\n")
        assembly = gemmi.read_structure(pdb).assemblies[0]
        operators = [o.transform for g in assembly.generators for o in g.operators]
        ours = ovoid.read(path, assembly="1")
        unit = ovoid.read(path)
        assert len(ours) == len(unit) * len(operators) == 1336860, len(ours)
        for i, operator in enumerate(operators):
            for k in (0, len(unit) // 2, len(unit) - 1):
                place = operator.apply(gemmi.Vec3(*unit[k][6:])).tolist()
                atom = ours[i * len(unit) + k]
                assert max(abs(p - q) for p, q in zip(place, atom[6:])) < 1e-6, (i, k)
        print(f"{name} assembly 1: {len(ours)} atoms")


def main():
    ovoid = Ovoid(sys.argv[1])
    molecules = os.environ.get("OVOID_MOLECULES") or sys.argv[2]
    files = glob.glob("/usr/share/pymol/data/**/*.pdb", recursive=True)
    for pattern in ("*.pdb", "*.pdb.gz", "*.cif", "*.cif.gz"):
        files += glob.glob(os.path.join(molecules, pattern))
    with tempfile.TemporaryDirectory() as folder:
        check_generators(ovoid, folder)
        check_products(ovoid, folder)
        check_pqr_assemblies(ovoid, folder, molecules)
    for path in sorted(files):
        check_file(ovoid, path)


main()
