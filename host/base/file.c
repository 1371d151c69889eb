#include "base/file.h"

#include "base/progress.h"
#include "base/temporary.h"

#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { LINK_CHAIN = 40, LINK_LENGTH = 4096, NAME_TRIES = 100 };

/* How a path is to be written. */
typedef struct ov_target {
    char *path;    /* where the bytes end up, links followed; owned */
    bool in_place; /* not a regular file: no temporary file, no rename */
    bool exists;   /* a regular file that will be replaced, with ... */
    struct stat old;
} ov_target;

static bool is_standard_output(const char *path) {
    return strcmp(path, "-") == 0;
}

static ovoid_status fail_write(ovoid_context *context, const char *path, int error) {
    if (is_standard_output(path))
        return ov_fail(context, OVOID_ERROR_IO, "cannot write standard output: %s",
                       strerror(error));
    return ov_fail(context, OVOID_ERROR_IO, "cannot write '%s': %s", path, strerror(error));
}

/* Length of the folder part of a path, with its final slash; 0 for a bare name. */
static size_t folder_length(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? (size_t)(slash - path) + 1 : 0;
}

/* first[0 .. length) followed by second, or NULL without memory. */
static char *join(ovoid_context *context, const char *first, size_t length, const char *second) {
    char *text = ov_alloc(context, length + strlen(second) + 1, 1, "a file name");
    if (!text)
        return NULL;
    memcpy(text, first, length);
    strcpy(text + length, second);
    return text;
}

/* Where writing to `path` ends when it is a link, or a chain of them whose end need not exist. */
static ovoid_status follow_links(ovoid_context *context, const char *path, char **end) {
    char link[LINK_LENGTH];
    char *current = join(context, path, strlen(path), "");
    for (int hops = 0; current; hops++) {
        ssize_t length = readlink(current, link, sizeof link - 1);
        if (length < 0) { /* not a link, or nothing there yet */
            *end = current;
            return OVOID_OK;
        }
        if (hops == LINK_CHAIN) {
            free(current);
            return fail_write(context, path, ELOOP);
        }
        link[length] = '\0';
        char *next = join(context, current, link[0] == '/' ? 0 : folder_length(current), link);
        free(current);
        current = next;
    }
    return OVOID_ERROR_MEMORY;
}

/* Names of descriptors that are open already: renaming a file over what stands behind them would
 * take it away from whoever else holds it. */
static bool names_descriptor(const char *path) {
    static const char *const names[] = {"/dev/stdout", "/dev/stderr", "/dev/fd/", "/proc/self/fd/"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strncmp(path, names[i], strlen(names[i])) == 0)
            return true;
    return false;
}

static ovoid_status target_find(ovoid_context *context, const char *path, ov_target *target) {
    *target = (ov_target){0};
    if (path[0] == '\0')
        return ov_fail(context, OVOID_ERROR_IO, "cannot write a file with an empty name");
    if (stat(path, &target->old) == 0) {
        if (S_ISDIR(target->old.st_mode))
            return fail_write(context, path, EISDIR);
        target->in_place = !S_ISREG(target->old.st_mode) || names_descriptor(path);
        target->exists = !target->in_place;
        /* A rename asks the folder alone; a file made read-only is to stay as it is. */
        if (access(path, W_OK) != 0)
            return fail_write(context, path, errno);
    } else if (errno != ENOENT) {
        return fail_write(context, path, errno);
    }
    if (target->in_place) {
        target->path = join(context, path, strlen(path), "");
        return target->path ? OVOID_OK : OVOID_ERROR_MEMORY;
    }
    return follow_links(context, path, &target->path);
}

/* Explains why no file can be made beside `path`. */
static ovoid_status fail_folder(ovoid_context *context, const char *path, const char *end,
                                int error) {
    size_t length = folder_length(end);
    if (length > 1)
        length--; /* "folder", but "/" */
    const char *folder = length ? end : ".";
    int shown = length ? (int)length : 1;
    if (error == ENOENT)
        return ov_fail(context, OVOID_ERROR_IO, "cannot write '%s': there is no folder '%.*s'",
                       path, shown, folder);
    return ov_fail(context, OVOID_ERROR_IO, "cannot write '%s': no new file in folder '%.*s': %s",
                   path, shown, folder, strerror(error));
}

/* Makes an empty file of a name that nobody has: `folder`, of this length, with what follows it.
 * Returns an error number, or 0. */
static int new_file(const char *folder, size_t length, int how, mode_t mode, int *descriptor,
                    char **name) {
    static atomic_uint counter;
    char last[64];
    for (int i = 0; i < NAME_TRIES; i++) {
        struct timespec now;
        clock_gettime(CLOCK_REALTIME, &now);
        snprintf(last, sizeof last, ".ovoid-%ld-%u-%lx.tmp", (long)getpid(),
                 atomic_fetch_add(&counter, 1), (unsigned long)now.tv_nsec);
        *name = join(NULL, folder, length, last);
        if (!*name)
            return ENOMEM;
        ov_temporary_begin(*name); /* before it is there */
        *descriptor = open(*name, how | O_CREAT | O_EXCL | O_CLOEXEC | O_NOCTTY, mode);
        if (*descriptor >= 0)
            return 0;
        int error = errno;
        ov_temporary_end(*name);
        *name = NULL;
        if (error != EEXIST)
            return error;
    }
    return EEXIST;
}

/* Makes one in the folder of target->path. */
static ovoid_status temporary_create(ovoid_context *context, const char *path,
                                     const ov_target *target, int *descriptor, char **name) {
    const int error =
        new_file(target->path, folder_length(target->path), O_WRONLY, 0666, descriptor, name);
    if (error == ENOMEM)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a file name");
    return error ? fail_folder(context, path, target->path, error) : OVOID_OK;
}

int ov_file_nameless(const char *folder, int *descriptor) {
    char *name = NULL, *const within = join(NULL, folder, strlen(folder), "/");
    const int error =
        within ? new_file(within, strlen(within), O_RDWR, 0600, descriptor, &name) : ENOMEM;
    if (!error)
        unlink(name);
    ov_temporary_end(name);
    free(within);
    return error;
}

/* Gives the new file the owner and permissions of the one it replaces, as far as we may. */
static void keep_permissions(int descriptor, const struct stat *old) {
    mode_t mode = old->st_mode & 0777;
    if (fchown(descriptor, old->st_uid, old->st_gid) != 0)
        mode &= 0707; /* the old group's rights are not for the new group */
    (void)fchmod(descriptor, mode);
}

ovoid_status ov_output_open(ovoid_context *context, const char *path, ov_output *output) {
    if (is_standard_output(path)) {
        *output = (ov_output){.stream = stdout};
        return OVOID_OK;
    }
    ovoid_status status = OVOID_OK;
    ov_target target;
    ov_output made = {0};
    int descriptor = -1;
    OV_TRY(target_find(context, path, &target));
    if (target.in_place) {
        descriptor = open(target.path, O_WRONLY | O_TRUNC | O_CLOEXEC | O_NOCTTY);
        if (descriptor < 0)
            OV_TRY(fail_write(context, path, errno));
    } else {
        OV_TRY(temporary_create(context, path, &target, &descriptor, &made.temporary));
        made.fresh = !target.exists;
        if (target.exists)
            keep_permissions(descriptor, &target.old);
    }
    made.stream = fdopen(descriptor, "w");
    if (!made.stream)
        OV_TRY(fail_write(context, path, errno));
    descriptor = -1;
    made.path = target.path;
    target.path = NULL;
    *output = made;

cleanup:
    if (descriptor >= 0)
        close(descriptor);
    if (status != OVOID_OK && made.temporary) {
        unlink(made.temporary);
        ov_temporary_end(made.temporary);
    }
    free(target.path);
    return status;
}

/* Puts the bytes on their medium; not every kind of file can be synced, nor need it be. */
static int flush_to_disk(FILE *stream) {
    if (fflush(stream) != 0)
        return errno;
    if (ferror(stream))
        return EIO; /* an earlier write failed, and its reason is gone */
    if (fsync(fileno(stream)) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS)
        return errno;
    return 0;
}

/* Makes the new name itself survive a power failure. The file is in place either way. */
static void sync_folder(const char *path) {
    size_t length = folder_length(path);
    char *folder = join(NULL, length ? path : "./", length ? length : 2, "");
    if (!folder)
        return;
    int descriptor = open(folder, O_RDONLY | O_CLOEXEC);
    if (descriptor >= 0) {
        (void)fsync(descriptor);
        close(descriptor);
    }
    free(folder);
}

ovoid_status ov_output_commit(ovoid_context *context, ov_output *output) {
    if (!output->path) {
        int error = fflush(output->stream) != 0 ? errno : ferror(output->stream) ? EIO : 0;
        *output = (ov_output){0};
        return error ? fail_write(context, "-", error) : OVOID_OK;
    }
    char *fresh = NULL;
    int error = flush_to_disk(output->stream);
    if (fclose(output->stream) != 0 && !error)
        error = errno;
    output->stream = NULL;
    if (!error && output->temporary && ov_progress_ask(context) != OVOID_OK) {
        ov_output_abandon(output);
        return OVOID_ERROR_CANCELLED;
    }
    if (output->temporary && output->fresh) {
        /* Ended by a handler between here and the return, the process leaves no file either:
         * syncing a folder can take its time. */
        fresh = join(NULL, output->path, strlen(output->path), "");
        ov_temporary_begin(fresh);
    }
    if (!error && output->temporary && rename(output->temporary, output->path) != 0)
        error = errno;
    ovoid_status status = OVOID_OK;
    if (error) {
        status = fail_write(context, output->path, error);
    } else if (output->temporary) {
        sync_folder(output->path);
        ov_temporary_end(output->temporary); /* it has its final name: nothing to remove */
        output->temporary = NULL;
    }
    ov_temporary_end(fresh);
    ov_output_abandon(output);
    return status;
}

void ov_output_abandon(ov_output *output) {
    if (output->temporary)
        unlink(output->temporary);
    if (output->stream && output->path)
        fclose(output->stream);
    ov_temporary_end(output->temporary);
    free(output->path);
    *output = (ov_output){0};
}

ovoid_status ov_output_check(ovoid_context *context, const char *path) {
    if (is_standard_output(path))
        return OVOID_OK;
    ov_target target;
    char *name = NULL;
    int descriptor = -1;
    ovoid_status status = target_find(context, path, &target);
    if (status == OVOID_OK && !target.in_place)
        status = temporary_create(context, path, &target, &descriptor, &name);
    if (name) {
        close(descriptor);
        unlink(name);
        ov_temporary_end(name);
    }
    free(target.path);
    return status;
}

/* ---- the same for users of the library ------------------------------------------------------ */

struct ovoid_file {
    ov_output output;
};

static ovoid_status fail_finished(ovoid_context *context, const char *function) {
    return ov_fail(context, OVOID_ERROR_ARGUMENT, "%s: the file is finished", function);
}

ovoid_status ovoid_file_check(ovoid_context *context, const char *path) {
    OV_NEED(context, context);
    OV_NEED(context, path);
    return ov_output_check(context, path);
}

ovoid_status ovoid_file_create(ovoid_context *context, const char *path, ovoid_file **file) {
    OV_NEED(context, context);
    OV_NEED(context, path);
    OV_NEED(context, file);
    ovoid_file *made = ov_alloc(context, 1, sizeof *made, "an output file");
    if (!made)
        return OVOID_ERROR_MEMORY;
    ovoid_status status = ov_output_open(context, path, &made->output);
    if (status == OVOID_OK)
        *file = made;
    else
        free(made);
    return status;
}

ovoid_status ovoid_file_write(ovoid_context *context, ovoid_file *file, const void *data,
                              size_t bytes) {
    OV_NEED(context, context);
    OV_NEED(context, file);
    if (bytes)
        OV_NEED(context, data);
    if (!file->output.stream)
        return fail_finished(context, __func__);
    if (fwrite(data, 1, bytes, file->output.stream) == bytes)
        return OVOID_OK;
    return fail_write(context, file->output.path ? file->output.path : "-", errno);
}

ovoid_status ovoid_file_commit(ovoid_context *context, ovoid_file *file) {
    OV_NEED(context, context);
    OV_NEED(context, file);
    if (!file->output.stream)
        return fail_finished(context, __func__);
    return ov_output_commit(context, &file->output);
}

/* The folder of a path, to be freed; NULL without memory. */
static char *folder_of(ovoid_context *context, const char *path) {
    const size_t length = folder_length(path);
    if (length == 0)
        return join(context, ".", 1, "");
    return join(context, path, length > 1 ? length - 1 : length, "");
}

/* Where temporary files belong that have no better place. */
static const char *temporary_folder(void) {
    const char *const named = getenv("TMPDIR");
    struct stat info;
    return named && stat(named, &info) == 0 && S_ISDIR(info.st_mode) ? named : "/tmp";
}

ovoid_status ovoid_file_folder(ovoid_context *context, const char *path, char **folder) {
    OV_NEED(context, context);
    OV_NEED(context, path);
    OV_NEED(context, folder);
    ov_target target = {.in_place = true};
    if (!is_standard_output(path)) {
        const ovoid_status status = target_find(context, path, &target);
        if (status != OVOID_OK)
            return status;
    }
    const char *const temporary = temporary_folder();
    char *const found = target.in_place ? join(context, temporary, strlen(temporary), "")
                                        : folder_of(context, target.path);
    free(target.path);
    if (!found)
        return OVOID_ERROR_MEMORY;
    *folder = found;
    return OVOID_OK;
}

void ovoid_file_destroy(ovoid_file **file) {
    if (!file || !*file)
        return;
    ov_output_abandon(&(*file)->output);
    free(*file);
    *file = NULL;
}
