/*
 * How molecules are read: the options that all commands share, and what a molecule turned out to be
 * as text and as JSON.
 */
#ifndef CLI_READING_H
#define CLI_READING_H

#include "cli.h"

/* The format of a file that holds a molecule or a model, as --format names it. */
typedef enum source_format {
    SOURCE_AUTO = 0,
    SOURCE_PQR,
    SOURCE_XYZR,
    SOURCE_PDB,
    SOURCE_MMCIF,
    SOURCE_MODEL
} source_format;

typedef struct reading {
    ovoid_read_options options;
    source_format format;
    bool models;       /* the command reads models too */
    const char *given; /* an option that models know nothing of, NULL for none */
} reading;

/* Values of the long options, beyond those of any command. */
enum {
    READING_FIRST = 4096,
    READING_FORMAT = READING_FIRST,
    READING_RADII,
    READING_SELECT,
    READING_MODEL,
    READING_ASSEMBLY,
    READING_WATERS,
    READING_NO_HYDROGENS,
    READING_END
};

/* Entries of a command's table of long options. */
#define READING_OPTIONS                                                                            \
    {"format", required_argument, NULL, READING_FORMAT},                                           \
        {"radii", required_argument, NULL, READING_RADII},                                         \
        {"select", required_argument, NULL, READING_SELECT},                                       \
        {"model", required_argument, NULL, READING_MODEL},                                         \
        {"assembly", required_argument, NULL, READING_ASSEMBLY},                                   \
        {"waters", no_argument, NULL, READING_WATERS}, {                                           \
        "no-hydrogens", no_argument, NULL, READING_NO_HYDROGENS                                    \
    }

static inline bool reading_has(int option) {
    return option >= READING_FIRST && option < READING_END;
}

/* models: the command reads models as well, by --format ovoid. */
void reading_init(reading *r, bool models);

/* Takes one of the options above; reports a usage error and returns false if its value is wrong. */
bool reading_parse(reading *r, int option, const char *value);

/* The part of a help about them, with a heading. */
void reading_help(FILE *stream, bool models);

/* Whether --assembly list asks for no work but a list; and that list, on standard output. Returns
 * the exit code. */
bool reading_lists(const reading *r);
int reading_list(const reading *r, ovoid_context *context, const char *path);

/* Whether a file is to be read as a model: by --format, else as cli_is_model() has it. */
bool reading_is_model(const reading *r, const char *path);

ovoid_status reading_molecule(const reading *r, ovoid_context *context, const char *path,
                              ovoid_molecule **molecule);

/* Says so and returns false where options for molecules were given, and `path` is a model. */
bool reading_check_model(const reading *r, const char *path);

/* The lines "molecule" and, where there is something to say, "radii" of a summary. */
void reading_print(const reading *r, FILE *out, const char *path, const ovoid_molecule *molecule);

/* Adds what was read to a report. False: out of memory. */
bool reading_report(const reading *r, cJSON *object, const ovoid_molecule *molecule);

#endif
