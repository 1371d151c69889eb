#!/bin/sh
# paper.sh OVOID NAMES FOLDER [VARIABLE]
# The paper's experiments on a few molecules of FOLDER give what bench/results/paper.csv records,
# within the tolerances in bench/paper.py; VARIABLE names another folder in the environment.
set -u
ovoid=$1
folder=$3
[ -z "${4:-}" ] || eval "folder=\${$4:-\$folder}"
skip() {
    echo "skipped: $*"
    exit 77
}
python=python3
command -v "$python" >/dev/null || skip "no python3"
"$ovoid" devices >/dev/null 2>&1 || skip "no OpenCL device"
exec "$python" -B bench/paper.py --ovoid "$ovoid" --molecules "$folder" --names "$2" \
    --check bench/results/paper.csv
