#!/usr/bin/env python3
"""Errors against numbers of ellipsoids: a picture and a table.

    bench/frontier.py --ovoid build/release/ovoid --molecules DIR [--names 1MAG,FAS2,AChE]
                      [--csv FILE] [--picture FILE]
    bench/frontier.py --from bench/results/frontier.csv --picture docs/frontier.png

Of each molecule: `ovoid fit` by count (`--ellipsoids N`) and to tolerances, both at the effort 1, by
count at the effort 0 (`quick`), the paper's model (Tables 1 and 2), and what one would try first,
expectation maximisation: scikit-learn's GaussianMixture of as many components, of POINTS points for each atom drawn from the atoms' Gaussians,
each component with the weight that it has of their integral. Needs numpy, matplotlib and, for that,
scikit-learn (without it those rows are left out).
"""

import argparse
import math
import os
import sys
import tempfile

import numpy as np

from common import (find, paper_counts, paper_table, read_atoms, read_table, report_of, short,
                    write_table)

COUNTS = {"1MAG": (25, 36, 50, 70, 87), "FAS2": (35, 50, 70, 100, 142),
          "AChE": (400, 546, 750, 1100, 1636)}
TOLERANCES = (0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
POINTS = 30  # for each atom
EM_MOST = 142  # components: time and memory of expectation maximisation go with the square of the size
DECAY = 0.5  # angstrom^-2
COLUMNS = ["molecule", "by", "asked", "ellipsoids", "deviation", "mean_distance", "area_error",
           "volume_error"]
LABELS = {"quick": ("Ovoid, by count, effort 0", "#56b4e9", "s:"),
          "count": ("Ovoid, by count", "#0072b2", "s-"),
          "tolerance": ("Ovoid, to a tolerance", "#d55e00", "o-"),
          "em": ("expectation maximisation (scikit-learn)", "#009e73", "^-"),
          "paper": ("the paper", "#000000", "x")}


def row_of(name, by, asked, report, ellipsoids=None):
    """A row from the report of a fit or a measure."""
    row = {"molecule": name, "by": by, "asked": asked,
           "ellipsoids": ellipsoids or report["ellipsoids"], "deviation": report["deviation"],
           "mean_distance": report["mean_distance"], "area_error": report["area"]["error"],
           "volume_error": report["volume"]["error"]}
    return {key: short(value) for key, value in row.items()}


# ---- expectation maximisation --------------------------------------------------------------------


def angles_of(axes):
    """The angles alpha, beta and gamma of the model file whose rotation has these rows."""
    if np.linalg.det(axes) < 0:
        axes[2] = -axes[2]
    cosine = math.hypot(axes[0, 0], axes[1, 0])
    alpha = math.atan2(axes[2, 1], axes[2, 2])
    c, s = math.cos(alpha), math.sin(alpha)
    return (alpha, math.atan2(axes[2, 0], cosine),
            math.atan2(s * axes[0, 2] - c * axes[0, 1], c * axes[1, 1] - s * axes[1, 2]))


def mixture(atoms, count):
    """Lines of a model file: EM of points drawn from the atoms' Gaussians."""
    from sklearn.mixture import GaussianMixture  # not needed for the rest
    random = np.random.default_rng(1)
    heights = np.exp(DECAY * atoms[:, 3] ** 2)
    total = heights.sum() * (math.pi / DECAY) ** 1.5
    drawn = random.choice(len(atoms), POINTS * len(atoms), p=heights / heights.sum())
    points = atoms[drawn, :3] + random.normal(0, math.sqrt(0.5 / DECAY), (len(drawn), 3))
    found = GaussianMixture(count, random_state=1, max_iter=200).fit(points)
    for weight, mean, covariance in zip(found.weights_, found.means_, found.covariances_):
        spread, axes = np.linalg.eigh(covariance)
        amplitude = total * weight / math.sqrt((2 * math.pi) ** 3 * spread.prod())
        numbers = (amplitude, *(0.5 / spread), *mean, *angles_of(axes.T.copy()))
        yield " ".join(f"{value:.9g}" for value in numbers)


def measure_mixture(ovoid, name, path, count):
    with tempfile.TemporaryDirectory() as folder:
        model = os.path.join(folder, "em.ovoid")
        with open(model, "w", encoding="utf-8") as file:
            file.write("# ovoid model 1\n# decay: 0.5\n# isovalue: 1\n# amplitude decay1 decay2 "
                       "decay3 x y z alpha beta gamma\n")
            file.writelines(line + "\n" for line in mixture(np.array(read_atoms(path)), count))
        return row_of(name, "em", count, report_of(ovoid, ["measure", path, model]), count)


# ---- all rows ------------------------------------------------------------------------------------


def rows_of(ovoid, name, path):
    def fit(by, option, value, *more):
        return row_of(name, by, value, report_of(
            ovoid, ["fit", path, option, str(value), *more, "-o", os.devnull], codes=(0, 7)))

    yield from (fit("quick", "--ellipsoids", count, "--effort", "0") for count in COUNTS[name])
    yield from (fit("count", "--ellipsoids", count) for count in COUNTS[name])
    yield from (fit("tolerance", "--tolerance", tolerance) for tolerance in TOLERANCES)
    try:
        yield from (measure_mixture(ovoid, name, path, count) for count in COUNTS[name]
                   if count <= EM_MOST)
    except ImportError:
        print("without scikit-learn: no expectation maximisation", file=sys.stderr)


def measure_all(wanted):
    rows = []
    for name in wanted.names.split(","):
        path = find(wanted.molecules, name)
        if not path:
            print(f"{name}: not found", file=sys.stderr)
            continue
        for row in rows_of(wanted.ovoid, name, path):
            rows.append(row)
            print(*(f"{key}={row[key]}" for key in COLUMNS), flush=True)
    return rows


# ---- the picture ---------------------------------------------------------------------------------


def paper_points():
    errors = {row["molecule"]: row for row in paper_table(2)}
    for name, count in paper_counts().items():
        if name in errors:
            yield {"molecule": name, "by": "paper", "ellipsoids": count,
                   "deviation": errors[name]["hausdorff"], "area_error": errors[name]["area_error"]}


def draw(rows, path):
    from paper_figures import plain_log, plt  # not needed for the rest
    names = list(dict.fromkeys(row["molecule"] for row in rows))
    rows = rows + list(paper_points())
    panels = (("deviation", "deviation, Å", 1.0), ("area_error", "area error, %", 100.0))
    figure, axes = plt.subplots(2, len(names), figsize=(3.4 * len(names), 6), squeeze=False)
    for column, name in enumerate(names):
        for line, (key, label, scale) in enumerate(panels):
            panel = axes[line][column]
            for by, (text, colour, style) in LABELS.items():
                points = sorted((int(row["ellipsoids"]), scale * float(row[key])) for row in rows
                                if row["molecule"] == name and row["by"] == by)
                panel.plot([x for x, _ in points], [y for _, y in points], style, color=colour,
                           label=text, markersize=5 if by != "paper" else 8, linewidth=1.2)
            panel.set_xscale("log")
            panel.set_yscale("log")
            plain_log(panel.xaxis)
            plain_log(panel.yaxis)
            panel.set_xticks(COUNTS[name])
            panel.set_xticks([], minor=True)
            if column == 0:
                panel.set_ylabel(label)
        axes[0][column].set_title(name)
        axes[1][column].set_xlabel("ellipsoids")
    handles, texts = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside upper center", ncol=4, fontsize=9)
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--molecules", metavar="DIR")
    parser.add_argument("--names", default="1MAG,FAS2,AChE")
    parser.add_argument("--from", dest="table", metavar="FILE", help="rows that were recorded")
    parser.add_argument("--csv", metavar="FILE")
    parser.add_argument("--picture", metavar="FILE")
    wanted = parser.parse_args()
    if not wanted.table and not wanted.molecules:
        parser.error("--molecules or --from")
    rows = read_table(wanted.table) if wanted.table else measure_all(wanted)
    if wanted.csv:
        write_table(wanted.csv, "bench/frontier.py", COLUMNS, rows)
    if wanted.picture:
        draw(rows, wanted.picture)


if __name__ == "__main__":
    main()
