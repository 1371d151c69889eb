#!/usr/bin/env python3
"""Whole-process time of `ovoid mesh` beside EDTSurf's (Debian package edtsurf), same molecule and spacing.

    mesh_peer.py --ovoid build/release/ovoid [--spacing 0.5] [--runs 5] [--output FILE.csv] MOLECULE.pqr...

EDTSurf (D. Xu, Y. Zhang, PLoS ONE 4 (2009) e8140) makes van der Waals (-s 1) or solvent-excluded (-s 4)
surfaces from a PDB file; the molecule is given to it with the PQR's own columns. The surfaces differ, the
lattice's spacing and the task, from a file of atoms to a file of triangles, do not. The runs take turns.
"""

import argparse
import csv
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

COLUMNS = "molecule atoms spacing program triangles seconds_min seconds_median".split()


def timed(command, folder):
    began = time.perf_counter()
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def triangles(path):
    with open(path, "rb") as ply:
        for line in ply:
            if line.startswith(b"element face"):
                return int(line.split()[2])
    return 0


def compare(ovoid, path, spacing, runs):
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(path, os.path.join(folder, "input.pdb"))
        with open(path, encoding="ascii", errors="replace") as lines:
            atoms = sum(line.startswith(("ATOM", "HETATM")) for line in lines)
        scale = str(1.0 / spacing)
        programs = {
            "ovoid mesh": [ovoid, "mesh", os.path.abspath(path), "-o", "ovoid_mesh.ply", "--quiet",
                           "--spacing", str(spacing)],
            "EDTSurf -s 1": ["EDTSurf", "-i", "input.pdb", "-o", "EDTSurf_-s_1", "-s", "1", "-f", scale],
            "EDTSurf -s 4": ["EDTSurf", "-i", "input.pdb", "-o", "EDTSurf_-s_4", "-s", "4", "-f", scale],
        }
        timed(programs["ovoid mesh"], folder)  # compiles the kernels, once per machine
        seconds = {name: [] for name in programs}
        for _ in range(runs):
            for name, command in programs.items():
                seconds[name].append(timed(command, folder))
        return [{
            "molecule": os.path.basename(path), "atoms": atoms, "spacing": spacing, "program": name,
            "triangles": triangles(os.path.join(folder, name.replace(" ", "_") + ".ply")),
            "seconds_min": round(min(times), 3), "seconds_median": round(statistics.median(times), 3),
        } for name, times in seconds.items()]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--spacing", type=float, default=0.5)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--output")
    parser.add_argument("molecules", nargs="+")
    arguments = parser.parse_args()
    if not shutil.which("EDTSurf"):
        sys.exit("mesh_peer.py: EDTSurf is not installed (Debian package edtsurf)")
    ovoid = shutil.which(arguments.ovoid) or os.path.abspath(arguments.ovoid)
    rows = []
    for path in arguments.molecules:
        rows += compare(ovoid, path, arguments.spacing, arguments.runs)
        for row in rows[-3:]:
            print("  ".join(str(row[key]) for key in COLUMNS), flush=True)
    if arguments.output:
        with open(arguments.output, "w", encoding="utf-8", newline="") as out:
            table = csv.DictWriter(out, COLUMNS, lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
