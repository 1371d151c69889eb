#include "fit/parts/checkpoint.h"

#include "base/sized.h"
#include "device/device.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MAGIC "ovoid checkpoint 1\n"
#define MAGIC_SIZE 24 /* filled up with 0 */

/* Of one machine: its byte order and sizes are part of it, and a file of another kind of machine is
 * of another device. */
typedef struct header {
    char magic[MAGIC_SIZE];
    uint64_t version, device, input, options, parts;
} header;

typedef struct record {
    uint64_t part, ellipsoids, atoms;
    uint64_t points, iterations, solver_iterations;
    uint64_t counts[OVOID_COUNTS];
    double spacing, distance;
    uint64_t verdict;
    uint64_t hash; /* of the ellipsoids, the owners, and of this with hash 0 */
} record;

/* ---- of what fit ----------------------------------------------------------------------------- */

static uint64_t with(uint64_t hash, const void *bytes, size_t count) {
    const uint64_t both[2] = {hash, ov_hash(bytes, count)};
    return ov_hash(both, sizeof both);
}

/* What the model depends on; not where the file is, nor how many parts are under way at once. */
static uint64_t hash_options(const ovoid_fit_options *options) {
    const ovoid_adaptive_options *const a = &options->adaptive;
    const double numbers[] = {options->decay, options->isovalue, options->spacing, options->padding,
                              a->tolerance,   a->ratio,          a->mesh_spacing};
    const uint64_t counts[] = {(uint64_t)options->method, (uint64_t)a->goal, a->ellipsoids,
                               a->effort, a->steps};
    return with(ov_hash(numbers, sizeof numbers), counts, sizeof counts);
}

static ovoid_status make_header(ovoid_context *context, const ov_parts *parts, header *made) {
    *made = (header){.magic = MAGIC,
                     .version = ov_hash(ovoid_version(), strlen(ovoid_version())),
                     .input = with(ov_hash(parts->xyzr, 4 * parts->atoms * sizeof *parts->xyzr),
                                   parts->partition.image,
                                   parts->partition.images * sizeof *parts->partition.image),
                     .options = hash_options(parts->options),
                     .parts = parts->partition.count};
    return ov_device_hash(context, &made->device);
}

static ovoid_status check_header(ovoid_context *context, const char *path, const header *found,
                                 const header *wanted) {
    const char *what = NULL;
    if (memcmp(found->magic, wanted->magic, MAGIC_SIZE) != 0)
        return ov_fail(context, OVOID_ERROR_FORMAT, "%s is no checkpoint", path);
    if (found->version != wanted->version)
        what = "another version of ovoid";
    else if (found->device != wanted->device)
        what = "another device, or another driver";
    else if (found->input != wanted->input)
        what = "other atoms";
    else if (found->options != wanted->options)
        what = "other options";
    else if (found->parts != wanted->parts)
        what = "other parts";
    return what ? ov_fail(context, OVOID_ERROR_ARGUMENT,
                          "%s is the checkpoint of a fit with %s; delete it to begin anew", path,
                          what)
                : OVOID_OK;
}

/* ---- records --------------------------------------------------------------------------------- */

static uint64_t hash_of(const record *r, const ov_found *found) {
    record plain = *r;
    plain.hash = 0;
    const uint64_t hash = with(ov_hash(&plain, sizeof plain), found->quadrics,
                               found->count * sizeof *found->quadrics);
    return with(hash, found->owner, (size_t)r->atoms * sizeof *found->owner);
}

static record record_of(const ov_parts *parts, size_t part, const ov_part_fit *fit) {
    const ovoid_fit_result *const result = &fit->result;
    record r;
    memset(&r, 0, sizeof r); /* its hash is of all bytes */
    r.part = part;
    r.ellipsoids = fit->found.count;
    r.atoms = parts->partition.part[part].count;
    r.points = result->points;
    r.iterations = result->iterations;
    r.solver_iterations = result->adaptive.solver_iterations;
    memcpy(r.counts, result->counts, sizeof r.counts);
    r.spacing = result->spacing;
    r.distance = result->distance;
    r.verdict = (uint64_t)result->verdict;
    r.hash = hash_of(&r, &fit->found);
    return r;
}

static void tell(const record *r, ovoid_fit_result *result) {
    ovoid_fit_result_init(result, sizeof *result);
    result->method = OVOID_METHOD_ADAPTIVE;
    result->ellipsoids = r->ellipsoids;
    result->points = r->points;
    result->iterations = r->iterations;
    result->adaptive.solver_iterations = r->solver_iterations;
    memcpy(result->counts, r->counts, sizeof r->counts);
    result->spacing = r->spacing;
    result->distance = r->distance;
    result->verdict = (ovoid_verdict)r->verdict;
    result->reached = result->verdict == OVOID_VERDICT_REACHED;
}

/* Reads the record that follows; *whole says whether there was one. */
static ovoid_status read_record(ovoid_context *context, FILE *file, ov_parts *parts, bool *done,
                                bool *whole) {
    ovoid_status status = OVOID_OK;
    record r;
    ov_found found = {0};
    *whole = false;
    if (fread(&r, sizeof r, 1, file) != 1 || r.part >= parts->partition.count ||
        r.atoms != parts->partition.part[r.part].count || r.ellipsoids == 0 ||
        r.ellipsoids > 2 * r.atoms + 2)
        return OVOID_OK;
    found.count = (size_t)r.ellipsoids;
    found.quadrics = ov_alloc(context, found.count, sizeof *found.quadrics, "ellipsoids");
    found.owner = ov_alloc(context, (size_t)r.atoms, sizeof *found.owner, "owners");
    if (!found.quadrics || !found.owner) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    if (fread(found.quadrics, sizeof *found.quadrics, found.count, file) != found.count ||
        fread(found.owner, sizeof *found.owner, (size_t)r.atoms, file) != r.atoms ||
        hash_of(&r, &found) != r.hash)
        goto cleanup;
    ov_part_fit *const fit = &parts->fit[r.part];
    ov_found_destroy(&fit->found);
    fit->found = found;
    done[r.part] = true;
    found = (ov_found){0};
    tell(&r, &fit->result);
    *whole = true;
cleanup:
    ov_found_destroy(&found);
    return status;
}

/* ---- the file -------------------------------------------------------------------------------- */

static ovoid_status fail_io(ovoid_context *context, const char *path, const char *what) {
    return ov_fail(context, OVOID_ERROR_IO, "%s: the checkpoint cannot be %s: %s", path, what,
                   strerror(errno));
}

/* Cuts off what lies behind the last whole record. */
static bool cut_off(ov_checkpoint *c) {
    clearerr(c->file);
    return fseek(c->file, c->end, SEEK_SET) == 0 && ftruncate(fileno(c->file), c->end) == 0;
}

static bool write_through(ov_checkpoint *c) {
    if (fflush(c->file) != 0 || fsync(fileno(c->file)) != 0)
        return false;
    c->end = ftell(c->file);
    return c->end > 0;
}

static ovoid_status begin_file(ovoid_context *context, const header *wanted, ov_checkpoint *c) {
    c->file = fopen(c->path, "wb+");
    if (!c->file)
        return fail_io(context, c->path, "made");
    if (fwrite(wanted, sizeof *wanted, 1, c->file) == 1 && write_through(c))
        return OVOID_OK;
    const ovoid_status status = fail_io(context, c->path, "written");
    unlink(c->path); /* there was nothing in it */
    return status;
}

static ovoid_status read_file(ovoid_context *context, const header *wanted, ov_parts *parts,
                              bool *done, ov_checkpoint *c) {
    ovoid_status status = OVOID_OK;
    header found;
    bool whole = true;
    if (fread(&found, sizeof found, 1, c->file) != 1)
        return ov_fail(context, OVOID_ERROR_FORMAT, "%s is no checkpoint", c->path);
    OV_TRY(check_header(context, c->path, &found, wanted));
    while (whole) {
        c->end = ftell(c->file);
        OV_TRY(read_record(context, c->file, parts, done, &whole));
    }
    if (c->end < 0 || !cut_off(c))
        status = fail_io(context, c->path, "written");
cleanup:
    return status;
}

ovoid_status ov_checkpoint_open(ovoid_context *context, const char *path, bool resume,
                                ov_parts *parts, bool *done, ov_checkpoint *checkpoint) {
    ovoid_status status = OVOID_OK;
    ov_checkpoint made = {.path = path};
    header wanted;
    OV_TRY(make_header(context, parts, &wanted));
    made.file = fopen(path, "rb+");
    if (made.file && !resume)
        OV_TRY(ov_fail(context, OVOID_ERROR_IO,
                       "%s is there already; resume from it, or delete it to begin anew", path));
    if (made.file)
        OV_TRY(read_file(context, &wanted, parts, done, &made));
    else if (errno == ENOENT)
        OV_TRY(begin_file(context, &wanted, &made));
    else
        OV_TRY(fail_io(context, path, "opened"));
    *checkpoint = made;
    made.file = NULL;
cleanup:
    ov_checkpoint_close(&made);
    return status;
}

ovoid_status ov_checkpoint_add(ovoid_context *context, ov_checkpoint *c, const ov_parts *parts,
                               size_t part, const ov_part_fit *fit) {
    const record r = record_of(parts, part, fit);
    const ov_found *const found = &fit->found;
    if (fwrite(&r, sizeof r, 1, c->file) == 1 &&
        fwrite(found->quadrics, sizeof *found->quadrics, found->count, c->file) == found->count &&
        fwrite(found->owner, sizeof *found->owner, (size_t)r.atoms, c->file) == r.atoms &&
        write_through(c))
        return OVOID_OK;
    const ovoid_status status = fail_io(context, c->path, "written");
    cut_off(c);
    return status;
}

void ov_checkpoint_close(ov_checkpoint *checkpoint) {
    if (checkpoint->file)
        fclose(checkpoint->file);
    checkpoint->file = NULL;
}
