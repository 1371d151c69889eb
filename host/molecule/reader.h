/*
 * The readers of molecule files: one function per format that is given line after line, and one
 * that is called at the end.
 */
#ifndef OV_MOLECULE_READER_H
#define OV_MOLECULE_READER_H

#include "molecule/assembly.h"
#include "molecule/fields.h"
#include "molecule/molecule.h"
#include "molecule/sites.h"
#include "molecule/text.h"

/* Whether the atoms seen so far might be those of a PDB file under another name (pqr.c). */
typedef struct ov_pdb_suspicion {
    bool cleared;     /* some atom cannot have come from a PDB file */
    bool header;      /* records that PDB files have and PQR files hardly ever */
    uint64_t atoms;   /* seen */
    uint64_t ones;    /* atoms whose occupancy would be 1.00 */
    uint64_t element; /* atoms with an element in the PDB columns */
    double largest;   /* temperature factor */
} ov_pdb_suspicion;

typedef struct ov_reader {
    ovoid_context *context;
    ov_text *text;
    ovoid_molecule *molecule;
    size_t capacity; /* atoms that molecule->xyzr has room for */
    bool guess;      /* the caller left the format open */
    const ovoid_read_options *options;
    ov_sites sites; /* who the atoms are, and which of them stay */

    uint64_t unknown_lines; /* lines ignored for not being any known record */
    uint64_t unknown_first; /* number of the first of them */
    ov_quote unknown_text;

    /* PQR */
    ov_pdb_suspicion pdb;

    /* PDB */
    uint64_t pqr_like; /* atoms whose occupancy is none: charges of a PQR file? */

    /* XYZR */
    bool announced; /* the file began with a count line */
    uint64_t announced_line;
    double announced_atoms;

    ov_assembly_source assemblies;

    struct ov_cif *cif; /* cif.c */
} ov_reader;

/* What is wrong with value i of x, y, z, radius, as "beyond 1e6 angstrom"; NULL if nothing is. */
const char *ov_reader_fault(size_t i, double value);

/* Appends an atom after checking that x, y, z and radius are finite and within the limits. A radius
 * of NULL is one that comes later. */
ovoid_status ov_reader_add(ov_reader *reader, const ov_line *line, const ov_field *x,
                           const ov_field *y, const ov_field *z, const ov_field *radius);

/* The same with its identity, unless the choices of the caller leave it out: then it is counted. */
ovoid_status ov_reader_add_site(ov_reader *reader, const ov_line *line, const ov_field *x,
                                const ov_field *y, const ov_field *z, const ov_field *radius,
                                const ov_site *site);

/* Counts a line that is left out without being understood. */
void ov_reader_ignore(ov_reader *reader, const ov_line *line);

/* Whether the line is an atom or another record that a PQR file may have. */
bool ov_pqr_knows(const char *text, size_t length);
ovoid_status ov_pqr_line(ov_reader *reader, const ov_line *line);
ovoid_status ov_pqr_end(ov_reader *reader);

/* Whether the atoms read as PQR so far are those of a PDB file. */
bool ov_pqr_is_pdb(const ov_reader *reader);

ovoid_status ov_xyzr_line(ov_reader *reader, const ov_line *line);
ovoid_status ov_xyzr_end(ov_reader *reader);

/* Whether the line is an atom in the columns of a PDB file. */
bool ov_pdb_knows(const ov_line *line);

/* Whether it is an atom, but its record is not in the columns of a PDB file. */
bool ov_pdb_misses(const ov_line *line);
ovoid_status ov_pdb_line(ov_reader *reader, const ov_line *line);
ovoid_status ov_pdb_end(ov_reader *reader);

/* MODEL and ENDMDL records, of PDB and PQR files alike. */
void ov_pdb_follow_models(ov_reader *reader, const char *text, size_t length);

ovoid_status ov_cif_line(ov_reader *reader, const ov_line *line);
ovoid_status ov_cif_end(ov_reader *reader);
void ov_cif_destroy(struct ov_cif **cif);

#endif
