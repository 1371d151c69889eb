#!/usr/bin/env python3
"""Surfaces and fits along a trajectory: adenylate kinase of MDAnalysisTests (3,341 atoms, 98 frames), there
and back until there are enough frames.

    python3 -m venv VENV && VENV/bin/pip install MDAnalysis MDAnalysisTests mdtraj freesasa
    OVOID_LIBRARY=build/release/host/libovoid.so PYTHONPATH=python/src \\
        VENV/bin/python bench/trajectory.py [--frames 1000] [--fits 100]

in a folder outside the repository; freesasa and mdtraj are for the comparison alone and may be missing. Rows:
- surface: seconds per frame for area and volume at spacings of 0.5 and 1 Å
- freesasa: seconds per frame of Lee and Richards' area and of Shrake and Rupley's, with the same radii (its
  package knows no threads); mdtraj: of Shrake and Rupley's, with as many points (100) and radii of its own.
  These are other surfaces, of which there is no volume: the speed alone compares
- warm and fresh: seconds per frame of fits that begin with the frame before, and of fits from the atoms,
  with ellipsoids and deviation, in tenths of the way, so that a drift would be seen
"cores" is the processor's time over that of the clock: how many of them worked. The record is
results/python_trajectory.csv, whole or not at all.
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


class Clock:
    """Seconds, and how many cores worked meanwhile."""

    def __init__(self):
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def per(self, frames):
        wall, cpu = time.perf_counter() - self.wall, time.process_time() - self.cpu
        return {"frames": frames, "seconds": wall / frames, "cores": cpu / wall}


def surfaces(places, molecule):
    for spacing, vertices in ((0.5, "exact"), (1.0, "exact"), (1.0, "linear")):
        ovoid.measure_trajectory(places[:2], molecule, spacing=spacing, vertices=vertices)  # compile
        clock = Clock()
        found = ovoid.measure_trajectory(places, molecule, spacing=spacing, vertices=vertices)
        yield {"what": "surface", "how": f"{spacing} Å, {vertices}", **clock.per(len(places)),
               "area": found.area.mean(), "volume": found.volume.mean()}


def freesasa_rows(places, molecule):
    try:
        import freesasa
    except ImportError:
        print("skipped: no freesasa", file=sys.stderr)
        return
    radii = np.array(molecule.radii)
    for name in (freesasa.LeeRichards, freesasa.ShrakeRupley):
        options = freesasa.Parameters({"algorithm": name})
        clock = Clock()
        areas = [freesasa.calcCoord(xyz.ravel(), radii, options).totalArea() for xyz in places]
        yield {"what": "freesasa", "how": name, **clock.per(len(places)), "area": np.mean(areas)}


def mdtraj_rows(places, files):
    try:
        import mdtraj
    except ImportError:
        print("skipped: no mdtraj", file=sys.stderr)
        return
    one = mdtraj.load_frame(files[1], 0, top=files[0])
    frames = mdtraj.Trajectory(np.asarray(places / 10.0, np.float32), one.topology)  # nm
    clock = Clock()
    areas = mdtraj.shrake_rupley(frames, n_sphere_points=100)
    yield {"what": "mdtraj", "how": "ShrakeRupley", **clock.per(len(places)),
           "area": 100.0 * float(areas.sum(axis=1).mean())}


def fits(places, molecule, every):
    if len(places) == 0:
        return
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
    parser.add_argument("--out", default=os.path.join(HERE, "results", "python_trajectory.csv"))
    given = parser.parse_args()
    warnings.simplefilter("ignore", DeprecationWarning)
    import MDAnalysis
    from MDAnalysisTests.datafiles import DCD, PSF

    universe = MDAnalysis.Universe(PSF, DCD)
    molecule = ovoid.molecule(universe)
    places = there_and_back(universe, max(given.frames, given.fits))
    device = ovoid.use_device(None)
    names = ["what", "how", "frames", "seconds", "cores", "area", "volume", "ellipsoids", "deviation"]
    with open(given.out + ".part", "w", encoding="utf-8", newline="") as out:
        out.write(f"# bench/trajectory.py: adenylate kinase, {len(molecule)} atoms; ovoid "
                  f"{ovoid.__version__}, {device.name}, driver {device.driver}\n")
        table = csv.DictWriter(out, names, lineterminator="\n")
        table.writeheader()
        for rows in (surfaces(places[: given.frames], molecule),
                     freesasa_rows(places[: given.frames], molecule),
                     mdtraj_rows(places[: given.frames], (PSF, DCD)),
                     fits(places[: given.fits], molecule, given.every)):
            for row in rows:
                shown = {k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()}
                table.writerow(shown)
                print(shown, flush=True)
    os.replace(given.out + ".part", given.out)


if __name__ == "__main__":
    main()
