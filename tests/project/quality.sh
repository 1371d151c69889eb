#!/bin/sh
# quality.sh OVOID FOLDER
# The quick fits of bench/results/quality.csv are as good as recorded, within the tolerances in
# bench/quality.py. OVOID_MOLECULES names another folder in the environment.
set -u
ovoid=$1
folder=${OVOID_MOLECULES:-$2}
skip() {
    echo "skipped: $*"
    exit 77
}
command -v python3 >/dev/null || skip "no python3"
[ -d "$folder" ] || skip "no folder $folder"
"$ovoid" devices >/dev/null 2>&1 || skip "no OpenCL device"
exec python3 -B bench/quality.py --ovoid "$ovoid" --molecules "$folder" \
    --check bench/results/quality.csv
