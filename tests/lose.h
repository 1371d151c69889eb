/*
 * A device that is lost, made to order: the OpenCL calls of a program pass through lose.c on their
 * way to the loader, and from the N-th on those to one device fail, as they do when a GPU falls off
 * the bus or has no memory left. Linked into a test, or put before a program (LD_PRELOAD), which
 * sets it with OVOID_TEST_LOSE=DEVICE:N:CODE, the device by its place among those of its platform.
 */
#ifndef LOSE_H
#define LOSE_H

#include <stddef.h>

/* From now on calls to the device of this place are counted; the at-th, counted from 1, and those
 * after it fail with the code. at == 0: none fails. */
void lose_device(size_t place, size_t at, int code);

/* How many calls there were to it since then. */
size_t lose_calls(void);

/* How many contexts were made since then, of all devices. */
size_t lose_contexts(void);

#endif
