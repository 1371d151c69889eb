#!/usr/bin/env python3
"""What reading structures comes to, beside gemmi: one row per file of a folder.

    bench/structures.py --read build/release/bench/read --molecules DIR [--csv FILE]

Atoms of the file's first model without waters and with one conformer of each residue, how many were
left out, where radii came from, seconds, and the largest memory of a process that reads the file and
nothing else, also less what the empty process has, per atom. gemmi's are those of a process that
reads the file into a gemmi.Structure; where it finds no atoms in an mmCIF file (it wants more
columns than they need to have), of one that reads it into a gemmi.cif.Document. Needs
python3-gemmi. Each number is the least of three runs.
"""

import argparse
import glob
import json
import os
import subprocess
import sys

import common

COLUMNS = ["file", "atoms", "gemmi_atoms", "skipped", "waters", "altlocs", "other_models",
           "zero_occupancy", "hydrogens", "radii", "guessed", "seconds", "peak_mb",
           "bytes_per_atom", "gemmi_seconds", "gemmi_peak_mb", "gemmi_by"]

# Prints what gemmi makes of a file, seconds, peak memory in KiB, and what it had before.
GEMMI = """
import json, re, sys, time
import gemmi
peak = lambda: int(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1])
before, began, by = peak(), time.perf_counter(), "Structure"
atoms = None
try:
    st = gemmi.read_structure(sys.argv[1])
    found = len(st) > 0 and st[0].count_atom_sites() > 0
except (RuntimeError, ValueError):
    found = False
if not found and ".cif" in sys.argv[1]:
    by, began = "Document", time.perf_counter()
    document = gemmi.cif.read(sys.argv[1])
    seconds, kib = time.perf_counter() - began, peak()
    atoms = len(document[0].find_loop("_atom_site.Cartn_x"))
else:
    seconds, kib = time.perf_counter() - began, peak()
    if found:
        st.remove_waters()
        st.remove_alternative_conformations()
        atoms = st[0].count_atom_sites()
    else:
        by = "fails"
print(json.dumps({"atoms": atoms, "seconds": seconds, "peak_kib": kib, "before_kib": before, "by": by}))
"""


def run(command):
    """The JSON that a command prints, None where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stderr.strip(), file=sys.stderr)
        return None
    return json.loads(done.stdout)


def least(command, repeats=3):
    """The first run's answer with the least seconds and memory of several."""
    runs = [run(command) for _ in range(repeats)]
    if None in runs:
        return None
    best = dict(runs[0])
    for key in ("seconds", "peak_kib"):
        best[key] = min(r[key] for r in runs)
    return best


def row_of(read, path):
    ours = least([read, path])
    theirs = None
    if ".xyzr" not in path and ".pqr" not in path:
        theirs = least([sys.executable, "-c", GEMMI, path])
    if not ours:
        return None
    row = {"file": os.path.basename(path), "seconds": f"{ours['seconds']:.3f}",
           "peak_mb": f"{ours['peak_kib'] / 1024:.1f}",
           "bytes_per_atom": round((ours["peak_kib"] - ours["before_kib"]) * 1024 / ours["atoms"])}
    row.update({key: ours[key] for key in COLUMNS if key in ours and key not in row})
    if theirs:
        row.update({"gemmi_atoms": theirs["atoms"], "gemmi_seconds": f"{theirs['seconds']:.3f}",
                    "gemmi_peak_mb": f"{theirs['peak_kib'] / 1024:.1f}", "gemmi_by": theirs["by"]})
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--read", required=True, help="the program bench/read")
    parser.add_argument("--molecules", required=True, help="a folder of structure files")
    parser.add_argument("--csv", help="write the table here (bench/results/structures.csv)")
    arguments = parser.parse_args()
    files = [path for path in sorted(glob.glob(os.path.join(arguments.molecules, "*")))
             if path.removesuffix(".gz").endswith((".pdb", ".ent", ".cif", ".mmcif", ".pqr", ".xyzr"))]
    rows = [row for path in files if (row := row_of(arguments.read, path))]
    print("  ".join(COLUMNS))
    for row in rows:
        print("  ".join(str(row.get(column, "-")) for column in COLUMNS))
    if arguments.csv:
        common.write_table(arguments.csv, "reading structures: bench/structures.py", COLUMNS, rows)


main()
