/*
 * What of MPI the tool takes: bytes for all, from one or from each. A failure of MPI ends the job.
 */
#ifndef CLI_MPI_H
#define CLI_MPI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct mpi_place {
    uint32_t rank, ranks;
    uint32_t local, locals; /* of the ranks on this node, from 0, and how many these are */
} mpi_place;

/* Starts MPI if a launcher has started the program, else there is one rank. Once. */
void mpi_begin(int *argc, char ***argv, mpi_place *place);
void mpi_end(void);

/* Those of rank `from`, in place. Waits without taking a core's time. */
void mpi_share(void *bytes, size_t count, uint32_t from);

/* Gives all ranks the bytes of each, sizes[rank] of them, one after the other. Waits likewise. */
void mpi_gather(const void *mine, void *all, const uint64_t *sizes, const mpi_place *place);

/* Ends all ranks at once. */
_Noreturn void mpi_abort(int code);

#endif
