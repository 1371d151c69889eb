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
    bool keeps;     /* rank 0 has a checkpoint */
    double seconds; /* to stop after; 0: never */
    uint64_t atoms;
} order;

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

/* The atoms of rank 0's molecule. */
static ovoid_molecule *receive(const order *o) {
    ovoid_molecule *molecule = NULL;
    double *const xyzr = o->atoms > SIZE_MAX / (4 * sizeof *xyzr)
                             ? NULL
                             : malloc(4 * (size_t)o->atoms * sizeof *xyzr);
    if (!xyzr) {
        cli_error("out of memory for %llu atoms", (unsigned long long)o->atoms);
        mpi_abort(CLI_COMPUTE);
    }
    mpi_share(xyzr, 4 * (size_t)o->atoms * sizeof *xyzr, 0);
    if (ovoid_molecule_create(hand, xyzr, (size_t)o->atoms, &molecule) != OVOID_OK) {
        cli_error("%s", ovoid_context_error(hand));
        mpi_abort(CLI_COMPUTE);
    }
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
    ovoid_molecule *molecule = receive(o);
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

ovoid_status ranks_reach(ovoid_context *context, ovoid_fitter *fitter,
                         const ovoid_molecule *molecule, const ovoid_fit_options *options,
                         double seconds, ovoid_model **model, ovoid_fit_result *result) {
    const ovoid_exchange with = exchange();
    ovoid_fit_options shared = *options;
    const uint64_t before = gathers;
    order o = {.what = FIT,
               .options = *options,
               .keeps = options->parts.checkpoint != NULL,
               .seconds = seconds,
               .atoms = ovoid_molecule_atoms(molecule)};
    double *const xyzr = (double *)ovoid_molecule_xyzr(molecule); /* is read alone */
    o.options.parts.checkpoint = NULL;
    give_order(&o);
    mpi_share(xyzr, 4 * (size_t)o.atoms * sizeof *xyzr, 0);
    shared.parts.exchange = &with;
    const ovoid_status status = ovoid_fitter_reach(context, fitter, &shared, model, result);
    check_met(context, status, before);
    return status;
}
