"""Pairs of one structure with and without hydrogens, for calibrate_radii.py.

Most are chains that pdb2pqr protonates; some came with hydrogens of others' making.
"""

import dataclasses
import gzip
import os
import subprocess
import tempfile

import gemmi
import numpy as np
from scipy.spatial import cKDTree

import united_facts

BONDI = {"H": 1.2, "C": 1.7, "N": 1.55, "O": 1.52, "S": 1.8, "P": 1.8}

APBS = "/usr/share/apbs/examples/"
PYMOL = "/usr/share/pymol/data/"

# name, file, chains (all where empty), whether the radii are fitted to it. Files without a folder are in
# --molecules. A .pqr brings its own hydrogens, and so does 1L2Y-nmr.
PAIRS = [
    ("1HPV", PYMOL + "tut/1hpv.pdb", "A", True),
    ("IL2", PYMOL + "demo/il2.pdb", "", True),
    ("1AON-O", "1AON.pdb.gz", "O", True),
    ("1AON-A", "1AON.pdb.gz", "A", True),
    ("1F2N-A", "1F2N.pdb.gz", "A", True),
    ("1TII-A", PYMOL + "demo/1tii.pdb", "A", True),
    ("1TII-C", PYMOL + "demo/1tii.pdb", "C", True),
    ("1TII-D", PYMOL + "demo/1tii.pdb", "D", True),
    *((f"4V5A-{chain}", "4V5A_70S_1.cif.gz", chain, True)
      for chain in "AC AE AK AN AS B0 B5 BD BF BI BO BX".split()),
    ("4V5A-AJ", "4V5A_70S_1.cif.gz", "AJ", True),
    ("4V5A-AY", "4V5A_70S_1.cif.gz", "AY", True),
    ("4V5A-BB", "4V5A_70S_1.cif.gz", "BB", True),
    ("4V5A-AV", "4V5A_70S_1.cif.gz", "AV", True),
    ("1L2Y", "1L2Y.pdb.gz", "A", False),
    ("1CRN", "1CRN.pdb", "A", False),
    ("1FAS", "1FAS.cif", "A", False),
    ("1UBQ", "1UBQ.pdb", "A", False),
    ("1EMA", "1EMA.cif", "A", False),
    ("1F2N-C", "1F2N.pdb.gz", "C", False),
    ("1AON-H", "1AON.pdb.gz", "H", False),
    ("4V5A-BV", "4V5A_70S_1.cif.gz", "BV", False),
    ("4V5A-B7", "4V5A_70S_1.cif.gz", "B7", False),
    ("4V5A-AW", "4V5A_70S_1.cif.gz", "AW", False),
    ("1L2Y-nmr", "1L2Y.pdb.gz", "A", False),
    ("fas2", APBS + "misc/fas2.pqr", "", False),
    ("achbp", APBS + "misc/achbp.pqr", "", False),
    ("mache", APBS + "misc/mache.pqr", "", False),
    ("1d30", APBS + "bem-binding-energy/test_proteins/1d30.pqr", "", False),
]


@dataclasses.dataclass
class Atom:
    chain: str
    number: str
    residue: str
    name: str
    element: str
    place: tuple


def element_of(name):
    return name.lstrip("0123456789")[:1]


def read_pdb(path):
    """Without what old files have behind the temperature factor."""
    with gzip.open(path, "rt") if path.endswith(".gz") else open(path, encoding="utf-8") as text:
        return gemmi.read_pdb_string("".join(line.rstrip("\n")[:66] + "\n" for line in text))


def atoms_of_structure(path):
    """First model, of alternate locations the one with the highest occupancy."""
    structure = gemmi.read_structure(path) if ".cif" in path else read_pdb(path)
    structure.remove_waters()
    best = {}
    for chain in structure[0]:
        for residue in chain:
            for atom in residue:
                key = (chain.name, str(residue.seqid), residue.name, atom.name)
                if key not in best or atom.occ > best[key].occ:
                    best[key] = atom
    return [Atom(*key, atom.element.name, (atom.pos.x, atom.pos.y, atom.pos.z))
            for key, atom in best.items()]


def atoms_of_loop(path):
    """The same of a file whose _atom_site loop has only what coordinates need."""
    with gzip.open(path, "rt") as text:
        block = gemmi.cif.read_string(text.read()).sole_block()
    columns = ["auth_asym_id", "auth_seq_id", "label_comp_id", "label_atom_id", "type_symbol",
               "Cartn_x", "Cartn_y", "Cartn_z"]  # fmt: skip
    rows = ([gemmi.cif.as_string(word) for word in row] for row in block.find("_atom_site.", columns))
    return [Atom(*row[:5], tuple(map(float, row[5:]))) for row in rows]


def atoms_of_pqr(path):
    """Coordinates are the fifth to third words from the end, whether or not there is a chain."""
    atoms = []
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            words = line.split()
            if words and words[0] in ("ATOM", "HETATM"):
                place = tuple(map(float, words[-5:-2]))
                chain = words[4] if len(words) > 10 else ""
                atoms.append(Atom(chain, words[-6], words[3], words[2], element_of(words[2]), place))
    return atoms


LOADED = {}


def load(path):
    """Structures of which several chains are taken are read once."""
    if path not in LOADED:
        is_loop = "4V5A" in path
        LOADED[path] = (atoms_of_loop if is_loop else atoms_of_structure)(path)
    return LOADED[path]


def is_standard(atom):
    return united_facts.KNOWN.get(atom.residue, ("other",))[0] != "other" and atom.residue != "MSE"


def for_pdb2pqr(atoms):
    """Without hydrogens, 5' phosphates, and residues that pdb2pqr does not know or cannot complete."""
    kept = [atom for atom in atoms if atom.element not in "HD" and is_standard(atom)]
    names = {}
    for atom in kept:
        names.setdefault((atom.chain, atom.number), set()).add(atom.name)
    kept = [atom for atom in kept
            if len(names[atom.chain, atom.number] & {"N", "CA", "C", "O", "P", "C4'", "C1'"}) >= 2]
    first = {}
    for atom in kept:
        first.setdefault(atom.chain, atom.number)
    return [atom for atom in kept
            if not (first[atom.chain] == atom.number and atom.name in ("P", "OP1", "OP2", "OP3"))]


def write_pdb(path, atoms):
    with open(path, "w", encoding="utf-8") as out:
        chain, letters = None, {}
        for i, atom in enumerate(atoms):
            if chain is not None and atom.chain != chain:
                out.write("TER\n")
            chain = atom.chain
            letter = letters.setdefault(chain, chr(ord("A") + len(letters) % 26))
            number = atom.number if not atom.number[-1].isdigit() else atom.number + " "
            out.write(f"ATOM  {i + 1:5} {' ' + atom.name if len(atom.name) < 4 else atom.name:<4} "
                      f"{atom.residue:>3} {letter}{number:>5}   "
                      f"{atom.place[0]:8.3f}{atom.place[1]:8.3f}{atom.place[2]:8.3f}"
                      f"  1.00  0.00          {atom.element:>2}\n")
        out.write("TER\nEND\n")


def protonate(atoms, pdb2pqr):
    with tempfile.TemporaryDirectory() as folder:
        source, made = os.path.join(folder, "heavy.pdb"), os.path.join(folder, "all.pqr")
        write_pdb(source, for_pdb2pqr(atoms))
        done = subprocess.run([pdb2pqr, "--ff=AMBER", "--whitespace", "--keep-chain", source, made],
                              capture_output=True, text=True, check=False)  # fmt: skip
        if done.returncode != 0 or not os.path.exists(made):
            raise RuntimeError(f"pdb2pqr failed:\n{done.stderr[-2000:]}")
        return atoms_of_pqr(made)


class Pair:
    """Places of all atoms, and of each heavy one the element and the hydrogens it stands for."""

    def __init__(self, name, used, atoms, source):
        self.name, self.used, self.source = name, used, source
        atoms = [atom for atom in atoms if atom.element in BONDI]
        self.places = np.array([atom.place for atom in atoms])
        self.elements = [atom.element for atom in atoms]
        self.heavy = [i for i, element in enumerate(self.elements) if element != "H"]
        self.atoms = [atoms[i] for i in self.heavy]
        self.bonded = self.count_bonded()
        self.hydrogens = self.stand_for()

    def count_bonded(self):
        """Hydrogens nearest to each heavy atom."""
        hydrogens = [i for i, element in enumerate(self.elements) if element == "H"]
        distances, owners = cKDTree(self.places[self.heavy]).query(self.places[hydrogens])
        self.stray = int(np.sum(distances > 1.5))
        return np.bincount(owners, minlength=len(self.heavy))

    def stand_for(self):
        """By the table, as for a structure without hydrogens. At the ends of chains, in disulfides and
        unknown residues the program sees what is there; here it is taken from the hydrogens."""
        self.differs = 0
        counts = []
        for atom, bonded in zip(self.atoms, self.bonded):
            known = united_facts.hydrogens(base_name(atom), atom.name)
            if known is None or atom.name in ("N", "SG", "O5'", "O3'", "O5*", "O3*", "OXT"):
                known = int(bonded)
            self.differs += known != bonded
            counts.append(known)
        return counts

    def protonated(self):
        return np.column_stack([self.places, [BONDI[element] for element in self.elements]])

    def bare(self):
        return self.protonated()[self.heavy]

    def united(self, radii):
        values = [radii[atom.element][min(count, len(radii[atom.element]) - 1)]
                  for atom, count in zip(self.atoms, self.hydrogens)]  # fmt: skip
        return np.column_stack([self.places[self.heavy], values])


def base_name(atom):
    """AMBER's names for ends of chains: NALA, DC5, RA3."""
    name = atom.residue
    if len(name) == 4 and name[0] in "NC":
        name = name[1:]
    return name[:-1] if name[-1:] in "35" and name[:-1] in united_facts.KNOWN | united_facts.SAME else name


def find(folder, path):
    return path if os.path.isabs(path) else os.path.join(folder, path)


def make_pair(name, path, chains, used, pdb2pqr):
    if path.endswith(".pqr"):
        return Pair(name, used, atoms_of_pqr(path), "own")
    atoms = [atom for atom in load(path) if not chains or atom.chain == chains]
    if name.endswith("-nmr"):
        return Pair(name, used, atoms, "own")
    return Pair(name, used, protonate(atoms, pdb2pqr), "pdb2pqr")


def make_pairs(folder, pdb2pqr, say):
    """All pairs whose files are there; the others are named."""
    pairs = []
    for name, path, chains, used in PAIRS:
        path = find(folder, path)
        if not os.path.exists(path):
            say(f"{name}: left out, no {path}")
            continue
        pair = make_pair(name, path, chains, used, pdb2pqr)
        say(f"{name}: {len(pair.heavy)} heavy of {len(pair.places)} atoms, the table's hydrogens "
            f"differ for {pair.differs}, {pair.stray} stray hydrogens")
        pairs.append(pair)
    return pairs
