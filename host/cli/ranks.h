/*
 * Several processes of the tool that MPI started (cmake -DOVOID_MPI=ON): rank 0 is the tool as it
 * always is, and alone reads, prints and writes. The others wait for what it asks: to open a
 * device, to share a fit, to end. Without MPI, or where no launcher has started the program, there
 * is one.
 */
#ifndef CLI_RANKS_H
#define CLI_RANKS_H

#include "cli.h"

/* ranks_version(): the second line of --version, "" where there is none. */

#ifdef OVOID_MPI

static inline const char *ranks_version(void) {
    return "with MPI\n";
}

/* Before any other work, when signals are caught. True on all ranks but 0, when rank 0 has ended:
 * the program ends, with *code. */
bool ranks_serve(int *argc, char ***argv, int *code);

/* Rank 0's end: lets the others go. */
void ranks_end(void);

/* How many there are. */
uint32_t ranks_count(void);

/* The device of this rank among those that `asked` (NULL: nothing is) allows, by its number among
 * the ranks of its node: of a list, of a type, of 'all', and where nothing is asked of the GPUs. */
const char *ranks_device(ovoid_context *context, const char *asked);

/* Has each of the others open its device. False: one of them cannot, all said, and *code is the
 * exit code. */
bool ranks_open(const char *asked, int *code);

/* As ovoid_fit(), shared by all, whose devices are open. In so many seconds (0: never) the others
 * stop, too. */
ovoid_status ranks_reach(ovoid_context *context, ovoid_fitter *fitter,
                         const ovoid_molecule *molecule, const ovoid_fit_options *options,
                         double seconds, ovoid_model **model, ovoid_fit_result *result);

#else

static inline const char *ranks_version(void) {
    return "";
}

static inline bool ranks_serve(int *argc, char ***argv, int *code) {
    (void)argc, (void)argv, (void)code;
    return false;
}

static inline void ranks_end(void) {
}

static inline uint32_t ranks_count(void) {
    return 1;
}

static inline const char *ranks_device(ovoid_context *context, const char *asked) {
    (void)context;
    return asked;
}

static inline bool ranks_open(const char *asked, int *code) {
    (void)asked, (void)code;
    return true;
}

static inline ovoid_status ranks_reach(ovoid_context *context, ovoid_fitter *fitter,
                                       const ovoid_molecule *molecule,
                                       const ovoid_fit_options *options, double seconds,
                                       ovoid_model **model, ovoid_fit_result *result) {
    (void)molecule, (void)seconds;
    return ovoid_fitter_reach(context, fitter, options, model, result);
}

#endif
#endif
