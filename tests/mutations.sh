#!/bin/sh
# mutations.sh [--check] [PATTERN]
# Breaks the code in one place at a time and runs the test that is to notice: a mutation that it
# notices is killed, one that it does not survives, and asks for a better test. Works on a copy of
# the checkout below $TMPDIR, for minutes. Only mutations whose line below matches PATTERN, if given.
# Writes CSV to standard output (bench/results/mutations.csv); fails if any survives or no longer
# applies. With --check it only says, at once, which do not change their file in one place.
set -u
cd "$(dirname "$0")/.." || exit 1
check=
if [ "${1:-}" = --check ]; then
    check=1
    shift
fi

# File, test, what is broken, and how: a program for sed. Tests run with OVOID_TEST_SMALL=1; an `+`
# before a test asks for full size, a `@16` after it for a device whose groups hold 16 at most.
mutations() {
    cat <<'LIST'
host/measure/distance.c|distance|chunks half as far as the best are skipped|s/box_distance(box, m->box) > most/box_distance(box, m->box) > 0.25 * most/
host/measure/distance.c|distance|chunks nearly as far as the best are skipped|s/box_distance(box, m->box) > most/box_distance(box, m->box) > 0.8 * most/
host/measure/bound.c|bound|a triangle reaches no farther than its corners|s|return farthest + sqrt(longest_edge(p->at) / 3.0);|return farthest;|
host/measure/bound.c|bound|nothing inside triangles is beyond a limit|s/\*told = distance > b->limits->limit;/*told = false;/
host/measure/bound.c|+bound|what is left over is forgotten|s/b->bound->most = fmax(b->bound->most, b->now.fragment\[n\].most);/;/
kernels/distance.cl|distance|across a needle is along it|s/rest\[axis\] = fma(-foot, u\[axis\], w\[axis\]);/rest[axis] = w[axis];/
kernels/distance.cl|bound|the nearest corner counts|s/max(farthest, ov_triangle_distances/min(farthest, ov_triangle_distances/
host/fit/l1/l1.c|l1|no evaluation after a failed search|s/failures > 0) .*$/false)/
host/fit/l1/l1.c|l1|a trial that is no model ends the fit|s/if (status != OVOID_ERROR_NUMERIC)/if (true)/
host/fit/l1/objective.c|l1_objective|lists count as whole while they are built|/objective->listed_count = 0;/d
host/fit/l1/objective.c|l1_objective|lists that failed count as whole|/if (status != OVOID_OK)/,/return status;/d
host/device/selector.c|device|a GPU is no better a default than a CPU|s/if (entries\[i\].info.type == OVOID_DEVICE_GPU)/if (false)/
host/device/open.c|solver@16|groups are not fitted to the device|s/while (group > 1 \&\& group > device->max_group)/while (false)/
host/device/open.c|gram@64|waves of 64 are not filled|s/wave_of(device) >= WAVE ? WAVE : WARP/WARP/
host/device/launch.c|device|groups are not fitted to the kernel|s/if (local > kernel->max_group)/if (false)/
host/device/launch.c|device|any group for a kernel compiled for one|s/if (kernel->group \&\& local != kernel->group)/if (false)/
host/device/launch.c|device|a write under way is not copied|/memcpy(copy, data, bytes);/d
host/device/launch.c|faults|a read that failed counts as done|/buffer->memory, CL_TRUE,/,/clEnqueueReadBuffer/s/return ov_cl_fail(context, code, "clEnqueueReadBuffer", NULL);/return OVOID_OK;/
host/device/launch.c|faults|a later read that failed counts as done|/buffer->memory, CL_FALSE,/,/clEnqueueReadBuffer/s/return ov_cl_fail(context, code, "clEnqueueReadBuffer", NULL);/return OVOID_OK;/
host/device/launch.c|faults|a write that failed counts as done|/bytes, copy ? copy : data, 0, NULL, NULL);/,/return ov_cl_fail/{/if (code/d;/return ov_cl_fail/d}
host/device/program.c|faults|a kernel is lost where its limits are not told|s/^    clReleaseKernel(kernel->handle);$//
host/device/error.c|faults|out of memory is any error|s/return code == CL_OUT_OF_HOST_MEMORY .*/return code == CL_SUCCESS/
host/device/devices.c|device|a device is what it did not say|s/return find_defect(entry);/find_defect(entry); return CL_SUCCESS;/
host/molecule/sites.c|faults|out of memory is a bad selection|s/return \*error ? ov_fail/return true ? ov_fail/
host/field/lists.c|l1_objective|lists cover a third of the skin|s|(skin + (double)points->rounding)|(skin / 3.0 + (double)points->rounding)|
host/fit/adaptive/solver.c|solver|the tolerance of conjugate gradients|s/(cl_float)(tolerance \* tolerance)/(cl_float)(1e4 * tolerance)/
host/fit/adaptive/refine.c|refine|no bound of axes|s/^    ov_factor_bound_decay(to, least);//
host/fit/adaptive/adaptive.c|+adaptive|calibration in the wrong direction|s/(1.0 - volume_ratio) \/ per_log/(volume_ratio - 1.0) \/ per_log/
kernels/images.cl|solver|what images feel is lost|s/sum\[k\] += back\[k\];/sum[k] += 0.0f * back[k];/
kernels/images.cl|checks|images turn the other way|s/turn_vector(r, 0, c + 1, turned + 1);/turn_vector(r, 1, c + 1, turned + 1);/
host/fit/adaptive/images.c|refine|images are where their ellipsoids are|s/ov_quadric_move(&quadrics\[i\], &f->motion\[g\], &quadrics\[place\]);/quadrics[place] = quadrics[i];/
host/fit/adaptive/local.c|local|images of those that stay are left out|s/skins, ov_followers_all(followers, taken),/skins, which ? ov_followers_all(followers, taken) : taken,/
host/fit/adaptive/local.c|local|points are not found anew|s/m->escaped =$/m->escaped = false \&\&/
host/fit/adaptive/merge.c|merge|a split forgets the variance|s/half.decay\[2\] \/= shrink;//
host/fit/adaptive/grow.c|fitter|ellipsoids that strayed are left alone|s/g->before\[n\] < g->patience || ov_reach_at/true || ov_reach_at/
host/fit/adaptive/tolerance.c|+adaptive|what confirming added stays|s/effort > 1 \&\& ov_trial_holds/effort > 99 \&\& ov_trial_holds/
host/mesh/speck_terms.c|speck_terms|small terms are missed between rows|s/^        from += step;/        from += 2 * step;/
host/measure/spots.c|judge|spots are not thinned|s/if (square < apart \* apart)/if (false)/
host/measure/excerpt.c|near|nothing that leaves the box is hidden|s/(seen->hidden_count == 0 || ov_grid_near/(true || ov_grid_near/
host/measure/excerpt.c|near|all that leaves the region is outer|s/region->hidden\[nearest\] ? -1 : 1/1/
host/measure/excerpt.c|near|what is open is told by its volume|s/component_of\[v\]\] = true;/component_of[v]] = false;/
host/measure/excerpt.c|near|points outside the box are none|s/within = asked->box;/within = \&(ov_box){{1e9, 1e9, 1e9}, {1e9, 1e9, 1e9}};/
host/mesh/march_piece.c|clip|a clipped mesh is closed|s/m->clipped \&\& axis < 3/false \&\& axis < 3/
host/measure/near.c|near|spots elsewhere are forgotten|s/if (!is_in_any(n, seen->spots.spot\[k\].at))/if (!is_in_any(n, seen->spots.spot[k].at) \&\& false)/
host/measure/judge.c|+near|none near changes are none|s/(\*spot_count == 0 \&\& !near_will_do)/(near_will_do \&\& false)/
host/mesh/components.c|mesh|walls of cavities are outer|s/mesh->component\[c\].outer = mesh->component\[c\].volume > 0.0;/mesh->component[c].outer = true;/
host/mixture/reduce.c|reduce|partners that are used up are not looked for again|s/if (list->next == list->count \&\& list->more)/if (false)/
host/molecule/pqr.c|molecule|a PDB file is not suspected|s/return !pdb->cleared \&\& atoms > 1/return false \&\& atoms > 1/
host/write/ccp4.c|map|the deviation of a map|s/of->squares \/ points - mean \* mean/of->squares \/ points/
LIST
}

try() {
    file=$1 test=$2 what=$3 program=$4
    limit=${test#*@}
    [ "$limit" != "$test" ] || limit=
    name=${test%@*}
    small=1
    case $name in +*) name=${name#+} small=0 ;; esac
    cp "$copy/$file" "$copy/whole"
    sed -i "$program" "$copy/$file"
    if cmp -s "$copy/$file" "$copy/whole"; then
        outcome=inapplicable
    elif ! ninja -C "$copy/build" "test_$name" >"$copy/log" 2>&1; then
        outcome=unbuildable
    elif (
        export OVOID_TEST_SMALL=$small OVOID_SELFTEST=off
        case $limit in
        64) export OVOID_SHAPE=1x16 OVOID_TEST_GROUP=64 \
            LD_PRELOAD="$copy/build/tests/lanes/libwave64.so" ;;
        ?*) export POCL_MAX_WORK_GROUP_SIZE="$limit" OVOID_SHAPE=1x16 OVOID_TEST_GROUP="$limit" ;;
        esac
        timeout 600 "$copy/build/tests/test_$name" >"$copy/log" 2>&1
    ); then
        outcome=survived
    else
        outcome=killed
    fi
    cp "$copy/whole" "$copy/$file"
    echo "$file,$test,$what,$outcome"
}

# Prints and returns whether a mutation still applies, in the checkout itself.
check() {
    file=$1 what=$3 program=$4
    places=$(sed "$program" "$file" | diff "$file" - | grep -c '^[0-9]')
    [ "$places" = 1 ] && return
    echo "$file: \"$what\" changes $places places"
    return 1
}

if [ "$check" ]; then
    mutations | grep -e "${1:-.}" | {
        fault=0 count=0
        while IFS='|' read -r file test what program; do
            check "$file" "$test" "$what" "$program" || fault=1
            count=$((count + 1))
        done
        echo "$count mutations"
        [ "$count" -gt 0 ] && exit "$fault"
    }
    exit
fi

copy=$(mktemp -d) || exit 1
trap 'rm -rf "$copy"' EXIT INT TERM
git ls-files -z | xargs -0 cp --parents -t "$copy" || exit 1
cmake -S "$copy" -B "$copy/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DOVOID_BUILD_BENCH=OFF \
    >/dev/null || exit 1
echo "file,test,mutation,outcome"
ninja -C "$copy/build" wave64 >/dev/null || exit 1
mutations | grep -e "${1:-.}" | while IFS='|' read -r file test what program; do
    try "$file" "$test" "$what" "$program"
done | tee "$copy/outcomes"
grep -q . "$copy/outcomes" && ! grep -v ',killed$' "$copy/outcomes" >/dev/null
