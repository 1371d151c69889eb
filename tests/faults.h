/*
 * Failures made to order: the OpenCL calls of a test program pass through faults.c on their way to
 * the loader, and the linker hands it the library's allocations (ovoid_faults() of CMakeLists.txt).
 */
#ifndef FAULTS_H
#define FAULTS_H

#include <stdbool.h>
#include <stddef.h>

typedef enum fault_kind {
    FAULT_OPENCL, /* a call of OpenCL fails, a release having done its work */
    FAULT_MEMORY, /* malloc(), calloc(), realloc(), strdup() of the library's C code give NULL */
    FAULT_NEW     /* C++'s operator new throws */
} fault_kind;

/* From now on calls of this kind are counted; the `at`-th of them fails, counted from 1, and with
 * `on` those after it, too, as when a device is lost or memory is used up. at == 0: none. */
void faults_arm(fault_kind kind, size_t at, bool on);

/* Nothing fails or is counted any more. Returns how many calls there were. */
size_t faults_disarm(void);

/* What call number `at` was since faults_arm(), counted from 1: its name, and whether it was to
 * make an event; NULL for none. */
const char *faults_call(size_t at);

/* The call that failed first since faults_arm(), NULL for none, and what it answered. */
const char *faults_first(void);
int faults_code(void);

/* The call that failed and is named in the text; NULL: none. */
const char *faults_named(const char *text);

/* OpenCL objects, and allocations, that were made and not released so far. */
long faults_objects(void);
long faults_allocations(void);

#endif
