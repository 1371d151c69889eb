/*
 * Loops of the host over much, in parts side by side.
 */
#ifndef OV_PARALLEL_H
#define OV_PARALLEL_H

#include <stddef.h>

/* Calls part(k, user) for each k below count, on the caller's thread and on a few others where
 * there are cores for them, and returns when all have ended. A part writes nothing that another one
 * reads, and uses no context. */
void ov_parallel(size_t count, void (*part)(size_t k, void *user), void *user);

/* Of the machine: processors that are there; 1 where nobody says. */
size_t ov_cores(void);

/* Threads at most, in tests; 0: as many as pay. */
void ov_parallel_limit(size_t threads);

#endif
