#!/usr/bin/env python3
"""Ellipsoids of `ovoid fit --method l1` beside Table 1 of the paper, and where the time goes.

    l1_counts.py --ovoid build/release/ovoid --molecules DIR [--names DIALA,ADP,1MAG,FAS2]
                 [--sweep] [--output bench/results/l1_counts.csv]

Fits every molecule of Table 1 that DIR holds as NAME.pqr (or NAME.pqr.gz) with the defaults, prints a
table and writes a CSV. --sweep repeats it for several spacings and paddings, and leaves the times out
of the CSV. Fits run one after another; run nothing else beside them where the seconds matter.
"""

import argparse
import itertools
import os
import sys

from common import find, paper_counts, report_of, short, write_table

SPACINGS = (0.7, 0.8, 1.0, 1.25)
PADDINGS = (2.0, 3.0, 4.0)
COUNTS = (
    "molecule atoms ellipsoids paper sparse_ratio spacing padding points rms_error max_error "
    "iterations"
).split()
TIMES = (
    "seconds lists_seconds field_seconds moments_seconds host_seconds list_builds field_passes "
    "moments_passes launches"
).split()


def fit(ovoid, path, options):
    command = ["fit", path, "--method", "l1", "--no-measure", "-o", os.devnull]
    return report_of(ovoid, command + options)


def row_of(name, report, paper):
    row = {"molecule": name, "paper": paper, "seconds": report["seconds"]["fit"]}
    for key in COUNTS + TIMES:
        if key not in row:
            value = report[key] if key in report else report["profile"][key]
            row[key] = short(value)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--molecules", required=True)
    parser.add_argument("--names", default="DIALA,ADP,1MAG,FAS2")
    parser.add_argument("--sweep", action="store_true")
    parser.add_argument("--output")
    arguments = parser.parse_args()

    paper = paper_counts()
    settings = [()]
    if arguments.sweep:
        settings = list(itertools.product(SPACINGS, PADDINGS))
    rows, report = [], None
    print(f"{'molecule':10}{'atoms':>7}{'spacing':>9}{'padding':>9}{'points':>9}"
          f"{'ellipsoids':>12}{'paper':>7}{'rms':>9}{'largest':>9}{'seconds':>9}")
    for setting in settings:
        options = []
        if setting:
            options = ["--spacing", str(setting[0]), "--padding", str(setting[1])]
        for name in arguments.names.split(","):
            path = find(arguments.molecules, name)
            if path is None or name not in paper:
                sys.exit(f"l1_counts.py: no {name}.pqr in {arguments.molecules} or in Table 1")
            report = fit(arguments.ovoid, path, options)
            row = row_of(name, report, paper[name])
            rows.append(row)
            print(f"{name:10}{row['atoms']:7}{row['spacing']:9}{row['padding']:9}{row['points']:9}"
                  f"{row['ellipsoids']:12}{row['paper']:7}{row['rms_error']:9.4f}"
                  f"{row['max_error']:9.3f}{row['seconds']:9.1f}", flush=True)
    if arguments.output:
        columns = COUNTS if arguments.sweep else COUNTS + TIMES
        comment = f"ovoid {report['version']}, {report['device']}; bench/l1_counts.py"
        write_table(arguments.output, comment, columns, rows)


if __name__ == "__main__":
    main()
