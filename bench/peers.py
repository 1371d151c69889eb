#!/usr/bin/env python3
"""Time of `ovoid fit` beside that of PyTorch's optimisers, to the same surface error.

    peers.py --molecules DIR [--molecules DIR]... [--ovoid build/release/ovoid] --warm build/release/bench/warm [--quick]
             [--cases 1MAG:87,FAS2:142,AChE:1636] [--optimisers lbfgs:30,adam:0.01,...]
             [--seconds 60] [--runs 5] [--device cpu] [--output bench/results/peers.csv]

The peer is what one would write instead (needs torch and numpy): it starts from the same merged
atoms (`ovoid fit --steps 0`) and minimises the same misfit at the same points (peers_problem.py) over
the same parameters, in float32, with torch.optim.LBFGS and its strong Wolfe line search, or Adam.
All forms of the evaluation in peers_torch.py are timed first, and the optimisers run with the fastest.
Threads are as many as cores.

Its clock begins after one evaluation and some steps of each optimiser elsewhere, with start and points at hand, and stands still while its
models are measured; what it is charged for is the optimiser and the evaluations alone. Ours is the
second column of bench/warm, which holds merging to the start, refinement, and the measuring that steers it:
the median of --runs, after one that does not count. Neither holds sampling nor the start of a program.

The error is the mean distance of the outer surfaces as `ovoid measure` tells it. The peer is there when
its best model so far is no worse than SAME times ours; the amplitudes of every model of the peer are
first multiplied by what makes the volumes equal, as ours are. The ratio is its time over ours. Where
the peer stops before, or reaches --seconds, the ratio is at least what is in the row, and `reached` is
no; so it is where it takes more than PATIENT times the fastest of the case so far. For the fastest run,
rows with `extrapolated` yes tell what it would take with the other forms: as many evaluations, times
the seconds of one, without the optimiser's own.
"""

import argparse
import collections
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy
import torch

import peers_problem
import peers_torch
from common import find, report_of, short, write_table

CASES = "1MAG:87,FAS2:142,AChE:1636"  # the paper's numbers
OPTIMISERS = "lbfgs:10,lbfgs:30,lbfgs:100,adam:0.003,adam:0.01,adam:0.03"
QUICK_CASES, QUICK_OPTIMISERS, QUICK_SECONDS = "1MAG:87", "lbfgs:30,adam:0.01", 5.0
SAME = 1.02
LOOK = 1.2  # the peer is measured each time its clock has grown so much
KEEP = 1.02  # and its models kept for a closer look
PATIENT = 2.0
TIMED, TIMED_SECONDS = 7, 5.0  # evaluations of each form: so many, or until so much time has gone
NUDGE = 0.02  # of the isovalue, to see how the volume follows
COLUMNS = (
    "device molecule atoms points ellipsoids optimiser setting form threads evaluations "
    "seconds_per_evaluation seconds our_seconds ratio reached extrapolated misfit_start misfit "
    "mean_distance our_mean_distance area_error our_area_error volume_error our_volume_error "
    "hausdorff our_hausdorff"
).split()

Case = collections.namedtuple("Case", "name path atoms problem origin start ours")
Look = collections.namedtuple("Look", "seconds evaluations misfit parameters")
Outcome = collections.namedtuple("Outcome", "look errors reached")


class Enough(Exception):
    """Ends an optimiser from within an evaluation."""


# ---- ours ----------------------------------------------------------------------------------------


def errors_of(report):
    return {
        "mean_distance": report["mean_distance_outer"],
        "hausdorff": report["hausdorff_outer"],
        "area_error": report["area_outer"]["error"],
        "volume_error": report["volume_outer"]["error"],
    }


def fit_ours(arguments, path, ellipsoids):
    """Errors of `ovoid fit`, and its seconds in a warm program."""
    command = ["fit", path, "--ellipsoids", str(ellipsoids), "--effort", "0", "-o", os.devnull]
    report = report_of(arguments.ovoid, command)
    lines = subprocess.run([arguments.warm, path, str(ellipsoids), str(arguments.runs)], check=True,
                           capture_output=True, text=True).stdout.splitlines()
    seconds = statistics.median(float(line.split()[1]) for line in lines)
    return {**errors_of(report), "seconds": seconds, "report": report}


def merged_start(ovoid, path, ellipsoids):
    with tempfile.TemporaryDirectory() as folder:
        model = os.path.join(folder, "start.ovoid")
        report_of(ovoid, ["fit", path, "--ellipsoids", str(ellipsoids), "--steps", "0",
                          "--no-measure", "-o", model])
        return peers_problem.read_model(model)


class Measure:
    """Errors of the peer's models, after what makes the volume right."""

    def __init__(self, ovoid, case):
        self.ovoid, self.case = ovoid, case

    def __call__(self, parameters):
        parameters = parameters.astype(float)
        parameters[:, 1:4] += self.case.origin
        with tempfile.TemporaryDirectory() as folder:
            model = os.path.join(folder, "peer.ovoid")
            factor = self.volume_factor(model, parameters)
            peers_problem.write_model(model, parameters, factor)
            return errors_of(report_of(self.ovoid, ["measure", self.case.path, model]))

    def volume_factor(self, model, parameters):
        """What amplitudes are multiplied by: 1 / isovalue at which the model has the volume."""
        peers_problem.write_model(model, parameters)
        values = f"1,{1.0 + NUDGE}"
        rows = report_of(self.ovoid, ["measure", self.case.path, model, "--isovalue", values])["rows"]
        here, beside = (row["volume_outer"]["sparse"] for row in rows)
        wanted = rows[0]["volume_outer"]["original"]
        return 1.0 / (1.0 + NUDGE * (wanted - here) / (beside - here))


# ---- the peer ------------------------------------------------------------------------------------


def synchronise(device):
    if device.startswith("cuda"):
        torch.cuda.synchronize()


def time_evaluations(case, device):
    """Seconds of an evaluation and a maker of the fastest evaluator, by form."""
    best = {}
    for make in peers_torch.evaluators(case.problem, case.origin, device):
        evaluator = make()
        parameters = torch.tensor(case.start, dtype=torch.float32, device=device, requires_grad=True)
        evaluator.misfit(parameters)
        seconds = []
        while len(seconds) < TIMED and sum(seconds) < TIMED_SECONDS:
            synchronise(device)
            began = time.perf_counter()
            evaluator.misfit(parameters)
            synchronise(device)
            seconds.append(time.perf_counter() - began)
        seconds = statistics.median(seconds)
        if evaluator.name not in best or seconds < best[evaluator.name][0]:
            best[evaluator.name] = seconds, make
    return best


def lbfgs(parameters, history, iterations=10**9):
    return torch.optim.LBFGS(
        [parameters], max_iter=iterations, max_eval=10 * iterations, tolerance_grad=0.0,
        tolerance_change=0.0, history_size=history, line_search_fn="strong_wolfe")


def warm_up():
    """torch loads parts of itself at the first step of an optimiser."""
    at = torch.ones(10, requires_grad=True)

    def closure():
        at.grad = None
        value = (at**4).sum()
        value.backward()
        return value

    for _ in range(3):
        torch.optim.Adam([at]).step(closure)
    lbfgs(at, 10, 5).step(closure)


class Run:
    """One optimiser on one case: a closure that evaluates, looks at the clock and at the surface."""

    def __init__(self, case, evaluator, device, limit, measure):
        self.case, self.evaluator, self.limit, self.measure = case, evaluator, limit, measure
        self.parameters = torch.tensor(case.start, dtype=torch.float32, device=device,
                                       requires_grad=True)
        self.wanted = SAME * case.ours["mean_distance"]
        self.evaluations, self.paused = 0, 0.0
        self.misfit_start = self.misfit = evaluator.misfit(self.parameters)
        self.best = self.parameters.detach().clone()
        self.kept = []  # since the last measured one
        self.next_look, self.next_kept = 0.1 * case.ours["seconds"], 0.0
        self.outcome = None
        self.began = time.perf_counter()

    def clock(self):
        return time.perf_counter() - self.began - self.paused

    def look(self):
        return Look(self.clock(), self.evaluations, self.misfit, self.best.cpu().numpy())

    def closure(self):
        misfit = self.evaluator.misfit(self.parameters)
        self.evaluations += 1
        if misfit < self.misfit:
            self.misfit = misfit
            self.best.copy_(self.parameters.detach())
        now = self.clock()
        if now >= self.next_kept:
            self.kept.append(self.look())
            self.next_kept = KEEP * now
        if now >= self.next_look or now >= self.limit:
            stop = time.perf_counter()
            self.inspect()
            self.next_look = LOOK * now
            self.paused += time.perf_counter() - stop
            if self.outcome.reached or now >= self.limit:
                raise Enough
        return torch.tensor(misfit, dtype=torch.float64)

    def inspect(self):
        """Measures the best model; if it is good enough, finds the first kept one that is."""
        last = self.look()
        errors = self.measure(last.parameters)
        self.outcome = Outcome(last, errors, errors["mean_distance"] <= self.wanted)
        if self.outcome.reached:
            low, high = 0, len(self.kept)
            while low < high:
                middle = (low + high) // 2
                errors = self.measure(self.kept[middle].parameters)
                if errors["mean_distance"] <= self.wanted:
                    self.outcome = Outcome(self.kept[middle], errors, True)
                    high = middle
                else:
                    low = middle + 1
        self.kept = []

    def minimise(self, kind, setting):
        try:
            if kind == "adam":
                optimiser = torch.optim.Adam([self.parameters], lr=setting)
                while True:
                    optimiser.step(self.closure)
            before = numpy.inf
            while self.misfit < before:  # a line search that fails gets a fresh start once
                before = self.misfit
                with torch.no_grad():
                    self.parameters.copy_(self.best)
                lbfgs(self.parameters, int(setting)).step(self.closure)
            self.inspect()  # it is where it gets
        except Enough:
            pass
        return self.outcome


# ---- cases ---------------------------------------------------------------------------------------


def prepare(arguments, name, ellipsoids):
    paths = [path for path in (find(folder, name) for folder in arguments.molecules) if path]
    if not paths:
        return None
    ours = fit_ours(arguments, paths[0], ellipsoids)
    xyzr = peers_problem.read_molecule(paths[0])
    problem = peers_problem.make_problem(xyzr)
    if (len(xyzr), len(problem.xyz)) != (ours["report"]["atoms"], ours["report"]["points"]):
        print(f"{name}: {len(xyzr)} atoms and {len(problem.xyz)} points here, "
              f"{ours['report']['atoms']} and {ours['report']['points']} in ovoid", flush=True)
    origin = problem.xyz.mean(0)
    start = merged_start(arguments.ovoid, paths[0], ellipsoids)
    start[:, 1:4] -= origin
    return Case(name, paths[0], len(xyzr), problem, origin, start, ours)


def row_of(case, arguments, kind, setting, form, run, outcome):
    look = outcome.look
    ours = case.ours["seconds"]
    row = {
        "device": device_name(arguments.device, case.ours["report"]),
        "molecule": case.name,
        "atoms": case.atoms,
        "points": len(case.problem.xyz),
        "ellipsoids": len(case.start),
        "optimiser": kind,
        "setting": setting,
        "form": form,
        "threads": torch.get_num_threads(),
        "evaluations": look.evaluations,
        "seconds_per_evaluation": look.seconds / look.evaluations,
        "seconds": look.seconds,
        "our_seconds": ours,
        "ratio": look.seconds / ours,
        "reached": "yes" if outcome.reached else "no",
        "extrapolated": "no",
        "misfit_start": run.misfit_start,
        "misfit": look.misfit,
    }
    for key, value in outcome.errors.items():
        row[key] = value
        row["our_" + key] = case.ours[key]
    return row


def extrapolate(row, form, seconds):
    total = seconds * row["evaluations"]
    return {**row, "form": form, "seconds_per_evaluation": seconds, "seconds": total,
            "ratio": total / row["our_seconds"], "extrapolated": "yes"}


def device_name(device, report):
    return torch.cuda.get_device_name() if device.startswith("cuda") else report["device"]


def run_case(case, arguments):
    forms = time_evaluations(case, arguments.device)
    fastest = min(forms, key=lambda form: forms[form][0])
    measure = Measure(arguments.ovoid, case)
    rows, limit = [], arguments.seconds
    for choice in arguments.optimisers.split(","):
        kind, setting = choice.split(":")
        run = Run(case, forms[fastest][1](), arguments.device, limit, measure)
        outcome = run.minimise(kind, float(setting))
        if outcome.reached:
            limit = min(limit, PATIENT * outcome.look.seconds)
        rows.append(row_of(case, arguments, kind, float(setting), fastest, run, outcome))
        print_row(rows[-1])
    best = min(rows, key=lambda row: (row["reached"] != "yes", row["seconds"]
                                      if row["reached"] == "yes" else row["mean_distance"]))
    for form, (seconds, _) in forms.items():
        if form != fastest:
            rows.append(extrapolate(best, form, seconds))
            print_row(rows[-1])
    return rows


def print_heading():
    print(f"{'':71}{'seconds':>26}{'':>11}{'mean distance, Å':>18}{'Hausdorff, Å':>16}")
    print(f"{'molecule':10}{'atoms':>7}{'ellipsoids':>11}  {'peer':12}{'form':9}{'evaluations':>12}"
          f"{'per eval.':>10}{'peer':>10}{'ours':>10}{'ratio':>9}{'peer':>14}{'ours':>10}"
          f"{'peer':>8}{'ours':>8}", flush=True)


def print_row(row):
    mark = " " if row["reached"] == "yes" else ">"
    note = "  extrapolated" if row["extrapolated"] == "yes" else ""
    print(f"{row['molecule']:10}{row['atoms']:7}{row['ellipsoids']:11}  "
          f"{row['optimiser'] + ' ' + format(row['setting'], 'g'):12}{row['form']:9}"
          f"{row['evaluations']:12}{row['seconds_per_evaluation']:10.5f}{row['seconds']:10.3f}"
          f"{row['our_seconds']:10.3f}{mark:>3}{row['ratio']:<8.3g}"
          f"{row['mean_distance']:12.4f}{row['our_mean_distance']:10.4f}"
          f"{row['hausdorff']:8.3f}{row['our_hausdorff']:8.3f}{note}", flush=True)


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--warm", required=True, help="bench/warm of the build")
    parser.add_argument("--molecules", action="append", required=True, metavar="DIR")
    parser.add_argument("--cases", help=f"molecule:ellipsoids,... (default {CASES})")
    parser.add_argument("--optimisers", help=f"(default {OPTIMISERS})")
    parser.add_argument("--seconds", type=float, help="limit of the peer's clock (default 60)")
    parser.add_argument("--runs", type=int, default=5, help="of ours, whose median counts")
    parser.add_argument("--device", default="cpu", help="torch's; OVOID_DEVICE names ours")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--output", metavar="FILE")
    arguments = parser.parse_args()
    quick = arguments.quick
    arguments.cases = arguments.cases or (QUICK_CASES if quick else CASES)
    arguments.optimisers = arguments.optimisers or (QUICK_OPTIMISERS if quick else OPTIMISERS)
    arguments.seconds = arguments.seconds or (QUICK_SECONDS if quick else 60.0)
    return arguments


def main():
    arguments = parse()
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    torch.set_flush_denormal(True)  # of help to the peer: far pairs underflow
    warm_up()
    rows, comment = [], ""
    print_heading()
    for text in arguments.cases.split(","):
        name, ellipsoids = text.split(":")
        case = prepare(arguments, name, int(ellipsoids))
        if case is None:
            print(f"{name}: not found")
            continue
        rows += run_case(case, arguments)
        report = case.ours["report"]
        comment = f"ovoid {report['version']}, {report['device']}; torch {torch.__version__}"
    if arguments.output and rows:
        write_table(arguments.output, comment + "; bench/peers.py", COLUMNS,
                    [{key: short(value) for key, value in row.items()} for row in rows])
    return 0


if __name__ == "__main__":
    sys.exit(main())
