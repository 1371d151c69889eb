#!/usr/bin/env python3
"""nodes_estimate.py REPORT... [--ranks N,N] [--late SECONDS] [--rounds]

What a fit in parts would take on several equal devices, from what each of its tasks took on one: the report of

    ovoid fit MOLECULE --ratio 0.066 --effort 0 --no-measure --profile --report REPORT

says of each task what it took and which others it waited for. This plays the ranks' scheduler
(host/fit/parts/sharing.c) with these seconds: a stage begins when the one before is done, tasks that wait for none go
to ranks with nothing to do, the longest way of atoms first, and what a rank has done the others know --late seconds
later. What lies between stages, and before and after the parts, all ranks do alike, or one for all: it takes what it
took. --rounds plays the scheduler that this one took the place of, by which all ranks waited for each other before any
went on. Writes CSV:

    molecule, atoms, parts, longest: seconds of the longest way over tasks that wait for each other, which no number of
    devices goes below; ranks, seconds, speedup, and the shares of all ranks' time that they wait and that goes into
    what is not shared
"""

import argparse
import csv
import heapq
import json
import sys
from pathlib import Path

AHEAD = 2  # of sharing.c


class Stage:
    """Tasks by number, and what each waits for."""

    def __init__(self, tasks):
        self.seconds = {t["number"]: t["seconds"] for t in tasks}
        self.cost = {t["number"]: 1 + t["atoms"] for t in tasks}
        self.after = {t["number"]: set(t["after"]) & set(self.seconds) for t in tasks}
        path = self.longest(self.cost, forward=False)
        self.order = sorted(self.seconds, key=lambda n: (-path[n], n))

    def longest(self, weight, forward=True):
        """The longest way that ends with each task, or that begins with it."""
        before = self.after
        if not forward:
            before = {n: set() for n in self.seconds}
            for n, others in self.after.items():
                for other in others:
                    before[other].add(n)
        way = {}

        def find(n):
            if n not in way:
                way[n] = weight[n] + max((find(k) for k in before[n]), default=0)
            return way[n]

        for n in self.seconds:
            find(n)
        return way

    def bound(self):
        return max(self.longest(self.seconds).values())


def play_meetings(stage, ranks, late):
    """Seconds of a stage, by the scheduler of sharing.c with one worker on each rank."""
    holder, queue = {}, [[] for _ in range(ranks)]
    load, free_at = [0] * ranks, [0.0] * ranks
    known, events, end = set(), [(0.0, None)], 0.0
    while events:
        now, done = heapq.heappop(events)
        news = [] if done is None else [done]
        while events and events[0][0] == now:
            news.append(heapq.heappop(events)[1])
        for n in news:
            known.add(n)
            queue[holder[n]].remove(n)
        ready = [n for n in stage.order if n not in holder and stage.after[n] <= known]
        for each in range(1, AHEAD + 1):
            for n in list(ready):
                room = [r for r in range(ranks) if len(queue[r]) < each]
                if not room or (each > 1 and len(ready) <= 2 * ranks):
                    break
                rank = min(room, key=lambda r: (load[r], r))
                ready.remove(n)
                holder[n] = rank
                queue[rank].append(n)
                load[rank] += stage.cost[n]
                free_at[rank] = max(now, free_at[rank]) + stage.seconds[n]
                heapq.heappush(events, (free_at[rank] + late, n))
                end = max(end, free_at[rank] + late)
    return end


def play_rounds(stage, ranks, late):
    known, end = set(), 0.0
    while len(known) < len(stage.seconds):
        ready = [n for n in stage.seconds if n not in known and stage.after[n] <= known]
        load, spent = [0] * ranks, [0.0] * ranks
        for n in sorted(ready, key=lambda n: (-stage.cost[n], n)):
            rank = min(range(ranks), key=lambda r: (load[r], r))
            load[rank] += stage.cost[n]
            spent[rank] += stage.seconds[n]
        end += max(spent) + late
        known |= set(ready)
    return end


def stages_of(tasks):
    numbers = sorted({t["stage"] for t in tasks})
    return [Stage([t for t in tasks if t["stage"] == n]) for n in numbers]


def estimate(report, ranks, late, rounds):
    tasks = report["work"]["tasks"]
    stages = stages_of(tasks)
    busy = sum(t["seconds"] for t in tasks)
    one = report["work"]["ranks"][0]
    whole = report["seconds"]["sample"] + report["seconds"]["fit"]
    alike = whole - (one["busy"] + one["waiting"]) / one["workers"]
    play = play_rounds if rounds else play_meetings
    shared = busy if ranks == 1 else sum(play(s, ranks, late) for s in stages)
    seconds = alike + shared
    return {
        "molecule": Path(report["input"]).name.split(".")[0],
        "atoms": report["atoms"],
        "parts": report["parts"],
        "longest": f"{alike + sum(s.bound() for s in stages):.2f}",
        "ranks": ranks,
        "seconds": f"{seconds:.2f}",
        "speedup": f"{(alike + busy) / seconds:.2f}",
        "waiting": f"{(shared - busy / ranks) / seconds:.3f}",
        "not_shared": f"{alike / seconds:.3f}",
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[2])
    parser.add_argument("report", nargs="+", type=Path)
    parser.add_argument("--ranks", default="1,2,4,8,16,32,64", help="how many, separated by commas")
    parser.add_argument("--late", type=float, default=0.005, help="seconds until others know what a rank has done")
    parser.add_argument("--rounds", action="store_true", help="wait for all before any goes on")
    options = parser.parse_args()
    out = None
    for path in options.report:
        report = json.loads(path.read_text())
        if len(report.get("work", {}).get("ranks", [])) != 1 or "tasks" not in report["work"]:
            sys.exit(f"{path}: no tasks of one process: ovoid fit --part-atoms N --profile --report {path}")
        for ranks in options.ranks.split(","):
            row = estimate(report, int(ranks), options.late, options.rounds)
            out = out or csv.DictWriter(sys.stdout, row, lineterminator="\n")
            if out.fieldnames and not getattr(out, "begun", False):
                out.writeheader()
                out.begun = True
            out.writerow(row)


if __name__ == "__main__":
    main()
