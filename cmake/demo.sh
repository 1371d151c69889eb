#!/bin/sh
# demo.sh OVOID MOLECULE FOLDER
# Fits a model to a molecule, with words around it for someone who sees Ovoid for the first time.
set -eu
ovoid=$1
molecule=$2
folder=$3

if [ ! -r "$molecule" ]; then
    echo "The demo fits $molecule, which is not there." >&2
    echo "Install Debian's package pymol-data, or name another PDB, mmCIF, PQR or XYZR file:" >&2
    echo "  cmake --preset demo -DOVOID_DEMO_MOLECULE=FILE && cmake --build --preset demo" >&2
    exit 1
fi
mkdir -p "$folder"
file=$(basename "$molecule")
name=${file%.gz}
name=${name%.*}
model=$folder/$name.ovoid
report=$folder/$name.json
trace=$folder/$name.csv

cat <<END

Programs that need a molecule's surface often take the Gaussian surface: each atom is a round
Gaussian, and the surface is where their sum is 1. Ovoid looks for far fewer Gaussians, stretched
and rotated to ellipsoids, whose sum has nearly the same surface. It merges the atoms' Gaussians to a
few and moves, stretches and splits those until the two surfaces are nowhere further apart than half
an angstrom.

The file is $molecule. The command is

  ovoid fit $file -o $name.ovoid --report $name.json --trace $name.csv

END
code=0
"$ovoid" fit "$molecule" -o "$model" --report "$report" --trace "$trace" || code=$?
[ "$code" -eq 0 ] || [ "$code" -eq 7 ] || exit "$code" # 7: a model, but not as close as asked for

# Value of a number in the report, at its outer level.
number() {
    sed -n "s/^[[:space:]]\"$1\":[[:space:]]*\([-+.0-9e]*\),*\$/\1/p" "$report"
}
atoms=$(number atoms)
ellipsoids=$(number ellipsoids)
awk -v atoms="$atoms" -v ellipsoids="$ellipsoids" -v largest="$(number deviation)" \
    -v mean="$(number mean_distance_outer)" 'BEGIN {
    printf "\n%d atoms became %d ellipsoids: %.1f atoms for each. Their outer surface is nowhere\n",
           atoms, ellipsoids, atoms / ellipsoids
    printf "further than %.2f Å from that of the atoms, and %.2f Å in the mean.\n", largest, mean
}'
cat <<END

The files are in $folder:
  $name.ovoid  the model, one ellipsoid per line: amplitude, decay rates along its three axes,
              centre, rotation angles
  $name.json   the numbers above and more, for programs
  $name.csv    the course of the fit, one line per step

The first lines of the model:

END
head -n 12 "$model" | awk '{ print (length > 96 ? substr($0, 1, 92) " ..." : $0) }'
cat <<END

Next: your own molecule, with $ovoid fit FILE, a PDB, mmCIF, PQR or XYZR file
END
