#include "fit.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A file that one of several molecules would be written to. */
typedef struct output {
    char *path; /* owned */
    const char *input;
} output;

/* A file that a molecule is read from. */
typedef struct origin {
    dev_t device;
    ino_t node;
    const char *input;
} origin;

typedef struct names {
    output *outputs;
    size_t count;
    origin *origins;
    size_t origin_count;
} names;

static int by_path(const void *a, const void *b) {
    return strcmp(((const output *)a)->path, ((const output *)b)->path);
}

static int by_node(const void *a, const void *b) {
    const origin *const p = a, *const q = b;
    if (p->device != q->device)
        return p->device < q->device ? -1 : 1;
    return (p->node > q->node) - (p->node < q->node);
}

/* Takes over the path. */
static void add_output(names *n, char **path, const char *input) {
    if (*path)
        n->outputs[n->count++] = (output){*path, input};
    *path = NULL;
}

/* All that one molecule's job would write. */
static bool add_outputs(names *n, const fit_job *asked, const char *input, int32_t number) {
    fit_job one = *asked;
    one.input = input;
    one.number = number;
    const bool named = fit_outputs_name(&one);
    for (size_t i = 0; named && i < one.level_count; i++) {
        add_output(n, &one.levels[i].path, input);
        add_output(n, &one.levels[i].owners, input);
    }
    if (named)
        add_output(n, &one.own_trace, input);
    fit_outputs_destroy(&one);
    return named;
}

static bool collect(names *n, const fit_job *asked) {
    const size_t each = 2 * (size_t)asked->level_count + 1;
    n->outputs = calloc(asked->input_count * each, sizeof *n->outputs);
    n->origins = calloc(asked->input_count, sizeof *n->origins);
    if (!n->outputs || !n->origins) {
        cli_error("out of memory");
        return false;
    }
    for (size_t i = 0; i < asked->input_count; i++) {
        struct stat info;
        const char *const input = asked->inputs[i];
        if (stat(input, &info) == 0 && S_ISREG(info.st_mode))
            n->origins[n->origin_count++] = (origin){info.st_dev, info.st_ino, input};
        if (!add_outputs(n, asked, input, asked->numbers ? asked->numbers[i] : 0))
            return false;
    }
    qsort(n->outputs, n->count, sizeof *n->outputs, by_path);
    qsort(n->origins, n->origin_count, sizeof *n->origins, by_node);
    return true;
}

static bool check_twice(const names *n, const fit_job *asked) {
    for (size_t i = 1; i < n->count; i++) {
        const output *const a = &n->outputs[i - 1], *const b = &n->outputs[i];
        if (by_path(a, b) != 0)
            continue;
        if (asked->numbers)
            cli_error("two of the files that come of '%s' would be '%s'", a->input, a->path);
        else if (strcmp(a->input, b->input) == 0)
            cli_error("'%s' is named twice", a->input);
        else
            cli_error("'%s' and '%s' would both be written to '%s': fit them one at a time or into "
                      "different folders",
                      a->input, b->input, a->path);
        return false;
    }
    return true;
}

static bool check_origins(const names *n) {
    for (size_t i = 0; i < n->count; i++) {
        struct stat info;
        if (stat(n->outputs[i].path, &info) != 0)
            continue;
        const origin key = {info.st_dev, info.st_ino, NULL};
        const origin *const found = bsearch(&key, n->origins, n->origin_count, sizeof key, by_node);
        if (found) {
            cli_error("what comes of '%s' would be written over the molecule '%s'",
                      n->outputs[i].input, found->input);
            return false;
        }
    }
    return true;
}

static bool check_report(const names *n, const fit_job *asked) {
    for (size_t i = 0; asked->report && i < n->count; i++)
        if (cli_same_file(asked->report, n->outputs[i].path)) {
            cli_error("the report (--report) and what comes of '%s' are the same file '%s'",
                      n->outputs[i].input, n->outputs[i].path);
            return false;
        }
    for (size_t i = 0; asked->report && i < n->origin_count; i++)
        if (cli_same_file(asked->report, n->origins[i].input)) {
            cli_error("the report (--report) and a molecule are the same file '%s'",
                      n->origins[i].input);
            return false;
        }
    return true;
}

static bool check_ending(const char *option, const char *ending) {
    if (!ending || (!strchr(ending, '/') && strcmp(ending, "-") != 0 && ending[0]))
        return true;
    cli_error("with several molecules or --out-dir, %s takes the ending of names in the folder, "
              "such as %s for NAME.%s, and no '%s'",
              option, option[2] == 't' ? "trace.csv" : "owners.csv",
              option[2] == 't' ? "trace.csv" : "owners.csv", ending);
    return false;
}

static bool check_options(const fit_job *asked) {
    if (!asked->folder) /* the models of one file */
        return true;
    if (asked->output) {
        cli_error("-o names the file of one model: with several molecules or --out-dir, models "
                  "are called as their molecules, in the folder that --out-dir names");
        return false;
    }
    for (size_t i = 0; i < asked->input_count; i++)
        if (strcmp(asked->inputs[i], "-") == 0) {
            cli_error("standard input has no name, which several molecules or --out-dir need");
            return false;
        }
    return check_ending("--trace", asked->trace) && check_ending("--owners", asked->owners);
}

bool fit_batch_check(const fit_job *asked) {
    names n = {0};
    const bool good = check_options(asked) && collect(&n, asked) && check_twice(&n, asked) &&
                      check_origins(&n) && check_report(&n, asked);
    for (size_t i = 0; i < n.count; i++)
        free(n.outputs[i].path);
    free(n.outputs);
    free(n.origins);
    return good;
}
