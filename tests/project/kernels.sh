#!/bin/sh
# kernels.sh FOLDER
# Every program compiles without a warning in every shape, as OpenCL C 1.2 and without a device. A
# program is shared.h, vector.clh and its own file, or all files, one after the other
# (host/device/program.c).
set -u
folder=$1
for program in clang clang-15 clang-14; do
    command -v "$program" >/dev/null && clang=$program && break
done
if [ -z "${clang:-}" ]; then
    echo "skipped: clang is not installed"
    exit 77
fi
pack=$(sed -n 's/^#define OV_PACK \([0-9]*\)$/\1/p' "$folder/shared.h")
status=0
found=0
# check NAME FILE...: the files make a program in every shape.
check() {
    name=$1
    shift
    found=$((found + 1))
    # width x lanes x team
    for shape in 16x1x1 8x1x1 4x1x1 1x16x32 1x16x64 1x2x2; do
        lanes=${shape#*x}
        team=${lanes#*x}
        lanes=${lanes%x*}
        for file in "$folder/shared.h" "$folder/vector.clh" "$@"; do
            printf '#line 1 "%s"\n' "$file"
            cat "$file"
        done | "$clang" -target spir64 -x cl -cl-std=CL1.2 -Xclang -finclude-default-header \
            -fsyntax-only -Wall -Wno-unused-function -Werror -DOV_PACK="$pack" -DOV_VECTOR="${shape%%x*}" \
            -DOV_LANES="$lanes" -DOV_TEAM="$team" -DOV_SOLVE_GROUP="$team" - || {
            echo "$name fails in shape $shape"
            status=1
        }
    done
}

for source in "$folder"/*.cl; do
    check "$source" "$source"
done
check "all of them" "$folder"/*.cl
echo "$found programs in 6 shapes, with $clang"
[ "$found" -gt 1 ] || status=1
exit "$status"
