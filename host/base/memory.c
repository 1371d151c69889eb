#include "base/memory.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define KIB 1024u

/* A number of KiB in /proc/meminfo; false: it is not there. */
static int read_line(const char *line, const char *name, uint64_t *kib) {
    const size_t length = strlen(name);
    return strncmp(line, name, length) == 0 && sscanf(line + length, ": %" SCNu64, kib) == 1;
}

static uint64_t of_machine(void) {
    char line[256];
    uint64_t available = UINT64_MAX, swap = 0, kib;
    FILE *const file = fopen("/proc/meminfo", "r");
    while (file && fgets(line, sizeof line, file)) {
        if (read_line(line, "MemAvailable", &kib))
            available = kib * KIB;
        if (read_line(line, "SwapFree", &kib))
            swap = kib * KIB;
    }
    if (file)
        fclose(file);
    return available == UINT64_MAX ? available : available + swap;
}

/* What pages of files take of it can be freed, so that all of the limit counts. */
static uint64_t of_container(void) {
    static const char *const paths[] = {"/sys/fs/cgroup/memory.max",
                                        "/sys/fs/cgroup/memory/memory.limit_in_bytes"};
    for (size_t n = 0; n < sizeof paths / sizeof *paths; ++n) {
        uint64_t most = UINT64_MAX;
        FILE *const file = fopen(paths[n], "r");
        const int known = file && fscanf(file, "%" SCNu64, &most) == 1; /* else "max" */
        if (file)
            fclose(file);
        if (known)
            return most;
    }
    return UINT64_MAX;
}

/* The addresses that it may still use. */
static uint64_t of_process(void) {
    struct rlimit limit;
    uint64_t pages = 0;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return UINT64_MAX;
    FILE *const file = fopen("/proc/self/statm", "r");
    if (file && fscanf(file, "%" SCNu64, &pages) != 1)
        pages = 0;
    if (file)
        fclose(file);
    const uint64_t taken = pages * (uint64_t)sysconf(_SC_PAGESIZE);
    return limit.rlim_cur > taken ? limit.rlim_cur - taken : 0;
}

uint64_t ov_memory_available(void) {
    uint64_t least = of_machine();
    const uint64_t others[] = {of_container(), of_process()};
    for (size_t n = 0; n < sizeof others / sizeof *others; ++n)
        least = others[n] < least ? others[n] : least;
    return least;
}
