#!/usr/bin/env python3
"""Seconds and peak memory per atom of `ovoid fit`, from hundreds of atoms to 1,336,860.

    scaling.py --molecules DIR [--molecules DIR]... [--ovoid build/release/ovoid] [--ratio 0.066]
               [--runs 3] [--up-to ATOMS] [--output bench/results/scaling.csv] [--picture FILE]
    scaling.py --from bench/results/scaling.csv --picture docs/scaling.png

Fits the molecules of MOLECULES that a DIR holds, at one number of ellipsoids per atom; NAME:N is the
first N copies that the file's REMARK 350 lines place, as a plain file without its symmetry. Every
program runs once before it counts, so that the kernels are in their cache; of the --runs after that
the fastest counts, by stage. Molecules of more than ONCE atoms run once, and that run counts. Memory
is the largest resident set of the process less that of a fit of CONSTANT, which is the program, its
libraries and the compiler of kernels. --picture needs matplotlib.

One more molecule, of some 500 atoms, is timed as a whole process, start and measuring included: with
the same ratio, and without any options.
"""

import argparse
import collections
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

from common import read_atoms, read_placements, read_table, short, write_table

MOLECULES = ("FAS2.pqr", "AChE.pqr", "misc/achbp.pqr", "6xm4.xyzr.gz", "1aon.pqr.gz",
             "1ihm_asu.pqr.gz:12", "1ihm_asu.pqr.gz:60")
ONCE = 100000
CONSTANT = "DIALA.pqr"  # 20 atoms
SMALL = "1MAG.pqr"
FROM, TO = "AChE.pqr", "1aon.pqr.gz"  # whose seconds per atom are compared
STAGES = ("sample", "fit", "measure")
COLUMNS = (
    "molecule goal atoms ellipsoids points iterations hausdorff_outer mean_distance_outer "
    "sample_seconds fit_seconds measure_seconds process_seconds microseconds_per_atom "
    "sample_microseconds_per_atom fit_microseconds_per_atom measure_microseconds_per_atom "
    "peak_mib bytes_per_atom"
).split()

Result = collections.namedtuple("Result", "report seconds peak")  # peak in bytes


def run(ovoid, arguments):
    """Runs a fit, which must succeed: its report, the seconds of the process, and its peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        command = [ovoid, "fit", *arguments, "--quiet", "--report", report]
        command += ["-o", os.path.join(folder, "model.ovoid")]
        began = time.perf_counter()
        process = subprocess.Popen(command)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            raise subprocess.CalledProcessError(process.returncode, command)
        with open(report, encoding="utf-8") as text:
            return Result(json.load(text), seconds, usage.ru_maxrss * 1024)


def repeat(ovoid, arguments, count, up_to=sys.maxsize):
    """Results of so many runs after one that does not count, or of one of a large molecule; none for
    a molecule that is too large."""
    first = run(ovoid, arguments)
    if first.report["atoms"] > up_to:
        return []
    if first.report["atoms"] > ONCE:
        return [first]
    return [run(ovoid, arguments) for _ in range(count)]


def row_of(name, goal, results, constant):
    report = results[0].report
    atoms = report["atoms"]
    peak = statistics.median(result.peak for result in results)
    row = {
        "molecule": name,
        "goal": goal,
        "process_seconds": min(result.seconds for result in results),
        "peak_mib": peak / 2**20,
        "bytes_per_atom": (peak - constant) / atoms,
    }
    for key in "atoms ellipsoids points iterations hausdorff_outer mean_distance_outer".split():
        row[key] = report.get(key, "")  # a model without a surface has no distance
    total = 0.0
    for stage in STAGES:
        seconds = min(result.report["seconds"][stage] for result in results)
        row[stage + "_seconds"] = seconds
        row[stage + "_microseconds_per_atom"] = 1e6 * seconds / atoms
        total += seconds
    row["microseconds_per_atom"] = 1e6 * total / atoms
    return row


def print_heading():
    print(f"{'':57}{'seconds':>32}{'µs per atom':>32}")
    print(f"{'molecule':16}{'goal':>12}{'atoms':>8}{'ellipsoids':>11}{'points':>10}"
          f"{'sample':>8}{'fit':>8}{'measure':>8}{'process':>8}"
          f"{'all':>8}{'sample':>8}{'fit':>8}{'measure':>8}{'MiB':>8}{'B/atom':>8}", flush=True)


def print_row(row):
    print(f"{row['molecule']:16}{row['goal']:>12}{row['atoms']:8}{row['ellipsoids']:11}"
          f"{row['points']:10}"
          + "".join(f"{row[stage + '_seconds']:8.2f}" for stage in STAGES)
          + f"{row['process_seconds']:8.2f}{row['microseconds_per_atom']:8.0f}"
          + "".join(f"{row[stage + '_microseconds_per_atom']:8.0f}" for stage in STAGES)
          + f"{row['peak_mib']:8.0f}{row['bytes_per_atom']:8.0f}", flush=True)


def print_growth(rows):
    found = {row["molecule"]: row for row in rows}
    if FROM not in found or TO not in found:
        return
    first, last = found[FROM], found[TO]
    for label, key in [("all", "microseconds_per_atom")] + [
            (stage, stage + "_microseconds_per_atom") for stage in STAGES]:
        print(f"seconds per atom at {last['atoms']} atoms over those at {first['atoms']}, {label}: "
              f"{last[key] / first[key]:.2f}")


def locate(folders, name, made):
    """The path of NAME, or of the copies that NAME:N asks for, which are put into the folder `made`."""
    name, _, copies = name.partition(":")
    for folder in folders:
        path = os.path.join(folder, name)
        if os.path.exists(path):
            return place_copies(path, int(copies), made) if copies else path
    return None


def place_copies(path, copies, folder):
    """Writes the first so many copies of a PQR file's atoms that its REMARK 350 lines place."""
    atoms = read_atoms(path)
    made = os.path.join(folder, f"{os.path.basename(path).split('.')[0]}-{copies}.xyzr")
    with open(made, "w", encoding="utf-8") as out:
        for placement in read_placements(path)[:copies]:
            for x, y, z, radius in atoms:
                at = [a * x + b * y + c * z + d for a, b, c, d in placement]
                out.write("{:.3f} {:.3f} {:.3f} {:.4f}\n".format(*at, radius))
    return made


def draw(rows, path):
    """Microseconds and bytes per atom against the number of atoms."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    rows = [row for row in rows if row["goal"].startswith("ratio") and row["molecule"] != CONSTANT]
    rows.sort(key=lambda row: int(row["atoms"]))
    atoms = [int(row["atoms"]) for row in rows]
    figure, panes = plt.subplots(1, 2, figsize=(9, 3.4), constrained_layout=True)
    lines = (("sampling and fit", ("sample", "fit"), "o-", "#d55e00"),
             ("measures", ("measure",), "^--", "#009e73"))  # parts are sampled as they are fitted
    for label, stages, mark, colour in lines:
        values = [sum(float(row[stage + "_microseconds_per_atom"]) for stage in stages)
                  for row in rows]
        panes[0].plot(atoms, values, mark, color=colour, label=label, markersize=4)
    panes[0].set(xscale="log", xlabel="atoms", ylabel="µs per atom", ylim=(0, None))
    panes[0].legend(frameon=False)
    values = [float(row["bytes_per_atom"]) for row in rows]
    panes[1].plot(atoms, values, "o-", color="#0072b2", markersize=4)
    panes[1].set(xscale="log", yscale="log", xlabel="atoms",
                 ylabel="peak memory, bytes per atom")
    for pane in panes:
        pane.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--molecules", action="append", default=[], metavar="DIR")
    parser.add_argument("--names", default=",".join(MOLECULES))
    parser.add_argument("--ratio", type=float, default=0.066)
    parser.add_argument("--effort", type=int, default=0, help="default 0, as in parts")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--up-to", type=int, default=sys.maxsize, metavar="ATOMS")
    parser.add_argument("--output", metavar="FILE")
    parser.add_argument("--from", dest="table", metavar="FILE", help="only draw what is recorded")
    parser.add_argument("--picture", metavar="FILE")
    return parser.parse_args()


def measure(arguments, folder):
    constant = locate(arguments.molecules, CONSTANT, folder)
    if constant is None:
        sys.exit(f"scaling.py: no {CONSTANT} in {', '.join(arguments.molecules)}")
    goal = ["--ratio", str(arguments.ratio), "--effort", str(arguments.effort)]
    jobs = [(name, "ratio " + goal[1], goal) for name in arguments.names.split(",")]
    jobs += [(SMALL, "ratio " + goal[1], goal), (SMALL, "default", [])]
    results = repeat(arguments.ovoid, [constant, *goal], arguments.runs)
    base = statistics.median(result.peak for result in results)
    report = results[0].report
    print_heading()
    rows = [row_of(CONSTANT, "ratio " + goal[1], results, base)]
    print_row(rows[0])
    for name, label, options in jobs:
        path = locate(arguments.molecules, name, folder)
        if path is None:
            print(f"{name}: not found")
            continue
        results = repeat(arguments.ovoid, [path, *options], arguments.runs, arguments.up_to)
        if results:
            report = results[0].report
            rows.append(row_of(name, label, results, base))
            print_row(rows[-1])
    print_growth(rows)
    if arguments.output:
        comment = f"ovoid {report['version']}, {report['device']}; bench/scaling.py"
        write_table(arguments.output, comment, COLUMNS,
                    [{key: short(value) for key, value in row.items()} for row in rows])
    return rows


def main():
    arguments = parse()
    if arguments.table:
        rows = read_table(arguments.table)
    else:
        with tempfile.TemporaryDirectory() as folder:
            rows = measure(arguments, folder)
    if arguments.picture:
        draw(rows, arguments.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
