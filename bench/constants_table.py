#!/usr/bin/env python3
"""Reads bench/results/constants.csv into the table of docs/constants.md.

    constants_table.py [FILE.csv]

For each constant, halved and doubled, beside the fits with none changed, over the molecules that
there are for it: of fits to a tolerance the ellipsoids of all together, of others the geometric mean
of the deviations, and of each the work (iterations of conjugate gradients; launches of method l1).
"""
import csv
import math
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLES = ["adaptive", "l1"]


def constants():
    for method in TABLES:
        prefix = "l1_" if method == "l1" else ""
        for line in (ROOT / f"host/fit/{method}/constants.def").read_text().splitlines():
            if line.startswith(("OV_REAL(", "OV_COUNT(")):
                name, value = line[line.index("(") + 1:-1].split(", ")
                yield prefix + name, value


def percent(ratio):
    return "=" if abs(ratio - 1.0) < 0.0005 else f"{100.0 * (ratio - 1.0):+.1f} %"


def compare(rows, base):
    """What changed of these rows beside those with none changed: (result, work), or None."""
    pairs = [(row, base[row["molecule"], row["fit"]]) for row in rows]
    good = [(r, b) for r, b in pairs if math.isfinite(float(r["deviation"]))]
    lost = len(pairs) - len(good)
    if not pairs:
        return None
    if not good:
        return "fails", ""
    work = "launches" if good[0][0]["fit"] == "l1" else "solver_iterations"
    if good[0][0]["fit"] in ("tolerance", "frame", "l1"):
        result = sum(int(r["ellipsoids"]) for r, _ in good) / sum(
            int(b["ellipsoids"]) for _, b in good)
    else:
        result = math.exp(sum(math.log(float(r["deviation"]) / float(b["deviation"]))
                              for r, b in good) / len(good))
    took = math.exp(sum(math.log(max(1, int(r[work])) / max(1, int(b[work]))) for r, b in good) / len(good))
    return percent(result) + (f", {lost} fail" if lost else ""), percent(took)


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else ROOT / "bench/results/constants.csv"
    rows = list(csv.DictReader(open(path)))
    base = {(r["molecule"], r["fit"]): r for r in rows if r["constant"] == "none"}
    print("| constant | value | fit | molecules | halved | work | doubled | work |")
    print("|---|---|---|---|---|---|---|---|")
    for name, value in constants():
        own = [r for r in rows if r["constant"] == name]
        for fit in dict.fromkeys(r["fit"] for r in own):
            cells = []
            for change in ("halved", "doubled"):
                found = compare([r for r in own if r["fit"] == fit and r["change"] == change], base)
                cells += found if found else ("", "")
            count = len({r["molecule"] for r in own if r["fit"] == fit})
            print(f"| `{name}` | {value} | {fit} | {count} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
