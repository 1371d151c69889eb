# A GPU's driver is installed, as in a container, and no vendors file names it: what is said.
mkdir none libraries
library=$PWD/libraries/libnvidia-opencl.so.1
[ -z "$(find /usr/lib* /usr/local /opt -name 'libnvidia-opencl.so.1' -o -name 'libamdocl64.so' \
    -o -name libigdrcl.so 2>/dev/null)" ] || skip "such a driver is installed here"
hidden="run env OCL_ICD_VENDORS=$PWD/none/ OPENCL_VENDOR_PATH=$PWD/none OCL_ICD_FILENAMES="
$hidden "$OVOID" devices
[ ! -s "$out" ] || skip "this OpenCL loader cannot be told to find nothing"
grep -q "NVIDIA" "$err" && fail "nothing of NVIDIA's is there"

echo >"$library"
expect_hint() {
    expect_err "NVIDIA's OpenCL driver is installed, but no vendors file names it"
    expect_err "write the line $library into the file /etc/OpenCL/vendors/nvidia.icd"
    expect_err "set OCL_ICD_VENDORS to that folder"
}
for path in "$PWD/libraries" "/nowhere:$PWD/libraries" ":$PWD/libraries:"; do
    $hidden LD_LIBRARY_PATH="$path" "$OVOID" devices
    expect_code 5
    expect_hint
done
make_helix 6 a.xyzr
$hidden LD_LIBRARY_PATH="$PWD/libraries" "$OVOID" fit a.xyzr
expect_code 5
expect_hint

# Some loaders do not read the other place where it can be named.
run env OCL_ICD_VENDORS="$PWD/none/" OPENCL_VENDOR_PATH="$PWD/none" LD_LIBRARY_PATH="$PWD/libraries" \
    OCL_ICD_FILENAMES=libpocl.so.2:libnvidia-opencl.so.1 "$OVOID" devices
expect_err "no vendors file names it (OCL_ICD_FILENAMES does, which not every loader reads)"

# The file is written: then it is not that.
echo "$library" >none/nvidia.icd
$hidden LD_LIBRARY_PATH="$PWD/libraries" "$OVOID" devices
expect_code 5
expect_err "/nvidia.icd names it, but it offers no device: /dev/nvidiactl is "
grep -q "no vendors file" "$err" && fail "there is a vendors file"

# With another device the work goes on there, and is told of once unless that was asked for.
if "$OVOID" devices >"$out" 2>&1 && ! grep -q '^\*.* gpu ' "$out"; then
    run env LD_LIBRARY_PATH="$PWD/libraries" "$OVOID" devices
    expect_code 0
    [ "$(grep -c "NVIDIA's OpenCL driver is installed" "$err")" -eq 1 ] || fail "one hint was expected"
    run env LD_LIBRARY_PATH="$PWD/libraries" "$OVOID" fit a.xyzr
    expect_code 0
    [ "$(grep -c "NVIDIA's OpenCL driver is installed" "$err")" -eq 1 ] || fail "one hint was expected"
    run env LD_LIBRARY_PATH="$PWD/libraries" "$OVOID" mesh a.xyzr --device cpu
    expect_code 0
    expect_silent
    run env LD_LIBRARY_PATH="$PWD/libraries" "$OVOID" fit --quiet a.xyzr
    expect_code 0
    expect_silent
fi
