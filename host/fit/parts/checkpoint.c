#include "fit/parts/checkpoint.h"

#include "device/device.h"
#include "fit/options.h"
#include "fit/parts/record.h"

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

/* ---- of what fit ----------------------------------------------------------------------------- */

static ovoid_status make_header(ovoid_context *context, const ov_parts *parts, header *made) {
    *made =
        (header){.magic = MAGIC,
                 .version = ov_hash(ovoid_version(), strlen(ovoid_version())),
                 .input = ov_hash_with(ov_hash(parts->xyzr, 4 * parts->atoms * sizeof *parts->xyzr),
                                       parts->partition.image,
                                       parts->partition.images * sizeof *parts->partition.image),
                 .options = ov_fit_options_hash(parts->options),
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

/* Reads the record that follows; *whole says whether there was one. */
static ovoid_status read_record(ovoid_context *context, FILE *file, ov_parts *parts, bool *done,
                                bool *whole) {
    ovoid_status status = OVOID_OK;
    ov_record record;
    ov_part_fit fit = {0};
    void *rest = NULL;
    *whole = false;
    if (fread(&record, sizeof record, 1, file) != 1 || record.part >= parts->partition.count ||
        record.atoms != parts->partition.part[record.part].count || record.ellipsoids == 0 ||
        !ov_record_is_sound(&record))
        return OVOID_OK;
    const size_t size = ov_record_rest(&record);
    rest = ov_alloc(context, size, 1, "a part");
    if (!rest)
        return OVOID_ERROR_MEMORY;
    if (fread(rest, 1, size, file) == size) {
        ov_reading from = {rest, size};
        status = ov_record_read(context, &record, &from, &fit);
        *whole = status == OVOID_OK;
    }
    if (status == OVOID_ERROR_FORMAT)
        status = OVOID_OK; /* what follows is lost */
    if (*whole) {
        ov_found_destroy(&parts->fit[record.part].found);
        parts->fit[record.part] = fit;
        done[record.part] = true;
    }
    free(rest);
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
    ovoid_status status = OVOID_OK;
    ov_bytes bytes = {0};
    OV_TRY(ov_record_put(context, part, parts->partition.part[part].count, fit, &bytes));
    if (fwrite(bytes.data, 1, bytes.count, c->file) != bytes.count || !write_through(c)) {
        status = fail_io(context, c->path, "written");
        cut_off(c);
    }
cleanup:
    ov_bytes_destroy(&bytes);
    return status;
}

void ov_checkpoint_close(ov_checkpoint *checkpoint) {
    if (checkpoint->file)
        fclose(checkpoint->file);
    checkpoint->file = NULL;
}
