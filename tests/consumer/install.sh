#!/bin/sh
# install.sh KIND BUILD FOLDER
# Installs from BUILD, which is made here if it is not there, and moves what it installed to FOLDER:
# an installed copy must work where it was not meant to be. KIND is shared or static. Environment:
# CMAKE, CMAKE_GENERATOR, CC. The current folder is that of the sources.
set -eu
kind=$1
build=$2
folder=$3
if [ ! -e "$build/ovoid" ]; then
    shared=OFF
    [ "$kind" = static ] || shared=ON
    "$CMAKE" -S . -B "$build" -DBUILD_SHARED_LIBS=$shared -DOVOID_WERROR=ON \
        -DOVOID_BUILD_TESTS=OFF -DOVOID_BUILD_BENCH=OFF >/dev/null
fi
case "$build" in */build-"$kind") "$CMAKE" --build "$build" ;; esac
rm -rf "$folder" "$folder.first"
"$CMAKE" --install "$build" --prefix "$folder.first"
mv "$folder.first" "$folder"

for pattern in include/ovoid/ovoid.h include/ovoid/opencl.h bin/ovoid 'lib*/cmake/ovoid/ovoidConfig.cmake' \
    'lib*/cmake/ovoid/ovoidConfigVersion.cmake' share/doc/ovoid/LICENSE share/man/man1/ovoid.1 \
    share/man/man1/ovoid-fit.1 share/bash-completion/completions/ovoid; do
    find "$folder" -path "$folder/$pattern" | grep -q . || { echo "$pattern is missing"; exit 1; }
done
library='libovoid.so libovoid.so.1'
[ "$kind" = shared ] || library=libovoid.a
for name in $library ovoid.pc; do
    find "$folder" -name "$name" | grep -q . || { echo "$name is missing"; exit 1; }
done
if grep -rIl "$folder.first" "$folder"; then
    echo "These files name the folder that they were installed to."
    exit 1
fi
"$folder/bin/ovoid" --version
