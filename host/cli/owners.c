#include "fit.h"

#include <string.h>

enum { ROW_BYTES = 384, CELL_BYTES = 32 };

static const char header[] =
    "atom,x,y,z,ellipsoid,serial,name,element,residue,number,insertion,chain,placement\n";

/* Text as a cell of a CSV file: in quotes where it holds what would end the cell. */
static const char *cell(const char *text, char made[CELL_BYTES]) {
    size_t used = 0;
    if (!strpbrk(text, ",\"\n"))
        return text;
    made[used++] = '"';
    for (; *text && used + 3 < CELL_BYTES; text++) {
        if (*text == '"')
            made[used++] = '"';
        made[used++] = *text;
    }
    made[used++] = '"';
    made[used] = '\0';
    return made;
}

static int print_number(char *text, size_t size, long number, bool known) {
    return known ? snprintf(text, size, "%ld,", number) : snprintf(text, size, ",");
}

/* What the molecule's file calls the atom; empty cells where it says nothing. */
static int print_identity(const ovoid_molecule *molecule, size_t atom, char *row, size_t size) {
    char name[CELL_BYTES], residue_name[CELL_BYTES], chain[CELL_BYTES];
    size_t count, placement;
    const ovoid_atom *const atoms = ovoid_molecule_identity(molecule);
    const size_t origin = ovoid_molecule_origin(molecule, atom, &placement);
    int used;
    if (!atoms)
        return snprintf(row, size, ",,,,,,,\n");
    const ovoid_atom *const a = atoms + origin;
    const ovoid_residue *const r = ovoid_molecule_residues(molecule, &count) + a->residue;
    const char insertion[2] = {r->insertion};
    ovoid_molecule_placements(molecule, &count);
    used = print_number(row, size, a->serial, a->serial != 0);
    used += snprintf(row + used, size - (size_t)used, "%s,%s,%s,", cell(a->name, name), a->element,
                     cell(r->name, residue_name));
    used += print_number(row + used, size - (size_t)used, r->number, r->number != OVOID_NO_NUMBER);
    used += snprintf(row + used, size - (size_t)used, "%s,%s,", insertion, cell(r->chain, chain));
    return used + (count ? snprintf(row + used, size - (size_t)used, "%zu\n", placement + 1)
                         : snprintf(row + used, size - (size_t)used, "\n"));
}

/* Both are counted from 1: the atoms of the molecule, and the lines of the model's file that hold
 * an ellipsoid. */
static ovoid_status write_row(const fit_job *job, ovoid_file *file, size_t atom,
                              const double xyz[3], uint32_t ellipsoid) {
    char row[ROW_BYTES];
    int length = snprintf(row, sizeof row, "%zu,%.10g,%.10g,%.10g,%lu,", atom + 1, xyz[0], xyz[1],
                          xyz[2], (unsigned long)ellipsoid + 1);
    length += print_identity(job->molecule, atom, row + length, sizeof row - (size_t)length);
    return ovoid_file_write(job->context, file, row, (size_t)length);
}

ovoid_status fit_owners_write(const fit_job *job, const fit_level *level) {
    const uint32_t *const owner = ovoid_model_owner(level->model);
    const size_t atoms = ovoid_model_owner_count(level->model);
    const double *const xyzr = ovoid_molecule_xyzr(job->molecule);
    ovoid_file *file = NULL;
    ovoid_status status = ovoid_file_create(job->context, level->owners, &file);
    if (status == OVOID_OK)
        status = ovoid_file_write(job->context, file, header, strlen(header));
    for (size_t i = 0; i < atoms && status == OVOID_OK; i++)
        status = write_row(job, file, i, xyzr + 4 * i, owner[i]);
    if (status == OVOID_OK)
        status = ovoid_file_commit(job->context, file);
    ovoid_file_destroy(&file);
    return status;
}
