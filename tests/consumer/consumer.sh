#!/bin/sh
# consumer.sh KIND WAY PREFIX
# Builds three programs with the library installed below PREFIX, shared or static (KIND), found by
# CMake or by pkg-config (WAY: cmake or pkgconfig): consumer.c fits a molecule, fields.c makes a field
# once and works with it, opencl.c has an OpenCL context of its own. Environment: CMAKE,
# CMAKE_GENERATOR, CC.
set -eu
kind=$1
way=$2
prefix=$3
sources=$PWD/tests/consumer
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
libdir=$(dirname "$(find "$prefix" -name 'libovoid.*' | head -n 1)")

if [ "$way" = cmake ]; then
    "$CMAKE" -S "$sources" -B "$work/build" -DCMAKE_PREFIX_PATH="$prefix"
    "$CMAKE" --build "$work/build"
    programs=$work/build
else
    export PKG_CONFIG_PATH="$libdir/pkgconfig"
    option=
    [ "$kind" = shared ] || option=--static
    programs=$work
    for name in consumer fields opencl; do
        "$CC" -Wall -Wextra -Werror "$sources/$name.c" -o "$programs/$name" \
            $(pkg-config $option --cflags --libs ovoid OpenCL) -lm
    done
fi

# Hydrogen fluoride and a carbon atom beside it.
cat >"$work/molecule.xyzr" <<'END'
0.00 0.00 0.00 1.47
0.92 0.00 0.00 1.20
2.10 1.40 0.30 1.70
END
export LD_LIBRARY_PATH="$libdir"
"$programs/fields" "$work/molecule.xyzr"
"$programs/opencl" "$work/molecule.xyzr"
"$programs/consumer" "$work/molecule.xyzr" "$work/model.ovoid"
count=$(grep -vc '^#' "$work/model.ovoid")
if [ "$count" -lt 1 ] || [ "$count" -gt 3 ]; then
    echo "The model has $count ellipsoids."
    exit 1
fi
if "$prefix/bin/ovoid" fit "$work/molecule.xyzr" -o "$work/tool.ovoid" --quiet &&
    [ "$(grep -v '^#' "$work/model.ovoid")" = "$(grep -v '^#' "$work/tool.ovoid")" ]; then
    echo "$count ellipsoids, as the installed tool has them"
else
    echo "The consumer's model is not the tool's."
    exit 1
fi
