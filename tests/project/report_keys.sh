#!/bin/sh
# report_keys.sh OVOID
# The guide explains every key of the reports, and no other: those of fits by both methods, in parts, with an
# assembly, levels and all options that add some, of several molecules, of all models of a file, and of `ovoid measure`.
set -u
ovoid=$1
guide=docs/guide.md
"$ovoid" devices >/dev/null 2>&1 || { echo "skipped: no OpenCL device"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
status=0
cat >"$work/a.pdb" <<'END'
REMARK 350 BIOMOLECULE: 1
REMARK 350 APPLY THE FOLLOWING TO CHAINS: A
REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000
REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000
REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000
ATOM      1  N   GLY A   1       0.000   0.000   0.000  1.00  0.00           N
ATOM      2  CA  GLY A   1       1.458   0.000   0.000  1.00  0.00           C
ATOM      3  XX  UNK A   2       3.458   0.000   0.000  1.00  0.00           X
END
echo 'C 1.7
N 1.5' >"$work/radii"
fit() {
    "$ovoid" fit "$work/a.pdb" -o "$work/a.ovoid" -q "$@" || { echo "a fit failed: $*"; exit 1; }
}
fit --ratio 1 --levels 2 --time-limit 1e6 --profile --assembly 1 --owners "$work/o.csv" --report "$work/1.json"
fit --method l1 --iterations 20 --radii "$work/radii" --report "$work/2.json"
"$ovoid" measure "$work/a.pdb" "$work/a.ovoid" -q --report "$work/3.json" || exit 1
awk 'BEGIN { for (i = 0; i < 130; i++) print 1.5 * cos(i), 1.5 * sin(i), 0.5 * i, 1.5 }' >"$work/b.xyzr"
"$ovoid" fit "$work/b.xyzr" --part-atoms 64 --ratio 0.1 -o "$work/b.ovoid" -q --profile --no-measure --report "$work/6.json" || exit 1
"$ovoid" fit "$work/a.pdb" --models all --ratio 1 -o "$work/m.ovoid" -q --report "$work/5.json" || exit 1
"$ovoid" fit "$work/a.pdb" "$work/none.pdb" --ellipsoids 1 --out-dir "$work" --report "$work/4.json" -q 2>/dev/null

# Options of the methods are those of the help, with underscores.
"$ovoid" help fit | grep -o -- '--[a-z-]*' | sed 's/^--//; s/-/_/g' | sort -u >"$work/options"
grep -ho '"[a-z_0-9]*":' "$work"/?.json | tr -d '":' | sort -u >"$work/keys"
[ "$(wc -l <"$work/keys")" -gt 80 ] || { echo "too few keys:" && cat "$work/keys"; exit 1; }
sed -n '/^## The report/,/^## If/p' "$guide" | grep -o '`[a-z_0-9]*`' | tr -d '`' | sort -u >"$work/said"
comm -23 "$work/keys" "$work/said" | comm -23 - "$work/options" >"$work/missing"
sed -n '/^## The report/,/^## If/s/^| \([^|]*\) |.*/\1/p' "$guide" | grep -o '`[a-z_0-9]*`' | tr -d '`' | sort -u |
    comm -23 - "$work/keys" >"$work/invented"
[ ! -s "$work/missing" ] || { echo "$guide does not explain:" && cat "$work/missing"; status=1; }
[ ! -s "$work/invented" ] || { echo "$guide explains what is in no report:" && cat "$work/invented"; status=1; }
exit "$status"
