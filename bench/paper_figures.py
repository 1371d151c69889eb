"""Figures of bench/paper.py."""

import math
import os

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from common import paper_table, read_table

BOUNDS = (0.1444, 0.2433)  # of the sparse ratio, in the text on the paper's figure of it
DECAY = 0.5  # of the paper's tables
COURSE, AMPLITUDES = "ADP", "AChE"  # the molecules of two of its figures

# Okabe and Ito's palette, told apart by colour-blind readers.
BLACK, ORANGE, SKY, GREEN, BLUE, RED, PINK = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7")
DECAY_STYLES = {0.3: (ORANGE, "s"), 0.5: (BLUE, "o"), 0.7: (RED, "^")}
GREY = "#777777"

plt.rcParams.update({
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
})


def save(figure, folder, name):
    figure.savefig(os.path.join(folder, f"paper-{name}.png"), metadata={"Software": None})
    plt.close(figure)


def plain_log(axis):
    """A logarithmic axis with 1 and 3 of every decade written out."""
    axis.set_major_locator(LogLocator(subs=(1, 3)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def sparsity(folder, rows):
    """The paper's figure of N against atoms for three decay rates, with its bounds of N / atoms."""
    rows = [row for row in rows if row["kernel"] == "ellipsoid"]
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.6))
    low, high = min(r["atoms"] for r in rows), max(r["atoms"] for r in rows)
    ends = (0.8 * low, 1.25 * high)
    left.plot(ends, ends, color=GREY, linewidth=1, label="one for each atom")
    paper = [(int(r["atoms"]), int(r["ellipsoids"])) for r in paper_table(1)]
    paper = [(atoms, count) for atoms, count in paper if atoms <= ends[1]]
    for axes, ratio in ((left, False), (right, True)):
        axes.fill_between(ends, *([k if ratio else k * x for x in ends] for k in BOUNDS),
                          color="#dddddd", linewidth=0,
                          label=f"the paper's bounds, {BOUNDS[0]} to {BOUNDS[1]} of the atoms")
        axes.plot([a for a, _ in paper], [n / a if ratio else n for a, n in paper], "x",
                  color=BLACK, markersize=6, label=f"the paper's Table 1, $d$ = {DECAY} Å⁻²")
        for decay, (color, marker) in DECAY_STYLES.items():
            points = sorted((r["atoms"], r["kernels"]) for r in rows if r["decay"] == decay)
            axes.plot([a for a, _ in points], [n / a if ratio else n for a, n in points],
                      marker, color=color, markersize=7, markeredgewidth=1.4,
                      markerfacecolor=color if decay == DECAY else "none",
                      label=f"Ovoid, method l1, $d$ = {decay} Å⁻²")
        axes.set_xscale("log")
        axes.set_xlim(*ends)
        axes.set_xlabel("atoms")
        plain_log(axes.xaxis)
    left.set_yscale("log")
    plain_log(left.yaxis)
    left.set_ylabel("ellipsoids")
    right.set_ylabel("sparse ratio: ellipsoids / atoms")
    right.set_ylim(bottom=0)
    left.legend(fontsize=8.5, loc="upper left")
    left.set_ylim(top=4 * ends[1])  # room for the legend
    save(figure, folder, "sparsity")


def course(folder, trace):
    """Objective and number of ellipsoids against iteration."""
    records = read_table(trace)
    steps = [int(r["iteration"]) for r in records]
    counts = [int(r["ellipsoids"]) for r in records]
    end = max((s for s, r in zip(steps, records) if r["stage"] == "sparse"), default=0)
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 5.6), sharex=True)
    for alone, color, label in (
            (False, BLUE, "both terms: $w_s E_s + w_l E_{l1}$"),
            (True, ORANGE, "accuracy alone, $w_s$ = 1: an error is above 0.5, or the last phase")):
        points = [(s, float(r["objective"])) for s, r in zip(steps, records)
                  if (float(r["w_l"]) == 0) == alone]
        top.plot([s for s, _ in points], [o for _, o in points], ".", color=color, markersize=2,
                 markeredgewidth=0)
        top.plot([], [], ".", color=color, markersize=8, label=label)
    top.set_yscale("log")
    plain_log(top.yaxis)
    top.set_ylabel("objective")
    top.legend(fontsize=9, loc="upper left", bbox_to_anchor=(0.12, 1))
    bottom.step(steps, counts, color=RED, linewidth=1.6, where="post")
    bottom.set_ylabel("ellipsoids")
    bottom.set_ylim(0, 1.08 * counts[0])
    bottom.annotate(f"{counts[-1]} at the end", (steps[-1], counts[-1]), (-4, 8),
                    textcoords="offset points", ha="right", color=RED)
    for axes in (top, bottom):
        axes.axvline(end, color=GREY, linestyle="--", linewidth=1)
    bottom.text(end, 0.97, "sparse phase  ", transform=bottom.get_xaxis_transform(), ha="right",
                va="top", color=GREY)
    bottom.text(end, 0.97, "  accuracy phase", transform=bottom.get_xaxis_transform(), ha="left",
                va="top", color=GREY)
    bottom.set_xlim(0, steps[-1])
    bottom.set_xlabel(f"iteration ({COURSE}: {counts[0]} atoms)")
    save(figure, folder, "course")


def amplitudes_of(model):
    with open(model, encoding="utf-8") as lines:
        rows = [line.split() for line in lines if not line.startswith("#")]
    return [float(row[0]) for row in rows if row and row[0] != "amplitude"]


def exponential_distance(values, mean):
    """Kolmogorov's: the largest difference of the two distribution functions."""
    count = len(values)
    return max(max(abs((k + 1) / count - 1 + math.exp(-v / mean)),
                   abs(k / count - 1 + math.exp(-v / mean))) for k, v in enumerate(values))


def amplitudes(folder, model):
    """Histogram of amplitudes with the exponential distribution that fits them best, by maximum
    likelihood: that of their mean."""
    values = sorted(amplitudes_of(model))
    mean = sum(values) / len(values)
    shown = values[int(0.99 * (len(values) - 1))]
    bins = 40
    width = shown / bins
    figure, axes = plt.subplots(figsize=(7, 4.2))
    axes.hist([v for v in values if v <= shown], bins=bins, range=(0, shown), color=SKY,
              edgecolor="white", linewidth=0.5, label=f"{AMPLITUDES}: {len(values)} ellipsoids")
    xs = [shown * k / 200 for k in range(201)]
    axes.plot(xs, [len(values) * width / mean * math.exp(-x / mean) for x in xs], color=RED,
              linewidth=1.8, label=f"best exponential distribution: mean {mean:.3g}, "
                                    f"largest distance {exponential_distance(values, mean):.2f}")
    beyond = sum(v > shown for v in values)
    axes.set_xlim(0, shown)
    axes.set_xlabel(f"amplitude ({beyond} above {shown:.3g} are not shown)")
    axes.set_ylabel(f"ellipsoids per bin of {width:.2g}")
    axes.set_ylim(top=1.25 * axes.get_ylim()[1])  # room for the legend
    axes.legend(loc="upper right")
    save(figure, folder, "amplitudes")


def isovalues(folder, rows):
    """Area and volume of both surfaces against the isovalue, and how far they differ."""
    names = list(dict.fromkeys(row["molecule"] for row in rows))
    figure, axes = plt.subplots(2, 2, figsize=(10, 7.6), sharex=True,
                                gridspec_kw={"height_ratios": (3, 2)})
    for (top, bottom), key, unit in zip(axes.T, ("volume", "area"), ("Å³", "Å²")):
        for name, color in zip(names, (BLUE, RED, GREEN, ORANGE, PINK, SKY, BLACK)):
            own = [row for row in rows if row["molecule"] == name]
            xs = [row["isovalue"] for row in own]
            top.plot(xs, [r[key + "_original"] for r in own], color=color, linewidth=1.4)
            top.plot(xs, [r[key + "_model"] for r in own], "o", color=color, markersize=6,
                     markerfacecolor="none")
            top.annotate(name, (xs[-1], own[-1][key + "_original"]), (8, 0),
                         textcoords="offset points", va="center", color=color, fontsize=9)
            for part, style in (("", "o:"), ("_outer", ".-")):
                errors = [(r[f"{key}{part}_model"] / r[f"{key}{part}_original"] - 1) * 100
                          for r in own]
                bottom.plot(xs, errors, style, color=color, markersize=6 if part == "" else 7,
                            markerfacecolor="none" if part == "" else color, linewidth=1)
        top.set_yscale("log")
        plain_log(top.yaxis)
        bottom.set_yscale("symlog", linthresh=1)
        bottom.set_ylim(-40, 40)
        bottom.set_yticks((-30, -10, -3, -1, -0.5, 0, 0.5, 1, 3, 10, 30))
        bottom.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:+g}" if v else "0"))
        bottom.minorticks_off()
        top.set_ylabel(f"{key} ({unit})")
        bottom.set_ylabel(f"model's {key} less the atoms' (%)")
        bottom.set_xlabel("isovalue $c$")
        bottom.set_xlim(right=max(r["isovalue"] for r in rows) + 0.25)
    for panel, kinds in zip(axes[:, 0], ((("-", "surface of the atoms"), ("o", "of the model")),
                                         (("o:", "whole"), (".-", "without walls of cavities")))):
        for style, label in kinds:
            panel.plot([], [], style, color=GREY, markerfacecolor="none" if "o" in style else GREY,
                       label=label)
        panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncol=2, fontsize=9)
    save(figure, folder, "isovalues")


def draw(folder, rows, by_isovalue, files):
    """files: molecule -> its model and trace at decay 0.5."""
    paper = {row["molecule"] for row in paper_table(1)}
    os.makedirs(folder, exist_ok=True)
    sparsity(folder, rows)
    isovalues(folder, [row for row in by_isovalue if row["molecule"] in paper] or by_isovalue)
    if COURSE in files:
        course(folder, files[COURSE][1])
    if AMPLITUDES in files:
        amplitudes(folder, files[AMPLITUDES][0])
