/*
 * How much memory there is to be had.
 */
#ifndef OV_MEMORY_H
#define OV_MEMORY_H

#include <stdint.h>

/* Bytes that this process can still have, at most: what the machine has free or can free, with its
 * swap, what the container is limited to, and what the process is. UINT64_MAX: nobody says. */
uint64_t ov_memory_available(void);

#endif
