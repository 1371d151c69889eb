#!/bin/sh
# The layers of host/, read from the includes: a room uses only what stands below it.
#
#   layers.sh [FOLDER]            fails on an include that leads upward, sideways, or to no room
#   layers.sh --picture [FOLDER]  prints the rooms from the top, with their lines and what they use
#
# FOLDER is host/ by default, and then CONTRIBUTING.md (Rooms) is held to the picture, too.
set -eu
self=$(cd "$(dirname "$0")" && pwd)/$(basename "$0")
picture=
if [ "${1:-}" = --picture ]; then
    picture=1
    shift
fi
if [ -z "$picture" ] && [ $# = 0 ]; then
    # Who uses whom, base aside, in the picture and in the table's last column.
    sh "$self" --picture | awk '
        function name_of(room) {
            sub(/\/.*/, "", room) # fit/adaptive and fit/l1 are in the row of fit
            return room
        }
        FNR == NR {
            room = name_of($1)
            rooms[room]
            sub(/^.* lines  /, "")
            n = split($0, used, ", ")
            for (i = 1; i <= n; i++) {
                sub(/ .*/, "", used[i])
                other = name_of(used[i])
                if (other != room && other != "base" && other != "-")
                    uses[room, other]
            }
            next
        }
        /^\| room, from the top/ { table = 1 }
        !/^\|/ { table = 0 }
        table && split($0, cell, "|") && match(cell[2], /`[a-z]+`/) {
            room = substr(cell[2], RSTART + 1, RLENGTH - 2)
            said[room]
            while (match(cell[4], /`[a-z]+`/)) {
                says[room, substr(cell[4], RSTART + 1, RLENGTH - 2)]
                cell[4] = substr(cell[4], RSTART + RLENGTH)
            }
        }
        function fault(what) {
            print "CONTRIBUTING.md (Rooms): " what
            faults++
        }
        END {
            for (room in rooms) {
                if (!(room in said))
                    fault("there is no row for " room)
                for (other in rooms)
                    if (((room, other) in uses) != ((room, other) in says))
                        fault(room (((room, other) in uses) ? " uses " : " does not use ") other)
            }
            exit faults > 0
        }' - "$(dirname "$self")/../../CONTRIBUTING.md"
fi
cd "${1:-$(dirname "$0")/../../host}"
find . -name '*.c' -o -name '*.h' -o -name '*.cpp' | LC_ALL=C sort | xargs awk -v picture="$picture" '
    # Rooms of one level do not use each other. A room may be limited further, to those after the
    # colon. fit/l1 and fit/adaptive are rooms within fit: its session uses them, and not they it.
    function level(number, names,    n, i) {
        n = split(names, name_of, " ")
        for (i = 1; i <= n; i++) {
            at[name_of[i]] = number
            order[++rooms] = name_of[i]
        }
    }
    BEGIN {
        level(0, "base")
        level(1, "device molecule neighbours")
        level(2, "field")
        level(3, "model")
        level(4, "mixture")
        level(5, "mesh")
        level(6, "measure picture")
        level(7, "fit/l1 fit/adaptive")
        level(8, "fit")
        level(9, "write selftest")
        level(10, "cli")
    }
    function room_of(path) {
        if (match(path, /^fit\/(l1|adaptive)\//))
            return substr(path, 1, RLENGTH - 1)
        return match(path, /\//) ? substr(path, 1, RSTART - 1) : ""
    }
    function fault(what) {
        printf "%s:%d: %s\n", substr(FILENAME, 3), FNR, what
        faults++
    }
    FNR == 1 {
        room = room_of(substr(FILENAME, 3))
        files[room]++
        if (!(room in at))
            fault("no level is known for the room \"" room "\"")
    }
    { lines[room]++ }
    /^ *# *include "/ {
        split($0, part, "\"")
        used = part[2]
        if (used ~ /^ovoid\// || used == "shared.h" || used !~ /\//)
            next # the public headers, what host and kernels share, and neighbours in the same folder
        other = room_of(used)
        if (other == room)
            next
        if (!(other in at))
            fault("\"" used "\" is in no room")
        else if (at[other] >= at[room])
            fault(room " uses " other ", which does not stand below it: \"" used "\"")
        else if (room == "cli")
            fault("the tool uses the public header alone, not \"" used "\"")
        uses[room, other]++
    }
    END {
        for (i = rooms; picture && i >= 1; i--) {
            below = ""
            for (j = rooms; j >= 1; j--)
                if ((order[i], order[j]) in uses)
                    below = below (below == "" ? "" : ", ") order[j] " " uses[order[i], order[j]]
            printf "%-12s %3d files %6d lines  %s\n", order[i], files[order[i]], lines[order[i]],
                   below == "" ? "-" : below
        }
        exit faults > 0
    }'
