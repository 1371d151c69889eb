"""What the benchmarks written in Python share: finding molecules, running the tool, tables."""

import csv
import gzip
import json
import os
import subprocess
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
PAPER_MESH = ("--vertices", "linear", "--spacing", "0.5")  # as the paper measures surfaces


def read_table(path):
    """Rows of a CSV file, less its lines that start with '#'."""
    with open(path, encoding="utf-8") as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def write_table(path, comment, columns, rows):
    """The file appears whole or not at all."""
    beside = path + ".part"
    with open(beside, "w", encoding="utf-8", newline="") as out:
        out.write(f"# {comment}\n")
        table = csv.DictWriter(out, columns, extrasaction="ignore", lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    os.replace(beside, path)


def paper_table(number):
    """Rows of Table 1 or 2 of the paper."""
    return read_table(os.path.join(HERE, f"paper_table{number}.csv"))


def paper_counts(column="ellipsoids"):
    """Table 1: molecule -> number of kernels."""
    return {row["molecule"]: int(row[column]) for row in paper_table(1)}


def find(folder, name):
    for extension in (".pqr", ".pqr.gz"):
        path = os.path.join(folder, name + extension)
        if os.path.exists(path):
            return path
    return None


def read_atoms(path):
    """x, y, z and radius of the atoms of a PQR or XYZR file, as lists of floats."""
    with (gzip.open if path.endswith(".gz") else open)(path, "rt", encoding="latin-1") as lines:
        if ".xyzr" in path:
            rows = [line.split()[:4] for line in lines if line.strip() and line[0] != "#"]
        else:
            rows = [line.split()[-5:] for line in lines if line.startswith(("ATOM", "HETATM"))]
            rows = [row[:3] + row[4:] for row in rows]
    return [[float(word) for word in row] for row in rows]


def read_placements(path):
    """The placements of a file's REMARK 350 lines, three rows of four numbers each."""
    rows = {}
    with (gzip.open if path.endswith(".gz") else open)(path, "rt", encoding="latin-1") as lines:
        for line in lines:
            if line.startswith("REMARK 350   BIOMT"):
                row, number, *values = line[18:].split()
                rows.setdefault(int(number), {})[row] = [float(value) for value in values]
    return [[rows[number][row] for row in "123"] for number in sorted(rows)]


def report_of(ovoid, arguments, codes=(0,), seconds=None):
    """Runs the tool, which must exit with one of the codes, in so many seconds at most if it is
    said, and returns its report."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        command = [ovoid] + arguments + ["--quiet", "--report", report]
        code = subprocess.run(command, check=False, timeout=seconds).returncode
        if code not in codes:
            raise subprocess.CalledProcessError(code, command)
        with open(report, encoding="utf-8") as text:
            return json.load(text)


def short(value, digits=4):
    """Floats to so many significant digits, for tables; all else as it is."""
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
