#!/usr/bin/env python3
"""Surfaces and fits along a trajectory: adenylate kinase of MDAnalysisTests (3,341 atoms, 98 frames), there
and back until there are enough frames.

    OVOID_LIBRARY=build/release/host/libovoid.so PYTHONPATH=python/src \\
        python3 bench/trajectory.py [--frames 1000] [--fits 100] [--out bench/results/trajectory.csv]

It takes MDAnalysis, MDAnalysisTests and, for the comparison, freesasa (PyPI). Rows:
- surface: seconds per frame for area and volume at spacings of 0.5 and 1 Å
- freesasa: seconds per frame of Lee and Richards' and of Shrake and Rupley's area, on one core (its package
  knows no threads), with the same radii: another surface, so the speed alone compares
- warm and fresh: seconds per frame of fits that begin with the frame before, and of fits from the atoms,
  with ellipsoids and deviation, in tenths of the way, so that a drift would be seen
"""

import argparse
import csv
import os
import sys
import time
import warnings

import numpy as np

import ovoid

HERE = os.path.dirname(os.path.abspath(__file__))


def there_and_back(universe, frames):
    """Coordinates of so many frames (Å), turning round at both ends."""
    places = np.array([np.array(ts.positions) for ts in universe.trajectory], np.float64)
    last = len(places) - 1
    return places[[abs((k + last) % (2 * last) - last) if last else 0 for k in range(frames)]]


def surfaces(places, molecule):
    for spacing, vertices in ((0.5, "exact"), (1.0, "exact"), (1.0, "linear")):
        ovoid.measure_trajectory(places[:2], molecule, spacing=spacing, vertices=vertices)  # compile
        found = ovoid.measure_trajectory(places, molecule, spacing=spacing, vertices=vertices)
        yield {"what": "surface", "how": f"{spacing} Å, {vertices}", "frames": len(places),
               "seconds": found.seconds.mean(), "area": found.area.mean(),
               "volume": found.volume.mean()}


def freesasa_rows(places, molecule):
    try:
        import freesasa
    except ImportError:
        print("skipped: no freesasa", file=sys.stderr)
        return
    radii = np.array(molecule.radii)
    for name in (freesasa.LeeRichards, freesasa.ShrakeRupley):
        options = freesasa.Parameters({"algorithm": name})
        begin = time.perf_counter()
        areas = [freesasa.calcCoord(xyz.ravel(), radii, options).totalArea() for xyz in places]
        yield {"what": "freesasa", "how": name, "frames": len(places),
               "seconds": (time.perf_counter() - begin) / len(places), "area": np.mean(areas)}


def fits(places, molecule, every):
    found = ovoid.fit_trajectory(places, molecule, fresh_every=every, measure=False, keep_models=False)
    tenths = max(1, len(places) // 10)
    for begin in range(0, len(places), tenths):
        part = slice(max(begin, 1), begin + tenths)  # the first is no warm one
        fresh = np.isfinite(found.fresh_deviation[part])
        if len(found.seconds[part]) == 0:
            continue
        for what, taken, count, deviation in (
            ("warm", found.seconds[part], found.ellipsoids[part], found.deviation[part]),
            ("fresh", found.fresh_seconds[part][fresh], found.fresh_ellipsoids[part][fresh],
             found.fresh_deviation[part][fresh]),
        ):
            if len(taken):
                yield {"what": what, "how": f"from frame {part.start}", "frames": len(taken),
                       "seconds": taken.mean(), "ellipsoids": count.mean(),
                       "deviation": deviation.max()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--fits", type=int, default=100)
    parser.add_argument("--every", type=int, default=10, help="a fresh fit beside each N-th")
    parser.add_argument("--out", default=os.path.join(HERE, "results", "trajectory.csv"))
    given = parser.parse_args()
    warnings.simplefilter("ignore", DeprecationWarning)
    import MDAnalysis
    from MDAnalysisTests.datafiles import DCD, PSF

    universe = MDAnalysis.Universe(PSF, DCD)
    molecule = ovoid.molecule(universe)
    places = there_and_back(universe, max(given.frames, given.fits))
    device = ovoid.use_device(None)
    names = ["what", "how", "frames", "seconds", "area", "volume", "ellipsoids", "deviation"]
    with open(given.out + ".part", "w", encoding="utf-8", newline="") as out:
        out.write(f"# bench/trajectory.py: adenylate kinase, {len(molecule)} atoms; ovoid "
                  f"{ovoid.__version__}, {device.name}, driver {device.driver}\n")
        table = csv.DictWriter(out, names, lineterminator="\n")
        table.writeheader()
        for rows in (surfaces(places[: given.frames], molecule),
                     freesasa_rows(places[: given.frames], molecule),
                     fits(places[: given.fits], molecule, given.every)):
            for row in rows:
                shown = {k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()}
                table.writerow(shown)
                print(shown, flush=True)
    os.replace(given.out + ".part", given.out)


if __name__ == "__main__":
    main()
