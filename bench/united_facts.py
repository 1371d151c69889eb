"""Which hydrogens the atoms of standard residues have at pH 7, and the C table made of that.

HIS is neutral with its hydrogen on NE2, ASP and GLU are bare, LYS and ARG carry their proton, CYS is a
thiol (CYX in a disulfide). What the ends of chains add is in host/molecule/united.c.
"""

import os

# Atom names, each with its number of hydrogens where it has any: CB:2.
BACKBONE = {
    "amino": "N:1 CA:1 C O OXT",
    "rna": "P OP1 OP2 OP3 O5' C5':2 C4':1 O4' C3':1 O3' C2':1 O2':1 C1':1",
    "dna": "P OP1 OP2 OP3 O5' C5':2 C4':1 O4' C3':1 O3' C2':2 C1':1",
    "other": "",
}

AMINO = {
    "ALA": "CB:3",
    "ARG": "CB:2 CG:2 CD:2 NE:1 CZ NH1:2 NH2:2",
    "ASH": "CB:2 CG OD1 OD2:1",
    "ASN": "CB:2 CG OD1 ND2:2",
    "ASP": "CB:2 CG OD1 OD2",
    "CYS": "CB:2 SG:1",
    "CYX": "CB:2 SG",
    "GLH": "CB:2 CG:2 CD OE1 OE2:1",
    "GLN": "CB:2 CG:2 CD OE1 NE2:2",
    "GLU": "CB:2 CG:2 CD OE1 OE2",
    "GLY": "CA:2",
    "HID": "CB:2 CG ND1:1 CD2:1 CE1:1 NE2",
    "HIP": "CB:2 CG ND1:1 CD2:1 CE1:1 NE2:1",
    "HIS": "CB:2 CG ND1 CD2:1 CE1:1 NE2:1",
    "ILE": "CB:1 CG1:2 CG2:3 CD1:3 CD:3",
    "LEU": "CB:2 CG:1 CD1:3 CD2:3",
    "LYN": "CB:2 CG:2 CD:2 CE:2 NZ:2",
    "LYS": "CB:2 CG:2 CD:2 CE:2 NZ:3",
    "MET": "CB:2 CG:2 SD CE:3",
    "MSE": "CB:2 CG:2 SE CE:3",
    "PHE": "CB:2 CG CD1:1 CD2:1 CE1:1 CE2:1 CZ:1",
    "PRO": "N CB:2 CG:2 CD:2",
    "SEC": "CB:2 SE:1",
    "SER": "CB:2 OG:1",
    "THR": "CB:1 OG1:1 CG2:3",
    "TRP": "CB:2 CG CD1:1 CD2 NE1:1 CE2 CE3:1 CZ2:1 CZ3:1 CH2:1",
    "TYR": "CB:2 CG CD1:1 CD2:1 CE1:1 CE2:1 CZ OH:1",
    "VAL": "CB:1 CG1:3 CG2:3",
}

BASES = {
    "A": "N9 C8:1 N7 C5 C6 N6:2 N1 C2:1 N3 C4",
    "C": "N1 C2 O2 N3 C4 N4:2 C5:1 C6:1",
    "G": "N9 C8:1 N7 C5 C6 O6 N1:1 C2 N2:2 N3 C4",
    "I": "N9 C8:1 N7 C5 C6 O6 N1:1 C2:1 N3 C4",
    "T": "N1 C2 O2 N3:1 C4 O4 C5 C7:3 C5M:3 C6:1",
    "U": "N1 C2 O2 N3:1 C4 O4 C5:1 C6:1",
}

OTHER = {
    "ACE": "C O CH3:3",
    "HOH": "O:2",
    "NH2": "N:2",
    "NME": "N:1 C:3 CH3:3",
}

# Other spellings.
SAME = {
    "HIE": "HIS", "HSE": "HIS", "HSD": "HID", "HSP": "HIP", "CYM": "CYX",
    "ADE": "A", "CYT": "C", "GUA": "G", "INO": "I", "URA": "U", "RA": "A", "RC": "C", "RG": "G",
    "RI": "I", "RU": "U", "THY": "DT",
    "DOD": "HOH", "H2O": "HOH", "SOL": "HOH", "TIP": "HOH", "TIP3": "HOH", "WAT": "HOH",
}  # fmt: skip


def atoms_of(text):
    """'CB:2 CG' -> {'CB': 2, 'CG': 0}"""
    return {name: int(count or 0) for name, _, count in (word.partition(":") for word in text.split())}


def residues():
    """name -> (kind, atoms of its own); the others are those of the kind's backbone."""
    made = {name: ("amino", atoms_of(text)) for name, text in AMINO.items()}
    made.update({name: ("other", atoms_of(text)) for name, text in OTHER.items()})
    made.update({name: ("rna", atoms_of(text)) for name, text in BASES.items()})
    made.update({"D" + name: ("dna", atoms_of(text)) for name, text in BASES.items()})
    return made


KNOWN = residues()
KINDS = {kind: atoms_of(text) for kind, text in BACKBONE.items()}


def hydrogens(residue, atom):
    """As ov_united_hydrogens() without ends of chains; None where unknown."""
    residue = SAME.get(residue, residue)
    if residue not in KNOWN:
        return None
    kind, own = KNOWN[residue]
    atom = {"O1P": "OP1", "O2P": "OP2", "O3P": "OP3"}.get(atom, atom).replace("*", "'")
    return own.get(atom, KINDS[kind].get(atom))


HEAD = """/*
 * Facts and values for united.c, written by bench/calibrate_radii.py; docs/radii.md tells how.
 */
#include "molecule/united_table.h"
"""


def rows_of(name, rows, kind, remark):
    lines = ",\n".join("    {" + ", ".join(row) + "}" for row in rows)
    return (f"\n/* {remark} */\nconst {kind} {name}[] = {{\n{lines},\n}};\n"
            f"const size_t {name}_count = sizeof {name} / sizeof {name}[0];\n")


def quoted(text):
    return f'"{text}"'


def write_table(path, radii):
    """radii: element -> list of radii by number of hydrogens."""
    names = sorted(set(KNOWN) | set(SAME))
    same = {name: SAME.get(name, name) for name in names}
    text = HEAD + rows_of(
        "ov_united_residues",
        [(quoted(name), quoted(same[name]), quoted("=" + KNOWN[same[name]][0])) for name in names],
        "ov_united_residue",
        "Sorted by name. Atoms that are not the residue's own are those of its backbone.")
    atoms = [(name, atom, count) for name, (_, own) in KNOWN.items() for atom, count in own.items()]
    atoms += [("=" + kind, atom, count) for kind, own in KINDS.items() for atom, count in own.items()]
    text += rows_of("ov_united_atoms",
                    [(quoted(name), quoted(atom), str(count)) for name, atom, count in sorted(atoms)],
                    "ov_united_atom", "Sorted by residue and atom: bonded hydrogens at pH 7.")
    text += rows_of("ov_united_elements",
                    [(quoted(element), str(len(values)), str(1 if element in "CN" else 0),
                      "{" + ", ".join(f"{value:.3f}" for value in values) + "}")
                     for element, values in sorted(radii.items())],
                    "ov_united_element",
                    "Radii in angstrom of an atom that stands for 0, 1, 2 ... hydrogens too.")
    with open(path + ".part", "w", encoding="utf-8") as out:
        out.write(text)
    os.replace(path + ".part", path)
