#include "mpi.h"

#include <stdlib.h>
#include <time.h>

#include <mpi.h>

/* Bytes of one call, which counts them as an int. */
static const size_t most = (size_t)1 << 30;

static bool running;

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
    look_around(place);
}

void mpi_end(void) {
    if (running)
        MPI_Finalize();
    running = false;
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
