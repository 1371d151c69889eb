/*
 * Packs that are looked at by themselves: their points and targets copied together from those of
 * all packs, and targets copied back. list: numbers of the packs in question, among all. One
 * work-item per pack, whatever the shape: the kernels are bound by memory.
 */

/* A pack's OV_PACK floats, number `from`, copied to number `to`. */
static inline void copy_sixteen(__global const float *restrict all, size_t from,
                                __global float *restrict some, size_t to) {
    vstore16(vload16(from, all), to, some);
}

/* Coordinates and origins. */
__kernel void gather_points(const uint packs, __global const uint *restrict list,
                            __global const float *restrict xyz,
                            __global const float *restrict origins,
                            __global float *restrict some_xyz,
                            __global float *restrict some_origins) {
    const uint pack = get_global_id(0);
    if (pack >= packs)
        return;
    const size_t from = list[pack], to = pack;
    for (size_t axis = 0; axis < 3; ++axis)
        copy_sixteen(xyz, 3 * from + axis, some_xyz, 3 * to + axis);
    vstore4(vload4(from, origins), to, some_origins);
}

/* Targets (misfit.cl) less the values that others have at the points gathered. A bound of FLT_MAX
 * stays what it is. */
__kernel void gather_target(const uint packs, __global const uint *restrict list,
                            __global const float *restrict low, __global const float *restrict high,
                            __global const float *restrict weight,
                            __global const float *restrict value, __global float *restrict some_low,
                            __global float *restrict some_high,
                            __global float *restrict some_weight) {
    const uint pack = get_global_id(0);
    if (pack >= packs)
        return;
    const size_t from = list[pack], to = pack;
    const float16 others = vload16(to, value);
    vstore16(vload16(from, low) - others, to, some_low);
    vstore16(vload16(from, high) - others, to, some_high);
    copy_sixteen(weight, from, some_weight, to);
}

/* Puts targets where they belong. some: OV_PACK low, high and weight per pack. */
__kernel void scatter_target(const uint packs, __global const uint *restrict list,
                             __global const float *restrict some, __global float *restrict low,
                             __global float *restrict high, __global float *restrict weight) {
    const uint pack = get_global_id(0);
    if (pack >= packs)
        return;
    const size_t from = pack, to = list[pack];
    copy_sixteen(some, 3 * from, low, to);
    copy_sixteen(some, 3 * from + 1, high, to);
    copy_sixteen(some, 3 * from + 2, weight, to);
}

/* Lists the packs that some term reaches, in ascending order: list[0] of them, from list[1] on.
 * start: as field() has it. One work-group of OV_SCAN_GROUP work-items at most. */
__kernel void list_reached(const uint packs, __global const uint *restrict start,
                           __global uint *restrict list) {
    __local uint scratch[OV_SCAN_GROUP];
    const uint at = get_local_id(0), size = get_local_size(0), each = (packs + size - 1) / size;
    const uint first = min(at * each, packs), end = min(first + each, packs);
    if (get_group_id(0) > 0)
        return;
    uint reached = 0;
    for (uint k = first; k < end; ++k)
        reached += start[k + 1] > start[k] ? 1 : 0;
    scratch[at] = reached;
    barrier(CLK_LOCAL_MEM_FENCE);
    uint to = 1;
    for (uint k = 0; k < at; ++k)
        to += scratch[k];
    for (uint k = first; k < end; ++k)
        if (start[k + 1] > start[k])
            list[to++] = k;
    if (at == size - 1)
        list[0] = to - 1;
}
