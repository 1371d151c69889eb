#!/bin/sh
# follow.sh [--update] OVOID DOCUMENT
# Does what a document says: runs each block of commands under <!-- run -->, in order and in an empty
# folder that holds 1hpv.pdb.gz, and compares what it prints with the block under the <!-- prints --> that follows, if any,
# as far as numbers may agree from machine to machine (follow_compare.awk). With --update the document
# gets what was printed.
#   <!-- run PROGRAM -->   is left out where there is no such program
#   <!-- run root -->      changes the machine: is run where FOLLOW_ROOT is set, in the current folder
# FOLLOW_FOLDER names a folder that is kept. Exit code 77: something was left out.
set -u
update=
[ "$1" != --update ] || { update=1; shift; }
ovoid=$(realpath "$1") || exit 1
document=$(realpath "$2") || exit 1
here=$(realpath "$(dirname "$0")")
entry=/usr/share/pymol/data/tut/1hpv.pdb
if [ -z "${FOLLOW_ROOT:-}" ]; then # else it is about to be installed
    [ -r "$entry" ] || { echo "skipped: no $entry (Debian: pymol-data)"; exit 77; }
    "$ovoid" devices >/dev/null 2>&1 || { echo "skipped: no OpenCL device"; exit 77; }
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/blocks" "$work/bin" "$work/empty"
ln -s "$ovoid" "$work/bin/ovoid"
PATH=$work/bin:/usr/bin:$PATH # Debian's PyMOL wants Debian's Python
export PATH
folder=${FOLLOW_FOLDER:-$work/empty}
status=0
awk -v folder="$work/blocks" -f "$here/follow.awk" "$document"

for block in "$work"/blocks/*.sh; do
    [ -e "$block" ] || { echo "$document: nothing to run"; exit 1; }
    name=${block%.sh}
    place=$folder
    for need in $(cat "$name.need" 2>/dev/null); do
        if [ "$need" = root ] && [ -n "${FOLLOW_ROOT:-}" ]; then
            place=.
        elif [ "$need" = root ]; then
            continue 2
        elif ! command -v "$need" >/dev/null; then
            echo "skipped: no $need for this:" && sed 's/^/    /' "$block"
            [ "$status" -ne 0 ] || status=77
            continue 2
        fi
    done
    [ "$place" = . ] || [ -e "$folder/1hpv.pdb.gz" ] || gzip -c "$entry" >"$folder/1hpv.pdb.gz"
    (cd "$place" && exec sh -e "$block") >"$name.found" 2>&1 </dev/null || {
        echo "$document: these commands fail:"
        sed 's/^/    /' "$block"
        cat "$name.found"
        exit 1
    }
    if [ -z "$update" ] && [ -e "$name.out" ] && ! awk -f "$here/follow_compare.awk" "$name.out" "$name.found"; then
        echo "$document: they are what these commands print:"
        sed 's/^/    /' "$block"
        status=1
    fi
done
[ -n "$update" ] || exit "$status"

# The same again, with what was found in the place of what was there.
awk -v folder="$work/blocks" '
    /^<!-- run[a-z ]* -->$/ { count++ }
    /^<!-- prints -->$/ { found = sprintf("%s/%03d.found", folder, count) }
    found != "" && /^```/ {
        if (inside++) {
            found = ""
            inside = 0
        } else {
            print
            while ((getline line <found) > 0)
                print line
            next
        }
    }
    !inside' "$document" >"$work/document"
cat "$work/document" >"$document"
