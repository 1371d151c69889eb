#!/bin/sh
# demo.sh OVOID MOLECULE FOLDER
# Fits a model to a molecule, with words around it for someone who sees Ovoid for the first time.
set -eu
ovoid=$1
molecule=$2
folder=$3

if [ ! -r "$molecule" ]; then
    echo "The demo fits $molecule, which is not there." >&2
    echo "Install Debian's package apbs-data, or name another PQR file:" >&2
    echo "  cmake --preset demo -DOVOID_DEMO_MOLECULE=FILE && cmake --build --preset demo" >&2
    exit 1
fi
mkdir -p "$folder"
name=$(basename "$molecule" .pqr)
model=$folder/$name.ovoid
report=$folder/$name.json
trace=$folder/$name.csv

cat <<END

Programs that need a molecule's surface often take the Gaussian surface: each atom is a round
Gaussian, and the surface is where their sum is 1. Ovoid looks for far fewer Gaussians, stretched
and rotated to ellipsoids, whose sum has nearly the same surface. It starts with one per atom and
then, step by step, pulls useless ones towards zero, deletes them and lets the others make up for
it. This may take a minute.

The file is $molecule. The command is

  ovoid fit $name.pqr -o $name.ovoid --report $name.json --trace $name.csv

END
"$ovoid" fit "$molecule" -o "$model" --report "$report" --trace "$trace"

# Value of a number in the report, at its outer level.
number() {
    sed -n "s/^[[:space:]]\"$1\":[[:space:]]*\([-+.0-9e]*\),*\$/\1/p" "$report"
}
atoms=$(number atoms)
ellipsoids=$(number ellipsoids)
awk -v atoms="$atoms" -v ellipsoids="$ellipsoids" -v rms="$(number rms_error)" \
    -v largest="$(number max_error)" 'BEGIN {
    printf "\n%d atoms became %d ellipsoids: %.1f atoms for each. At the points near the surface,\n",
           atoms, ellipsoids, atoms / ellipsoids
    printf "where the sum of the atoms is between 0 and 2, the sum of the ellipsoids differs from it\n"
    printf "by %.2g in the mean (root mean square) and by %.2g at most.\n", rms, largest
}'
cat <<END

The files are in $folder:
  $name.ovoid  the model, one ellipsoid per line: amplitude, decay rates along its three axes,
              centre, rotation angles
  $name.json   the numbers above and more, for programs
  $name.csv    the course of the fit, one line per iteration

The first lines of the model:

END
head -n 12 "$model" | awk '{ print (length > 96 ? substr($0, 1, 92) " ..." : $0) }'
cat <<END

Next: your own molecule, with $ovoid fit FILE.pqr
END
