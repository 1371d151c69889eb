#include "fit.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* "model.ovoid" as "modelTEXT.ovoid"; NULL without memory. */
static char *insert(const char *path, const char *text) {
    const char *slash = strrchr(path, '/');
    const char *base = slash ? slash + 1 : path;
    const char *dot = strrchr(base, '.');
    if (!dot || dot == base) /* a dot in front makes no extension */
        dot = base + strlen(base);
    const size_t size = strlen(path) + strlen(text) + 1;
    char *name = malloc(size);
    if (name)
        snprintf(name, size, "%.*s%s%s", (int)(dot - path), path, text, dot);
    return name;
}

enum { INSERTED = 32 };

static char *level_path(const char *path, size_t level) {
    char text[INSERTED] = "";
    if (level > 0)
        snprintf(text, sizeof text, ".level%zu", level + 1);
    return insert(path, text);
}

static bool out_of_memory(void) {
    cli_error("out of memory");
    return false;
}

/* Whether an option that writes several of `what` has room for them beside the file at `path`,
 * which `named` names. */
static bool takes_several(const char *option, const char *path, const char *what,
                          const char *named) {
    struct stat info;
    if (strcmp(path, "-") == 0) {
        cli_error("%s writes several %s, which standard output cannot take: name the first one's "
                  "file with %s",
                  option, what, named);
        return false;
    }
    /* A folder is refused as for one model. */
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode)) {
        cli_error("%s writes several %s, but '%s' is no regular file", option, what, path);
        return false;
    }
    return true;
}

static bool all_take_several(const char *option, const char *output, const char *owners) {
    return (!output || takes_several(option, output, "models", "-o")) &&
           (!owners || takes_several(option, owners, "tables of owners", "--owners"));
}

bool fit_outputs_take_models(const fit_job *job) {
    return all_take_several("--models", job->output, job->owners) &&
           (!job->trace || takes_several("--models", job->trace, "traces", "--trace"));
}

static bool name_levels(fit_job *job) {
    if (job->level_count > 1 && !all_take_several("--levels", job->output, job->owners))
        return false;
    for (size_t i = 0; i < job->level_count; i++) {
        fit_level *level = &job->levels[i];
        level->path = level_path(job->output, i);
        level->owners = job->owners ? level_path(job->owners, i) : NULL;
        if (!level->path || (job->owners && !level->owners))
            return out_of_memory();
    }
    return true;
}

/* The path with the model's number in it. */
static bool number_path(const char **path, char **own, int32_t number) {
    char text[INSERTED];
    if (!*path)
        return true;
    snprintf(text, sizeof text, ".model%d", (int)number);
    char *const made = insert(*path, text);
    free(*own);
    *path = *own = made;
    return made || out_of_memory();
}

static bool name_here(fit_job *job) {
    if (!job->output && strcmp(job->input, "-") == 0) {
        cli_error("a molecule from standard input has no name: name the model's file with -o");
        return false;
    }
    if (!job->output)
        job->output = job->own_output = source_output(job->input, ".ovoid");
    if (!job->output)
        return out_of_memory();
    return !job->number || (number_path(&job->output, &job->own_output, job->number) &&
                            number_path(&job->trace, &job->own_trace, job->number) &&
                            number_path(&job->owners, &job->own_owners, job->number));
}

/* "FOLDER/NAME.ENDING"; NULL without memory. */
static char *path_in(const char *folder, const char *name, const char *ending) {
    const size_t size = strlen(folder) + strlen(name) + strlen(ending) + 3;
    const char *between = folder[0] && folder[strlen(folder) - 1] == '/' ? "" : "/";
    char *path = malloc(size);
    if (path)
        snprintf(path, size, "%s%s%s.%s", folder, between, name, ending);
    return path;
}

static bool name_in_folder(fit_job *job) {
    char text[INSERTED] = "";
    if (job->number)
        snprintf(text, sizeof text, ".model%d", (int)job->number);
    char *name = source_output(job->input, text);
    if (!name)
        return out_of_memory();
    const bool owners = job->owners != NULL, trace = job->trace != NULL;
    job->output = job->own_output = path_in(job->folder, name, "ovoid");
    if (trace)
        job->trace = job->own_trace = path_in(job->folder, name, job->trace);
    if (owners)
        job->owners = job->own_owners = path_in(job->folder, name, job->owners);
    free(name);
    return (job->output && (!owners || job->owners) && (!trace || job->trace)) || out_of_memory();
}

bool fit_outputs_name(fit_job *job) {
    return (job->folder ? name_in_folder(job) : name_here(job)) && name_levels(job);
}

char *fit_outputs_pattern(const fit_job *job) {
    char *const name = source_output(job->input, job->folder ? ".modelN" : ".ovoid");
    char *const pattern = !name         ? NULL
                          : job->folder ? path_in(job->folder, name, "ovoid")
                                        : insert(job->output ? job->output : name, ".modelN");
    free(name);
    return pattern;
}

void fit_outputs_destroy(fit_job *job) {
    for (size_t i = 0; i < FIT_LEVELS_MAX; i++) {
        free(job->levels[i].path);
        free(job->levels[i].owners);
        job->levels[i].path = job->levels[i].owners = NULL;
    }
    free(job->own_output);
    free(job->own_trace);
    free(job->own_owners);
    job->own_output = job->own_trace = job->own_owners = NULL;
}

typedef struct named_file {
    const char *what, *path; /* path NULL: none */
} named_file;

static bool check_pair(named_file a, named_file b) {
    if (!a.path || !b.path || !cli_same_file(a.path, b.path))
        return true;
    if (strcmp(a.path, "-") == 0)
        cli_error("%s and %s cannot both go to standard output", a.what, b.what);
    else
        cli_error("%s and %s are the same file '%s'", a.what, b.what, b.path);
    return false;
}

/* What goes where must be told apart before anything is written. */
bool fit_outputs_check(const fit_job *job) {
    enum { LEVELS_AT = 5, MOST = LEVELS_AT + 2 * FIT_LEVELS_MAX };
    char what[2 * FIT_LEVELS_MAX][40];
    named_file files[MOST] = {{"the molecule", strcmp(job->input, "-") == 0 ? NULL : job->input},
                              {"the model (-o)", job->output},
                              {"the report (--report)", job->report},
                              {"the trace (--trace)", job->trace},
                              {"the owners (--owners)", job->owners}};
    size_t count = LEVELS_AT;
    for (size_t level = 1; level < job->level_count; level++) {
        char *const model = what[2 * level], *const owners = what[2 * level + 1];
        snprintf(model, sizeof *what, "the model of level %zu", level + 1);
        snprintf(owners, sizeof *what, "the owners of level %zu", level + 1);
        files[count++] = (named_file){model, job->levels[level].path};
        files[count++] = (named_file){owners, job->levels[level].owners};
    }
    for (size_t i = 0; i < count; i++)
        for (size_t j = i + 1; j < count; j++)
            if (!check_pair(files[i], files[j]))
                return false;
    return true;
}
