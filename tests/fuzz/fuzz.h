/*
 * Harnesses for readers: each is one function that takes any bytes, reads them as a file of its
 * kind, and holds what comes out to what the header promises. libFuzzer calls it with inputs of its
 * own (README.md), and replay.c with the seeds, in every build.
 */
#ifndef FUZZ_H
#define FUZZ_H

#include "ovoid/ovoid.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The harness, one in each fuzz_NAME.c; the name is libFuzzer's. Returns 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Ends the program with a message, as a finding, unless what was promised holds. */
void fuzz_require(bool holds, const char *promise);

/* Begins an input: it may take 10 seconds of the processor's time, however busy the machine is.
 * fuzz_file() does so for number 0. */
void fuzz_begin(void);

/* Path of a file in memory, number 0 or 1, that holds these bytes until the next call for the same
 * number. Nothing touches the disk. */
const char *fuzz_file(int number, const void *data, size_t size);

/* The context for all inputs. Its warnings are held to fuzz_message(). */
ovoid_context *fuzz_context(void);

/* A message may be shown on a terminal: it is UTF-8 without control characters, whatever bytes the
 * file had. */
void fuzz_message(const char *text);

/* A failure has a message, and no output. */
void fuzz_failed(ovoid_status status, const void *output);

/* A number that follows from the input alone: what a harness chooses by chance, it chooses by this.
 */
uint32_t fuzz_hash(const uint8_t *data, size_t size);

/* Reads a molecule of this format: plainly, as one of its assemblies, and with other options. */
void fuzz_molecule(const uint8_t *data, size_t size, ovoid_molecule_format format);

/* Reads a molecule and looks at all of it; NULL where it is none. */
ovoid_molecule *fuzz_read(const char *path, const ovoid_read_options *options);

#endif
