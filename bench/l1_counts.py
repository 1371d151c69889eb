#!/usr/bin/env python3
"""Ellipsoids of `ovoid fit --method l1` beside Table 1 of the paper, and where the time goes.

    l1_counts.py --ovoid build/release/ovoid --molecules DIR [--names DIALA,ADP,1MAG,FAS2,AChE]
                 [--output bench/results/l1_counts.csv]

Fits every molecule of Table 1 that DIR holds as NAME.pqr (or NAME.pqr.gz) with the defaults, prints a
table and writes a CSV. Fits run one after another; run nothing else beside them, for the seconds.
"""

import argparse
import os
import sys

from common import find, paper_counts, report_of, short, write_table

COUNTS = (
    "molecule atoms ellipsoids paper sparse_ratio spacing padding points rms_error max_error "
    "iterations"
).split()
TIMES = (
    "seconds lists_seconds field_seconds moments_seconds host_seconds list_builds field_passes "
    "moments_passes launches"
).split()


def fit(ovoid, path):
    return report_of(ovoid, ["fit", path, "--method", "l1", "--no-measure", "-o", os.devnull])


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
    parser.add_argument("--names", default="DIALA,ADP,1MAG,FAS2,AChE")
    parser.add_argument("--output")
    arguments = parser.parse_args()

    paper = paper_counts()
    rows, report = [], None
    print(f"{'molecule':10}{'atoms':>7}{'spacing':>9}{'padding':>9}{'points':>9}"
          f"{'ellipsoids':>12}{'paper':>7}{'rms':>9}{'largest':>9}{'seconds':>9}")
    for name in arguments.names.split(","):
        path = find(arguments.molecules, name)
        if path is None or name not in paper:
            sys.exit(f"l1_counts.py: no {name}.pqr in {arguments.molecules} or in Table 1")
        report = fit(arguments.ovoid, path)
        row = row_of(name, report, paper[name])
        rows.append(row)
        print(f"{name:10}{row['atoms']:7}{row['spacing']:9}{row['padding']:9}{row['points']:9}"
              f"{row['ellipsoids']:12}{row['paper']:7}{row['rms_error']:9.4f}"
              f"{row['max_error']:9.3f}{row['seconds']:9.1f}", flush=True)
    if arguments.output:
        comment = f"ovoid {report['version']}, {report['device']}; bench/l1_counts.py"
        write_table(arguments.output, comment, COUNTS + TIMES, rows)


if __name__ == "__main__":
    main()
