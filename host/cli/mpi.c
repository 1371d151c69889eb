#include "mpi.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <mpi.h>

/* Bytes of one call, which counts them as an int. */
static const size_t most = (size_t)1 << 30;

static bool running;
static int *counts; /* of a gather: of each rank its bytes, then where they begin */

/* Open MPI's mpirun, PMIx (also of Slurm), PMI (MPICH, Slurm). MPI without a launcher would start a
 * daemon of its own for one rank. */
static bool was_launched(void) {
    static const char *const marks[] = {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"};
    for (size_t i = 0; i < sizeof marks / sizeof *marks; i++)
        if (getenv(marks[i]))
            return true;
    return false;
}

static void look_around(mpi_place *place) {
    MPI_Comm node;
    int rank, ranks;
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
    MPI_Comm_rank(node, &rank);
    MPI_Comm_size(node, &ranks);
    MPI_Comm_free(&node);
    place->local = (uint32_t)rank;
    place->locals = (uint32_t)ranks;
}

void mpi_begin(int *argc, char ***argv, mpi_place *place) {
    int threads, rank, ranks;
    *place = (mpi_place){.ranks = 1, .locals = 1};
    if (!was_launched())
        return;
    MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &threads);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    running = true;
    *place = (mpi_place){.rank = (uint32_t)rank, .ranks = (uint32_t)ranks};
    counts = calloc((size_t)ranks, 2 * sizeof *counts);
    if (!counts)
        mpi_abort(EXIT_FAILURE);
    look_around(place);
}

void mpi_end(void) {
    if (running)
        MPI_Finalize();
    running = false;
    free(counts);
    counts = NULL;
}

_Noreturn void mpi_abort(int code) {
    if (running)
        MPI_Abort(MPI_COMM_WORLD, code);
    exit(code);
}

/* MPI's own waiting takes a core, which the devices of processors need; ranks wait for minutes. */
static void await(MPI_Request *request) {
    struct timespec pause = {.tv_nsec = 20000};
    int done = 0;
    for (;;) {
        MPI_Test(request, &done, MPI_STATUS_IGNORE);
        if (done)
            return;
        nanosleep(&pause, NULL);
        if (pause.tv_nsec < 5000000)
            pause.tv_nsec += pause.tv_nsec / 8;
    }
}

void mpi_share(void *bytes, size_t count, uint32_t from) {
    unsigned char *at = bytes;
    while (running && count > 0) {
        const size_t now = count < most ? count : most;
        MPI_Request request;
        MPI_Ibcast(at, (int)now, MPI_BYTE, (int)from, MPI_COMM_WORLD, &request);
        await(&request);
        at += now;
        count -= now;
    }
}

/* Whether they are few enough for one call, on all ranks alike. */
static bool count_bytes(const uint64_t *sizes, uint32_t ranks) {
    size_t sum = 0;
    for (uint32_t n = 0; n < ranks; n++) {
        if (sizes[n] > most - sum)
            return false;
        counts[n] = (int)sizes[n];
        counts[ranks + n] = (int)sum;
        sum += (size_t)sizes[n];
    }
    return true;
}

void mpi_gather(const void *mine, void *all, const uint64_t *sizes, const mpi_place *place) {
    unsigned char *at = all;
    if (count_bytes(sizes, place->ranks)) {
        MPI_Request request;
        MPI_Iallgatherv(mine, counts[place->rank], MPI_BYTE, all, counts, counts + place->ranks,
                        MPI_BYTE, MPI_COMM_WORLD, &request);
        await(&request);
        return;
    }
    for (uint32_t rank = 0; rank < place->ranks; at += sizes[rank++]) {
        if (rank == place->rank && sizes[rank] > 0)
            memcpy(at, mine, (size_t)sizes[rank]);
        mpi_share(at, (size_t)sizes[rank], rank);
    }
}
