#!/usr/bin/env python3
"""Where the device's time goes in `ovoid fit`: seconds and launches of each kernel.

    kernel_times.py --ovoid build/release/ovoid [--goals ellipsoids=545,default] [--device SELECTOR]
               [--output bench/results/kernel_times.csv] MOLECULE...
    kernel_times.py --ovoid build/release/ovoid --molecules DIR

Fits each MOLECULE (default: AChE of the folder DIR) for each goal: `default`, or the name and value of one
(`ellipsoids=545`, `tolerance=0.3`, `ratio=0.05`). Prints a table and the share of the fit's wall time that
is not in the field operations, and writes a CSV. Run nothing else beside it.
"""

import argparse
import os
import sys

from common import find, report_of, short, write_table

COLUMNS = "molecule goal kernel launches seconds share".split()
# The sums over pairs of points and ellipsoids.
OPERATIONS = ("field", "field_polynomial", "moments", "gram")
GOAL_MISSED = 7  # an exit code of the tool: there is a model, and it took its time
REST, WHOLE = "(all else)", "(fit)"


def name_of(path):
    name = os.path.basename(path)
    for extension in (".gz", ".pqr", ".xyzr"):
        name = name.removesuffix(extension)
    return name


def options_of(goal):
    if goal == "default":
        return []
    option, equals, value = goal.partition("=")
    if option not in ("ellipsoids", "tolerance", "ratio") or not equals:
        sys.exit(f"kernel_times.py: no goal '{goal}': default, ellipsoids=N, tolerance=X or ratio=X")
    return ["--" + option, value] + (["--effort", "0"] if option != "tolerance" else [])


def fit(arguments, path, goal):
    command = ["fit", path, "--profile", "--no-measure", "-o", os.devnull] + options_of(goal)
    if arguments.device:
        command += ["--device", arguments.device]
    return report_of(arguments.ovoid, command, (0, GOAL_MISSED))


def rows_of(path, goal, report):
    """A row per kernel, one of all else and one of the whole."""
    whole = report["seconds"]["sample"] + report["seconds"]["fit"]
    kernels = report["kernels"]
    if any(kernel["seconds"] is None for kernel in kernels):
        sys.exit(f"kernel_times.py: the driver of {report['device']} does not tell the times of kernels")
    rest = whole - sum(kernel["seconds"] for kernel in kernels)
    launches = sum(kernel["launches"] for kernel in kernels)
    rows = kernels + [
        {"name": REST, "launches": 0, "seconds": rest},
        {"name": WHOLE, "launches": launches, "seconds": whole},
    ]
    return [
        {
            "molecule": name_of(path),
            "goal": goal,
            "kernel": row["name"],
            "launches": row["launches"],
            "seconds": row["seconds"],
            "share": row["seconds"] / whole,
        }
        for row in rows
    ]


def outside(rows):
    return 1.0 - sum(row["share"] for row in rows if row["kernel"] in OPERATIONS)


def print_rows(report, rows):
    print(f"{rows[0]['molecule']}, {report['atoms']} atoms, goal {rows[0]['goal']}: "
          f"{report['ellipsoids']} ellipsoids")
    print(f"{'kernel':20}{'launches':>10}{'seconds':>10}{'share %':>9}")
    for row in rows:
        print(f"{row['kernel']:20}{row['launches']:10}{row['seconds']:10.3f}{100 * row['share']:9.1f}")
    print(f"outside {', '.join(OPERATIONS)}: {100 * outside(rows):.1f} %\n", flush=True)


def molecules_of(arguments):
    if arguments.molecule:
        return arguments.molecule
    path = find(arguments.molecules, "AChE") if arguments.molecules else None
    if path is None:
        sys.exit("kernel_times.py: which molecule? Name files, or a folder with AChE.pqr (--molecules DIR)")
    return [path]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--molecules")
    parser.add_argument("--goals", default="ellipsoids=545,default")
    parser.add_argument("--device")
    parser.add_argument("--output")
    parser.add_argument("molecule", nargs="*")
    arguments = parser.parse_args()

    table, report = [], None
    for path in molecules_of(arguments):
        for goal in arguments.goals.split(","):
            report = fit(arguments, path, goal)
            rows = rows_of(path, goal, report)
            print_rows(report, rows)
            table += [{key: short(row[key]) for key in COLUMNS} for row in rows]
    if arguments.output:
        comment = f"ovoid {report['version']}, {report['device']}; bench/kernel_times.py"
        write_table(arguments.output, comment, COLUMNS, table)


if __name__ == "__main__":
    main()
