#!/bin/sh
# rusticl.sh OVOID PROGRAM
# Runs a test program on rusticl, Mesa's OpenCL, with the CPU as its device (llvmpipe).
set -u
ovoid=$1
shift
icd=/etc/OpenCL/vendors/rusticl.icd
if [ ! -r "$icd" ]; then
    echo "skipped: there is no $icd (Debian: mesa-opencl-icd)"
    exit 77
fi
export OCL_ICD_VENDORS="$icd" RUSTICL_ENABLE=llvmpipe OVOID_DEVICE=rusticl OVOID_CACHE=off
if ! "$ovoid" devices | grep -q rusticl; then
    echo "skipped: rusticl has no device here"
    exit 77
fi
exec "$@"
