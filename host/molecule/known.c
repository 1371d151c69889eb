/*
 * Molecules from memory whose atoms are known by name, so that they get radii as those of a
 * structure's file do.
 */
#include "molecule/radii.h"

#include <stdlib.h>
#include <string.h>

/* Texts as readers make them: ended, filled up with zeros, and without control characters. */
static void clean(char *field, size_t size) {
    char copy[16] = {0};
    memcpy(copy, field, size);
    ov_site_text(field, size, copy, strnlen(copy, size));
}

static void clean_atom(ovoid_atom *atom) {
    clean(atom->name, sizeof atom->name);
    clean(atom->element, sizeof atom->element);
    atom->altloc = ov_site_letter(atom->altloc);
    atom->flags &= OVOID_ATOM_HETERO | OVOID_ATOM_ZERO_OCCUPANCY;
}

static void clean_residue(ovoid_residue *residue) {
    clean(residue->name, sizeof residue->name);
    clean(residue->chain, sizeof residue->chain);
    residue->insertion = ov_site_letter(residue->insertion);
    memset(residue->reserved, 0, sizeof residue->reserved);
}

/* Where each residue begins: their atoms follow one another. */
static ovoid_status find_firsts(ovoid_context *context, ovoid_molecule *m) {
    uint32_t next = 0;
    for (size_t i = 0; i < m->atoms; i++) {
        const uint32_t residue = m->identity[i].residue;
        if (residue == next && next < m->residue_count)
            m->residues[next++].first = (uint32_t)i;
        else if (next == 0 || residue != next - 1)
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "ovoid_molecule_create_known: atom %zu (from 0) is of residue %u, where "
                           "one of %zu residues was to follow residue %ld or go on",
                           i, (unsigned)residue, m->residue_count, (long)next - 1);
    }
    if (next < m->residue_count)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "ovoid_molecule_create_known: residue %u (from 0) has no atom",
                       (unsigned)next);
    return OVOID_OK;
}

static ovoid_status copy_identity(ovoid_context *context, const ovoid_atom *identity,
                                  const ovoid_residue *residues, size_t count, ovoid_molecule *m) {
    m->identity = ov_alloc(context, m->atoms, sizeof *identity, "atoms");
    m->residues = ov_alloc(context, count, sizeof *residues, "residues");
    if (!m->identity || !m->residues)
        return OVOID_ERROR_MEMORY;
    memcpy(m->identity, identity, m->atoms * sizeof *identity);
    memcpy(m->residues, residues, count * sizeof *residues);
    m->residue_count = count;
    for (size_t i = 0; i < m->atoms; i++)
        clean_atom(&m->identity[i]);
    for (size_t i = 0; i < count; i++)
        clean_residue(&m->residues[i]);
    return find_firsts(context, m);
}

static ovoid_status assign_radii(ovoid_context *context, ovoid_radii radii, const char *file,
                                 ovoid_molecule *m) {
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.radii = radii;
    options.radii_file = file;
    ov_reader reader = {.context = context, .molecule = m, .options = &options};
    ov_sites_init(&reader.sites);
    ov_residue_extra *const extra = ov_alloc(context, m->residue_count, sizeof *extra, "residues");
    if (!extra)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < m->residue_count; i++) /* a chain is one molecule, as in PDB files */
        memcpy(extra[i].part, m->residues[i].chain, sizeof extra[i].part);
    reader.sites.residue_extra = extra;
    const ovoid_status status = ov_radii_assign(&reader);
    ov_sites_destroy(&reader.sites);
    return status;
}

ovoid_status ovoid_molecule_create_known(ovoid_context *context, const double *xyzr,
                                         const ovoid_atom *identity, size_t atoms,
                                         const ovoid_residue *residues, size_t residue_count,
                                         ovoid_radii radii, const char *radii_file,
                                         ovoid_molecule **molecule) {
    ovoid_status status = OVOID_OK;
    ovoid_molecule *made = NULL;
    OV_NEED(context, context);
    OV_NEED(context, xyzr);
    OV_NEED(context, identity);
    OV_NEED(context, residues);
    OV_NEED(context, molecule);
    if ((int)radii < OVOID_RADII_DEFAULT || radii > OVOID_RADII_FILE)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "ovoid_molecule_create_known: %d names no radii", (int)radii);
    if ((radii == OVOID_RADII_FILE) != (radii_file != NULL))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "ovoid_molecule_create_known: radii of a file need radii and radii_file");
    if (atoms > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "ovoid_molecule_create_known: more than %u atoms", UINT32_MAX);
    OV_TRY(ovoid_molecule_create(context, xyzr, atoms, &made));
    OV_TRY(copy_identity(context, identity, residues, residue_count, made));
    ov_sites_count(made);
    if (radii != OVOID_RADII_OWN)
        OV_TRY(assign_radii(context, radii, radii_file, made));
    ov_molecule_count_zero_radii(made);
    *molecule = made;
    made = NULL;
cleanup:
    ovoid_molecule_destroy(&made);
    return status;
}
