/* IHMCIF, the format of integrative models in the PDB (its dictionary mmcif_ihm.dic): the category
 * ihm_gaussian_obj_site has a mean, a weight and a covariance for each Gaussian, and says which
 * residues of which chain it stands for.
 *
 * Chains are those of the molecule's file, in their order, each an entity of its own, whose
 * residues are numbered from 1; pdbx_poly_seq_scheme has the numbers of the file. An ellipsoid of
 * several chains is given to the one of most of its atoms, with the range of its residues there.
 * Where nobody knows of residues, the ellipsoids stand in one chain, an unknown residue each.
 * The weight is the Gaussian's integral: the field is the sum of weight times normal density. */
#include "write/ihm.h"

#include "base/progress.h"
#include "write/export.h"

#include <stdlib.h>
#include <string.h>

/* A chain of the file, or a copy of it in an assembly. */
typedef struct chain {
    char name[12];
    uint32_t residues; /* so many */
} chain;

typedef struct sequence {
    chain *chains;
    size_t count, capacity;
    uint32_t *chain_of, *number_of; /* per residue of the unit: its chain, its number there */
} sequence;

static void drop_sequence(sequence *s) {
    free(s->chains);
    free(s->chain_of);
    free(s->number_of);
}

/* ---- residues ------------------------------------------------------------------------------- */

static ovoid_status find_chain(ovoid_context *context, sequence *s, const char *name,
                               size_t *index) {
    for (*index = s->count; (*index)-- > 0;) /* most often the last one */
        if (strcmp(s->chains[*index].name, name) == 0)
            return OVOID_OK;
    const ovoid_status status =
        ov_grow(context, &s->chains, &s->capacity, s->count + 1, sizeof *s->chains, "chains");
    if (status != OVOID_OK)
        return status;
    *index = s->count++;
    s->chains[*index] = (chain){.residues = 0};
    memcpy(s->chains[*index].name, name, strlen(name) + 1);
    return OVOID_OK;
}

static ovoid_status number_residues(ovoid_context *context, const ovoid_molecule *molecule,
                                    sequence *s) {
    ovoid_status status = OVOID_OK;
    size_t count;
    const ovoid_residue *const residues = ovoid_molecule_residues(molecule, &count);
    s->chain_of = ov_alloc(context, count, sizeof *s->chain_of, "chains of residues");
    s->number_of = ov_alloc(context, count, sizeof *s->number_of, "numbers of residues");
    if (!s->chain_of || !s->number_of)
        OV_TRY(OVOID_ERROR_MEMORY);
    for (size_t i = 0; i < count; i++) {
        size_t at;
        OV_TRY(find_chain(context, s, residues[i].chain, &at));
        s->chain_of[i] = (uint32_t)at;
        s->number_of[i] = ++s->chains[at].residues;
    }
cleanup:
    return status;
}

/* What an ellipsoid stands for. */
typedef struct range {
    size_t chain;
    uint32_t begin, end;
} range;

static uint32_t residue_of(const ovoid_molecule *molecule, size_t atom) {
    size_t placement;
    return ovoid_molecule_identity(molecule)[ovoid_molecule_origin(molecule, atom, &placement)]
        .residue;
}

/* The chain of most of the atoms: the candidate that survives when atoms of different chains
 * cancel each other, or the last one where none has more than half. */
static range range_of(const ovoid_molecule *molecule, const sequence *s, const uint32_t *atoms,
                      size_t count) {
    range r = {0, 0, 0};
    size_t votes = 0;
    for (size_t i = 0; i < count; i++) {
        const size_t at = s->chain_of[residue_of(molecule, atoms[i])];
        if (votes == 0)
            r.chain = at;
        votes = at == r.chain ? votes + 1 : votes - 1;
    }
    for (size_t i = 0; i < count; i++) {
        const uint32_t residue = residue_of(molecule, atoms[i]);
        if (s->chain_of[residue] != r.chain)
            continue;
        const uint32_t number = s->number_of[residue];
        r.begin = r.begin == 0 || number < r.begin ? number : r.begin;
        r.end = number > r.end ? number : r.end;
    }
    return r;
}

/* ---- text ---------------------------------------------------------------------------------- */

/* A value of CIF, in quotes where it has to be. */
static void put_value(const char *text, FILE *stream) {
    const char quote = strchr(text, '\'') ? '"' : '\'';
    if (!text[0])
        putc('.', stream);
    else if (strpbrk(text, " \t'\"#;_$[]") || strcmp(text, ".") == 0 || strcmp(text, "?") == 0)
        fprintf(stream, "%c%s%c", quote, text, quote);
    else
        fputs(text, stream);
}

/* A title on lines of its own, which may hold anything but a line that begins with ';'. */
static void put_text(const char *text, FILE *stream) {
    fputs("\n;", stream);
    for (; *text; text++)
        putc((unsigned char)*text < 0x20 ? ' ' : *text, stream);
    fputs("\n;\n", stream);
}

static void put_loop(const char *category, const char *const *items, FILE *stream) {
    fputs("#\nloop_\n", stream);
    for (; *items; items++)
        fprintf(stream, "_%s.%s\n", category, *items);
}
#define LOOP(category, ...) put_loop(category, (const char *const[]){__VA_ARGS__, NULL}, stream)

/* The identifier of a chain: what the file calls it, or where it has no name its number. */
static void put_chain(const sequence *s, size_t at, FILE *stream) {
    if (s->chains[at].name[0])
        put_value(s->chains[at].name, stream);
    else
        fprintf(stream, "%zu", at + 1);
}

static void put_head(const sequence *s, const char *title, FILE *stream) {
    fputs("data_ovoid\n_entry.id ovoid\n_struct.entry_id ovoid\n_struct.title ", stream);
    put_text(title, stream);
    fprintf(stream,
            "#\nloop_\n_software.pdbx_ordinal\n_software.name\n_software.classification\n"
            "_software.version\n_software.type\n_software.location\n1 Ovoid "
            "'model building' %s program .\n",
            ovoid_version());
    LOOP("entity", "id", "type", "src_method", "pdbx_description", "formula_weight",
         "pdbx_number_of_molecules", "details");
    for (size_t i = 0; i < s->count; i++)
        fprintf(stream, "%zu polymer man 'chain %zu' . 1 .\n", i + 1, i + 1);
    LOOP("struct_asym", "id", "entity_id", "details");
    for (size_t i = 0; i < s->count; i++) {
        put_chain(s, i, stream);
        fprintf(stream, " %zu .\n", i + 1);
    }
}

/* Each residue of the molecule, or an unknown one for each ellipsoid. */
static void put_residues(const ovoid_molecule *molecule, const sequence *s, size_t ellipsoids,
                         FILE *stream) {
    size_t count = ellipsoids;
    const ovoid_residue *const residues =
        s->chain_of ? ovoid_molecule_residues(molecule, &count) : NULL;
    LOOP("entity_poly_seq", "entity_id", "num", "mon_id", "hetero");
    for (size_t i = 0; i < count && !ferror(stream); i++) {
        fprintf(stream, "%lu %lu ", residues ? (unsigned long)s->chain_of[i] + 1 : 1ul,
                residues ? (unsigned long)s->number_of[i] : (unsigned long)i + 1);
        put_value(residues && residues[i].name[0] ? residues[i].name : "UNK", stream);
        fputs(" .\n", stream);
    }
    if (!residues)
        return;
    LOOP("pdbx_poly_seq_scheme", "asym_id", "entity_id", "seq_id", "mon_id", "pdb_seq_num",
         "pdb_strand_id", "pdb_ins_code");
    for (size_t i = 0; i < count && !ferror(stream); i++) {
        const ovoid_residue *const r = &residues[i];
        const char insertion[2] = {r->insertion, '\0'};
        put_chain(s, s->chain_of[i], stream);
        fprintf(stream, " %lu %lu ", (unsigned long)s->chain_of[i] + 1,
                (unsigned long)s->number_of[i]);
        put_value(r->name[0] ? r->name : "UNK", stream);
        if (r->number != OVOID_NO_NUMBER)
            fprintf(stream, " %ld ", (long)r->number);
        else
            fputs(" ? ", stream);
        put_value(r->chain, stream);
        putc(' ', stream);
        put_value(insertion, stream);
        putc('\n', stream);
    }
}

/* What the model is of and how it is represented: each chain whole, by Gaussians. */
static void put_categories(const sequence *s, size_t ellipsoids, FILE *stream) {
    LOOP("ihm_entity_poly_segment", "id", "entity_id", "seq_id_begin", "seq_id_end",
         "comp_id_begin", "comp_id_end");
    for (size_t i = 0; i < s->count; i++)
        fprintf(stream, "%zu %zu 1 %lu . .\n", i + 1, i + 1, (unsigned long)s->chains[i].residues);
    LOOP("ihm_struct_assembly", "id", "name", "description");
    fputs("1 'Complete assembly' 'All chains'\n", stream);
    LOOP("ihm_struct_assembly_details", "id", "assembly_id", "parent_assembly_id",
         "entity_description", "entity_id", "asym_id", "entity_poly_segment_id");
    for (size_t i = 0; i < s->count; i++) {
        fprintf(stream, "%zu 1 1 'chain %zu' %zu ", i + 1, i + 1, i + 1);
        put_chain(s, i, stream);
        fprintf(stream, " %zu\n", i + 1);
    }
    LOOP("ihm_model_representation", "id", "name", "details");
    fputs("1 'Gaussians' 'the field is the sum of weight times normal density'\n", stream);
    LOOP("ihm_model_representation_details", "id", "representation_id", "entity_id",
         "entity_description", "entity_asym_id", "entity_poly_segment_id", "model_object_primitive",
         "starting_model_id", "model_mode", "model_granularity", "model_object_count",
         "description");
    for (size_t i = 0; i < s->count; i++) {
        fprintf(stream, "%zu 1 %zu 'chain %zu' ", i + 1, i + 1, i + 1);
        put_chain(s, i, stream);
        fprintf(stream, " %zu gaussian . rigid by-feature ", i + 1);
        if (s->count == 1)
            fprintf(stream, "%zu .\n", ellipsoids);
        else
            fputs(". .\n", stream);
    }
    LOOP("ihm_model_list", "model_id", "model_name", "assembly_id", "protocol_id",
         "representation_id");
    fputs("1 'Ovoid model' 1 . 1\n", stream);
    LOOP("ihm_model_group", "id", "name", "details");
    fputs("1 'Models' .\n", stream);
    LOOP("ihm_model_group_link", "group_id", "model_id");
    fputs("1 1\n", stream);
}

static void put_gaussian(const ovoid_ellipsoid *e, size_t index, const sequence *s,
                         const range *stands_for, FILE *stream) {
    double c[6];
    ov_ellipsoid_covariance(e, c);
    fprintf(stream, "%zu %zu ", index + 1, stands_for->chain + 1);
    put_chain(s, stands_for->chain, stream);
    if (stands_for->begin)
        fprintf(stream, " %lu %lu ", (unsigned long)stands_for->begin,
                (unsigned long)stands_for->end);
    else /* of no atom: of the whole chain */
        fprintf(stream, " 1 %lu ", (unsigned long)s->chains[stands_for->chain].residues);
    fprintf(stream, "%.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g 1\n",
            e->centre[0], e->centre[1], e->centre[2], ov_ellipsoid_integral(e), c[0], c[1], c[2],
            c[1], c[3], c[4], c[2], c[4], c[5]);
}

/* order is NULL where nobody knows of residues. */
static ovoid_status put_gaussians(ovoid_context *context, const ov_scene *scene, const sequence *s,
                                  const uint32_t *first, const uint32_t *order, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const ovoid_model *const model = scene->models[0];
    const size_t count = ovoid_model_size(model);
    LOOP("ihm_gaussian_obj_site", "id", "entity_id", "asym_id", "seq_id_begin", "seq_id_end",
         "mean_Cartn_x", "mean_Cartn_y", "mean_Cartn_z", "weight", "covariance_matrix[1][1]",
         "covariance_matrix[1][2]", "covariance_matrix[1][3]", "covariance_matrix[2][1]",
         "covariance_matrix[2][2]", "covariance_matrix[2][3]", "covariance_matrix[3][1]",
         "covariance_matrix[3][2]", "covariance_matrix[3][3]", "model_id");
    for (size_t i = 0; i < count && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, count));
        const range r =
            order ? range_of(scene->molecule, s, order + first[i], first[i + 1] - first[i])
                  : (range){0, (uint32_t)i + 1, (uint32_t)i + 1};
        put_gaussian(ovoid_model_ellipsoids(model) + i, i, s, &r, stream);
    }
    fputs("#\n", stream);
cleanup:
    return status;
}

ovoid_status ov_write_ihm(ovoid_context *context, const ov_scene *scene,
                          const ovoid_export_options *options, const char *title, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const ovoid_molecule *const molecule = scene->molecule;
    const size_t count = ovoid_model_size(scene->models[0]);
    sequence s = {0};
    size_t one;
    uint32_t *owner = NULL, *first = NULL;
    const uint32_t *order = NULL;
    (void)options;
    if (molecule && ovoid_molecule_identity(molecule)) {
        OV_TRY(number_residues(context, molecule, &s));
        OV_TRY(ov_scene_owner(context, molecule, scene->models[0], &owner));
        OV_TRY(
            ov_scene_sort(context, owner, ovoid_molecule_atoms(molecule), count, &first, &order));
    } else {
        OV_TRY(find_chain(context, &s, "A", &one));
        s.chains[one].residues = (uint32_t)count;
    }
    put_head(&s, title, stream);
    put_residues(molecule, &s, count, stream);
    put_categories(&s, count, stream);
    OV_TRY(put_gaussians(context, scene, &s, first, order, stream));
cleanup:
    drop_sequence(&s);
    free(owner);
    free(first);
    return status;
}
