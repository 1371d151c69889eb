# PoCL keeps compiled kernels in a folder, runs them from there, and ends the process where it cannot:
# another folder is taken, and the user is told why. Mounts are of a name space of their own.
need_device
"$OVOID" devices | grep -q '^\*.*Portable Computing' || skip "the default device is not PoCL's"
make_helix 3 a.xyzr
unset POCL_CACHE_DIR XDG_CACHE_HOME
here=$PWD
mkdir home temporary

# with SCRIPT [NAME=VALUE]...: meshes in a name space in which the script has been run first.
with() {
    script=$1
    shift
    rm -f a.ply
    run env HOME="$here/home" TMPDIR="$here/temporary" "$@" unshare $unshare sh -c \
        "$script"' && exec "$0" mesh a.xyzr' "$OVOID"
}

expect_match() { grep -q -- "$1" "$err" || fail "standard error should match: $1"; }

# Expects the mesh, and a warning that names the first folder, why not it, and the one used instead.
expect_replaced() {
    expect_code 0
    [ -s a.ply ] || fail "the mesh should be there"
    expect_match "ovoid: warning: PoCL's cache folder $1.*$2.*; it uses .*/ovoid-pocl-[0-9]* for this run"
}

expect_quiet() {
    expect_code 0
    [ -s a.ply ] || fail "the mesh should be there"
    [ ! -s "$err" ] || fail "nothing was to be said"
}

for unshare in "-m" "-rm" ""; do
    [ -z "$unshare" ] || unshare $unshare mount -t tmpfs tmpfs home 2>/dev/null && break
done

# Without a mount: not writable, a relative folder, an empty name, no HOME.
saved=$unshare
run_plain() {
    rm -f a.ply
    run env "$@" TMPDIR="$here/temporary" "$OVOID" mesh a.xyzr
}
echo >file
run_plain HOME="$here/file"
expect_replaced "$here/file/.cache/pocl/kcache" "cannot be written: Not a directory"
run_plain POCL_CACHE_DIR="$here/file/x"
expect_replaced "$here/file/x" "cannot be written: Not a directory"
run_plain HOME="$here/home" XDG_CACHE_HOME=relative
expect_quiet
run_plain HOME="$here/home" POCL_CACHE_DIR=
expect_quiet
run_plain -u HOME
expect_code 0
[ -s a.ply ] || fail "the mesh should be there"

unshare=$saved
[ -n "$unshare" ] || skip "nothing can be mounted here: noexec and full disks were not tried"
case $OVOID in /tmp/* | /var/tmp/* | /dev/shm/*) skip "the program would be hidden by a mount" ;; esac
rm -rf home/.cache
with 'mount -t tmpfs -o noexec tmpfs home'
expect_replaced "$here/home/.cache/pocl/kcache" "noexec"
with 'mount -t tmpfs -o size=64k tmpfs home'
expect_replaced "$here/home/.cache/pocl/kcache" "full disk: [0-9.]* MiB are left"
with 'mount -t tmpfs -o size=1m tmpfs home && mount -t tmpfs -o noexec tmpfs temporary'
expect_replaced "$here/home/.cache/pocl/kcache" "full disk: [0-9.]* MiB are left"
grep -q "it uses $here/temporary" "$err" && fail "programs cannot run there either"

# No folder is left: the reason is said, and the process ends in order. This hides the folders of this
# test as well.
nowhere='for d in /tmp /var/tmp /dev/shm; do mount -t tmpfs -o noexec tmpfs $d || exit 99; done'
with "$nowhere"
[ "$code" -ne 99 ] || skip "these folders cannot be mounted over"
expect_match "ovoid: warning: the devices of PoCL are left out: PoCL's cache folder $here/home.*noexec.*POCL_CACHE_DIR"
[ "$code" -lt 128 ] || fail "the process should not have been ended by a signal"
full=$(echo "$nowhere" | sed 's/noexec/size=64k/')
with "$full"
expect_match "the disk with .* '$here/[a-z]*.*' is full: [0-9.]* MiB are left"
expect_err "ovoid: error: "
[ "$code" -eq 1 ] || fail "1 was expected"
[ ! -e a.ply ] || fail "there should be no mesh"
