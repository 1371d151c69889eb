#include "ranks.h"

#include "mpi.h"

#include <stdlib.h>
#include <string.h>

static mpi_place place = {.ranks = 1};
static char name[32];       /* of this rank in messages */
static uint64_t gathers;    /* that fits have asked for */
static ovoid_context *hand; /* of ranks but 0: their context, with its device */

enum { TEXT = 512 }; /* bytes of what went wrong, and of a selector */

/* What rank 0 asks the others for. */
typedef struct order {
    enum { END, OPEN, FIT } what;
    char device[TEXT]; /* to open */
    ovoid_fit_options options;
    bool keeps;                 /* rank 0 has a checkpoint */
    double seconds;             /* to stop after; 0: never */
    uint64_t atoms;             /* of an assembly, of its unit */
    uint64_t parts, placements; /* of an assembly; 0: it is none */
} order;

/* Beside the number of atoms of a part: they are all of the unit. */
#define WHOLE_UNIT ((uint64_t)1 << 63)

static void give_order(const order *o) {
    order copy = *o;
    mpi_share(&copy, sizeof copy, 0);
}

uint32_t ranks_count(void) {
    return place.ranks;
}

/* ---- exchanging ------------------------------------------------------------------------------ */

/* An ovoid_exchange's. */
static int gather(const void *mine, void *all, const uint64_t *sizes, void *user) {
    (void)user;
    ++gathers;
    mpi_gather(mine, all, sizes, &place);
    return 0;
}

static ovoid_exchange exchange(void) {
    return (ovoid_exchange){.rank = place.rank, .ranks = place.ranks, .gather = gather};
}

/* A fit that ends before it has met the other ranks leaves them waiting. */
static void check_met(const ovoid_context *context, ovoid_status status, uint64_t before) {
    if (status != OVOID_OK && gathers == before) {
        cli_error("%s", ovoid_context_error(context));
        mpi_abort(CLI_INTERNAL);
    }
}

/* ---- devices --------------------------------------------------------------------------------- */

static bool type_of(const char *text, ovoid_device_type *type) {
    static const char *const names[] = {"cpu", "gpu", "accelerator"};
    for (int i = 0; i < 3; i++)
        if (strcmp(text, names[i]) == 0) {
            *type = (ovoid_device_type)i;
            return true;
        }
    return false;
}

/* The index of the device that is this rank's of those of a type, or of all; false: there are none,
 * or they cannot be listed, which opening one says. */
static bool turn_of(ovoid_context *context, const ovoid_device_type *type, char text[TEXT]) {
    ovoid_device_info *devices = NULL;
    size_t count = 0, matching = 0;
    if (ovoid_devices(context, sizeof *devices, &devices, &count) != OVOID_OK)
        return false;
    for (size_t i = 0; i < count; i++)
        matching += !type || devices[i].type == *type;
    size_t turn = matching ? place.local % matching : 0;
    for (size_t i = 0; i < count && matching; i++)
        if ((!type || devices[i].type == *type) && turn-- == 0) {
            snprintf(text, TEXT, "%u", (unsigned)devices[i].index);
            break;
        }
    ovoid_free(devices);
    return matching > 0;
}

/* One of a list, by turns. */
static void item_of(const char *list, char text[TEXT]) {
    size_t items = 1;
    for (const char *c = list; *c; c++)
        items += *c == ',';
    for (size_t skip = place.local % items; skip > 0; list++)
        skip -= *list == ',';
    while (*list == ' ')
        list++;
    snprintf(text, TEXT, "%.*s", (int)strcspn(list, ","), list);
}

const char *ranks_device(ovoid_context *context, const char *asked) {
    static char text[TEXT];
    static const ovoid_device_type gpu = OVOID_DEVICE_GPU;
    ovoid_device_type type;
    if (place.ranks == 1)
        return asked;
    if (!asked || !asked[0])
        asked = getenv("OVOID_DEVICE");
    if (!asked || !asked[0])
        return turn_of(context, &gpu, text) ? text : NULL;
    const bool several =
        strchr(asked, ',') || strcmp(asked, "all") == 0 || strcmp(asked, "gpus") == 0;
    if (several && place.locals == 1)
        return asked; /* all of them */
    if (strcmp(asked, "gpus") == 0)
        return turn_of(context, &gpu, text) ? text : asked;
    if (strchr(asked, ',')) {
        item_of(asked, text);
        return text;
    }
    if (strcmp(asked, "all") == 0)
        return turn_of(context, NULL, text) ? text : asked;
    return type_of(asked, &type) && turn_of(context, &type, text) ? text : asked;
}

/* What became of opening them: the first rank that could not, with its reason. */
typedef struct opened {
    ovoid_status status;
    char text[TEXT];
} opened;

static void say_opened(const opened *mine, uint32_t *rank, opened *first) {
    *first = (opened){.status = OVOID_OK};
    for (uint32_t n = 0; n < place.ranks; n++) {
        opened one = *mine;
        mpi_share(&one, sizeof one, n);
        if (one.status != OVOID_OK && first->status == OVOID_OK) {
            *first = one;
            *rank = n;
        }
    }
}

bool ranks_open(const char *asked, int *code) {
    const opened mine = {.status = OVOID_OK};
    order o = {.what = OPEN};
    opened first;
    uint32_t rank = 0;
    if (place.ranks == 1)
        return true;
    if (!asked || !asked[0])
        asked = getenv("OVOID_DEVICE");
    snprintf(o.device, TEXT, "%s", asked ? asked : "");
    give_order(&o);
    say_opened(&mine, &rank, &first);
    if (first.status == OVOID_OK)
        return true;
    cli_error("rank %u: %s", (unsigned)rank, first.text);
    *code = CLI_DEVICE;
    return false;
}

/* ---- ranks but 0 ----------------------------------------------------------------------------- */

static double stop_at; /* cli_seconds(); 0: never */

static bool go_on(const ovoid_progress *progress, void *user) {
    return cli_on_progress(progress, user) && !(stop_at > 0.0 && cli_seconds() >= stop_at);
}

static void open_device(const order *o) {
    static char open[TEXT];
    static bool quiet = true;
    opened mine = {.status = OVOID_OK}, first;
    uint32_t rank;
    int code;
    if (!hand && !cli_context(&quiet, &hand, &code))
        mpi_abort(code);
    ovoid_context_on_progress(hand, go_on, NULL);
    if (!ovoid_context_device(hand) || strcmp(open, o->device) != 0)
        mine.status = ovoid_context_open_device(hand, ranks_device(hand, o->device));
    snprintf(open, TEXT, "%s", o->device);
    if (mine.status != OVOID_OK)
        snprintf(mine.text, TEXT, "%s", ovoid_context_error(hand));
    say_opened(&mine, &rank, &first);
}

/* So many bytes of rank 0, to be freed. */
static void *receive(uint64_t count, size_t size) {
    void *const made = count > SIZE_MAX / size - 1 ? NULL : malloc((size_t)count * size + 1);
    if (!made) {
        cli_error("out of memory for what rank 0 sends (%llu times %zu bytes)",
                  (unsigned long long)count, size);
        mpi_abort(CLI_COMPUTE);
    }
    mpi_share(made, (size_t)count * size, 0);
    return made;
}

/* Parts of the unit: how many atoms each has, then which; of the whole unit it does not say. */
static ovoid_unit_part *receive_parts(const order *o) {
    uint64_t *const counts = receive(o->parts, sizeof *counts);
    ovoid_unit_part *const parts = calloc((size_t)o->parts + 1, sizeof *parts);
    if (!parts)
        mpi_abort(CLI_COMPUTE);
    for (uint64_t p = 0; p < o->parts; p++) {
        parts[p].count = (size_t)(counts[p] & ~WHOLE_UNIT);
        if (!(counts[p] & WHOLE_UNIT))
            parts[p].atoms = receive(parts[p].count, sizeof *parts->atoms);
    }
    free(counts);
    return parts;
}

/* Rank 0's molecule: its atoms, or those of its unit and its placements. */
static ovoid_molecule *receive_molecule(const order *o) {
    ovoid_molecule *molecule = NULL;
    double *const xyzr = receive(o->atoms, 4 * sizeof *xyzr);
    ovoid_unit_part *const parts = receive_parts(o);
    ovoid_placement *const placements = receive(o->placements, sizeof *placements);
    const ovoid_status status =
        o->placements > 0
            ? ovoid_molecule_create_placed(hand, xyzr, (size_t)o->atoms, parts, (size_t)o->parts,
                                           placements, (size_t)o->placements, &molecule)
            : ovoid_molecule_create(hand, xyzr, (size_t)o->atoms, &molecule);
    if (status != OVOID_OK) {
        cli_error("%s", ovoid_context_error(hand));
        mpi_abort(CLI_COMPUTE);
    }
    for (uint64_t p = 0; p < o->parts; p++)
        free((void *)(uintptr_t)parts[p].atoms);
    free(parts);
    free(placements);
    free(xyzr);
    return molecule;
}

/* What goes wrong from here on rank 0 says: all know it. */
static void fit(const order *o) {
    static const char rank_0s[] = "the file of rank 0";
    const ovoid_exchange with = exchange();
    ovoid_fit_options options = o->options;
    ovoid_model *model = NULL;
    const uint64_t before = gathers;
    stop_at = o->seconds > 0.0 ? cli_seconds() + o->seconds : 0.0;
    ovoid_molecule *molecule = receive_molecule(o);
    options.parts.exchange = &with;
    options.parts.checkpoint = o->keeps ? rank_0s : NULL;
    check_met(hand, ovoid_fit(hand, molecule, &options, &model, NULL), before);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

bool ranks_serve(int *argc, char ***argv, int *code) {
    order o;
    mpi_begin(argc, argv, &place);
    cli_keep_signals();
    if (place.rank == 0)
        return false;
    snprintf(name, sizeof name, "rank %u", (unsigned)place.rank);
    cli_message_speaker(name);
    cli_hush_interrupted();
    for (;;) {
        mpi_share(&o, sizeof o, 0);
        if (o.what == END)
            break;
        if (o.what == OPEN)
            open_device(&o);
        else
            fit(&o);
    }
    ovoid_context_destroy(&hand);
    mpi_end();
    *code = CLI_OK;
    return true;
}

/* ---- rank 0 ---------------------------------------------------------------------------------- */

void ranks_end(void) {
    const order o = {.what = END};
    give_order(&o);
    mpi_end();
}

/* How many parts the placements speak of. */
static uint64_t parts_of(const ovoid_placement *placements, size_t count) {
    uint64_t parts = 0;
    for (size_t n = 0; n < count; n++)
        parts = placements[n].part >= parts ? (uint64_t)placements[n].part + 1 : parts;
    return parts;
}

/* MPI's own calls take what they only read as if they changed it. */
static void send(const void *bytes, size_t count) {
    mpi_share((void *)(uintptr_t)bytes, count, 0);
}

static void send_parts(const ovoid_molecule *molecule, uint64_t parts) {
    for (uint64_t p = 0; p < parts; p++) {
        size_t count;
        const uint32_t *const atoms = ovoid_molecule_part(molecule, (uint32_t)p, &count);
        if (atoms)
            send(atoms, count * sizeof *atoms);
    }
}

static void send_counts(const ovoid_molecule *molecule, uint64_t parts) {
    uint64_t *const counts = calloc((size_t)parts + 1, sizeof *counts);
    if (!counts)
        mpi_abort(CLI_COMPUTE);
    for (uint64_t p = 0; p < parts; p++) {
        size_t count;
        const bool whole = !ovoid_molecule_part(molecule, (uint32_t)p, &count);
        counts[p] = count | (whole ? WHOLE_UNIT : 0);
    }
    send(counts, (size_t)parts * sizeof *counts);
    free(counts);
}

static void send_molecule(const ovoid_molecule *molecule, order *o) {
    size_t placements;
    const ovoid_placement *const placed = ovoid_molecule_placements(molecule, &placements);
    o->atoms = ovoid_molecule_unit_atoms(molecule);
    o->placements = placements;
    o->parts = parts_of(placed, placements);
    give_order(o);
    send(ovoid_molecule_unit_xyzr(molecule), 4 * (size_t)o->atoms * sizeof(double));
    send_counts(molecule, o->parts);
    send_parts(molecule, o->parts);
    send(placed, placements * sizeof *placed);
}

ovoid_status ranks_reach(ovoid_context *context, ovoid_fitter *fitter,
                         const ovoid_molecule *molecule, const ovoid_fit_options *options,
                         double seconds, ovoid_model **model, ovoid_fit_result *result) {
    const ovoid_exchange with = exchange();
    ovoid_fit_options shared = *options;
    const uint64_t before = gathers;
    order o = {.what = FIT,
               .options = *options,
               .keeps = options->parts.checkpoint != NULL,
               .seconds = seconds};
    o.options.parts.checkpoint = NULL;
    send_molecule(molecule, &o);
    shared.parts.exchange = &with;
    const ovoid_status status = ovoid_fitter_reach(context, fitter, &shared, model, result);
    check_met(context, status, before);
    return status;
}
