/*
 * Assemblies: what a file says of them, and the placements of the unit that make one up.
 */
#ifndef OV_MOLECULE_ASSEMBLY_H
#define OV_MOLECULE_ASSEMBLY_H

#include "molecule/molecule.h"
#include "molecule/text.h"

/* x' = rotation x + translation, by name. */
typedef struct ov_operator {
    char id[16];
    double rotation[9], translation[3];
} ov_operator;

/* What an assembly does with some of the chains; it may have several of these. */
typedef struct ov_generator {
    char assembly[16];
    char *chains; /* names with commas or blanks between them, owned; NULL: all */
    size_t chains_length, chains_room;
    char *expression; /* of operators' names, owned; NULL: the operators from `first` on */
    size_t first, operators;
} ov_generator;

/* All that a file says. */
typedef struct ov_assembly_source {
    ov_operator *operators;
    size_t operator_count, operator_room;
    bool sorted; /* operators are in the order of their names */
    ov_generator *generators;
    size_t generator_count, generator_room;
    size_t text_bytes; /* of chains and expressions of all generators */
    char current[16];  /* REMARK 350: the assembly that is being described */
    int rows;          /* REMARK 350: of the last operator that are there, 0 to 3 */
} ov_assembly_source;

void ov_assembly_source_destroy(ov_assembly_source *source);

/* Takes a line "REMARK 350" of a PDB or PQR file; others pass without effect. */
ovoid_status ov_assembly_remark(ovoid_context *context, ov_assembly_source *source, ov_text *text,
                                const ov_line *line);

/* OVOID_ERROR_LIMIT, at `line` of the text, where there are more than any file has. */
ovoid_status ov_assembly_add_operator(ovoid_context *context, ov_assembly_source *source,
                                      const ov_text *text, const ov_line *line,
                                      const ov_operator *added);

/* The same. chains and expression are copied. */
ovoid_status ov_assembly_add_generator(ovoid_context *context, ov_assembly_source *source,
                                       const ov_text *text, const ov_line *line,
                                       const char *assembly, const char *chains,
                                       const char *expression);

struct ov_reader;

/* Lists the assemblies in the molecule, and, where options name one, makes the molecule that. */
ovoid_status ov_assembly_finish(struct ov_reader *reader);

/* The atoms of one placement, where it takes them: four values for each. */
void ov_placement_atoms(const ovoid_molecule *molecule, const ovoid_placement *placement,
                        double *xyzr);

/* Makes the array of all atoms of an assembly, unless it is there. */
ovoid_status ov_molecule_expand(ovoid_context *context, const ovoid_molecule *molecule);

#endif
