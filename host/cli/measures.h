/*
 * What the subcommands about surfaces share: inputs, options about surfaces, and measures
 * as text and as JSON.
 */
#ifndef CLI_MEASURES_H
#define CLI_MEASURES_H

#include "cli.h"
#include "reading.h"

#include "ovoid/ovoid.h"

/* ---- inputs (source.c) ---------------------------------------------------------------------- */

/* One of the two. */
typedef struct source {
    ovoid_molecule *molecule;
    ovoid_model *model;
} source;

/* Reads a molecule or a model. The source starts as {0}. */
ovoid_status source_read(ovoid_context *context, const char *path, const reading *how,
                         source *read);
void source_destroy(source *read);

/* The name of `input` without folder, .gz and extension, with another extension; to be freed. NULL
 * without memory. */
char *source_output(const char *input, const char *extension);

/* "standard input" for "-". */
const char *source_name(const char *path);

/* ---- options (measures.c) ------------------------------------------------------------------- */

bool measures_parse_vertices(const char *text, ovoid_vertex_rule *vertices);
const char *measures_vertices_name(ovoid_vertex_rule vertices);

/* ---- results (measures.c) ------------------------------------------------------------------- */

/* Lines of a summary, after their names. */
void measures_print(FILE *stream, const ovoid_measures *measures,
                    const ovoid_measure_options *options);

/* A table of several, with a heading. */
void measures_print_heading(FILE *stream);
void measures_print_row(FILE *stream, double isovalue, const ovoid_measures *measures);

/* Adds what was measured to a report. False: out of memory. */
bool measures_report(cJSON *object, const ovoid_measures *measures,
                     const ovoid_measure_options *options);

#endif
