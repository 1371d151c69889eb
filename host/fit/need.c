#include "fit/need.h"

#include "base/memory.h"

/* Of each atom of the molecule: where it is, who it is, and whose it becomes. */
#define EACH 100.0
/* Of each atom that is fitted at a time: points, meshes and lists of 48,519 atoms take 4.8 kB, of
 * 120,120 atoms 3.8 kB of each (bench/scaling.py), and what lies about a part comes on top. */
#define EACH_AT_A_TIME 3000.0

/* A fit comes to several times what it is sure to take. */
#define ROOM 4.0

#define GB 1e9

double ov_need_bytes(const ov_need *need) {
    const double jobs = need->jobs > 1 ? (double)need->jobs : 1.0;
    const double parts = (double)need->atoms / (double)(need->largest > 0 ? need->largest : 1);
    const double at_a_time = (jobs < parts ? jobs : parts) * (double)need->largest;
    return EACH * (double)need->atoms + EACH_AT_A_TIME * at_a_time;
}

ovoid_status ov_need_compare(ovoid_context *context, const ov_need *need, uint64_t available) {
    const double bytes = ov_need_bytes(need);
    if (bytes <= (double)available)
        return OVOID_OK;
    if (need->largest == need->atoms)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "a fit of %zu atoms as a whole takes at least %.2g GB of memory, and there "
                       "are %.2g GB; fit it in parts (parts.atoms, --part-atoms)",
                       need->atoms, bytes / GB, (double)available / GB);
    return ov_fail(context, OVOID_ERROR_LIMIT,
                   "a fit of %zu atoms, %zu part%s of up to %zu of them at a time, takes at least "
                   "%.2g GB of memory, and there are %.2g GB; fit smaller parts (parts.atoms, "
                   "--part-atoms)%s",
                   need->atoms, need->jobs > 1 ? need->jobs : (size_t)1, need->jobs > 1 ? "s" : "",
                   need->largest, bytes / GB, (double)available / GB,
                   need->jobs > 1 ? ", or fewer at a time (parts.jobs, --jobs)" : "");
}

bool ov_need_fits(const ov_device *device, const ov_need *need) {
    const bool own = device->info.type != OVOID_DEVICE_CPU;
    const uint64_t available = own ? device->info.global_memory : ov_memory_available();
    return ROOM * ov_need_bytes(need) <= (double)available;
}

ovoid_status ov_need_check(ovoid_context *context, const ov_need *need) {
    ov_device *device;
    const ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK || device->info.type != OVOID_DEVICE_CPU)
        return status;
    return ov_need_compare(context, need, ov_memory_available());
}
