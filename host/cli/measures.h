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

/* One of the two, and its field. */
typedef struct source {
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_field *field;
} source;

/* Reads a molecule or a model. The source starts as {0}. */
ovoid_status source_read(ovoid_context *context, const char *path, const reading *how,
                         source *read);

/* Makes its field; decay and isovalue are for a molecule. */
ovoid_status source_field(ovoid_context *context, source *read, double decay, double isovalue);
void source_destroy(source *read);

/* The name of `input` without folder, .gz and extension, with another extension; to be freed. NULL
 * without memory. */
char *source_output(const char *input, const char *extension);

/* "standard input" for "-". */
const char *source_name(const char *path);

/* ", 60 placements of 1471" after the number of a model's ellipsoids; nothing of a model without.
 */
void source_print_placements(const ovoid_model *model, FILE *out);
/* "model     FILE: 215 ellipsoids", without the line's end. */
void source_print_model(const ovoid_model *model, const char *path, FILE *out);

/* ---- options (measures.c) ------------------------------------------------------------------- */

bool measures_parse_vertices(const char *text, ovoid_vertex_rule *vertices);
const char *measures_vertices_name(ovoid_vertex_rule vertices);

/* ---- work (measures.c) ---------------------------------------------------------------------- */

/* The field of the molecule with the model's decay and isovalue, and the model's. */
ovoid_status measures_fields(ovoid_context *context, const ovoid_molecule *molecule,
                             const ovoid_model *model, ovoid_field **original,
                             ovoid_field **sparse);

/* Compares the two once. */
ovoid_status measures_compare(ovoid_context *context, const ovoid_molecule *molecule,
                              const ovoid_model *model, const ovoid_measure_options *options,
                              ovoid_measures *measures);

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
