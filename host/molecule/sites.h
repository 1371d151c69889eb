/*
 * Who the atoms of a file are, as a reader collects it, and which of them the molecule keeps.
 *
 * Models, waters and hydrogens are left out as they are met. Selections need to know of the end of
 * a chain whether it is a polymer, and alternate locations need a whole residue: both are decided
 * at the end, on all atoms that are left.
 */
#ifndef OV_MOLECULE_SITES_H
#define OV_MOLECULE_SITES_H

#include "molecule/molecule.h"
#include "molecule/structure.h"

/* An atom of the file. Texts are filled up with zeros and end in one. */
typedef struct ov_site {
    char name[8], residue[8], chain[12];
    char part[12]; /* label_asym_id of mmCIF, which its assemblies go by; of PDB the chain */
    int element;   /* atomic number, 0 unknown, OV_DEUTERIUM */
    char altloc, insertion; /* 0: none */
    bool hetero;
    ov_entity entity;
    int32_t number, serial;
    float occupancy, b_factor;
} ov_site;

/* What an atom needs until the end of reading. */
typedef struct ov_site_extra {
    float occupancy, b_factor;
} ov_site_extra;

/* What a residue has beside what is public. */
typedef struct ov_residue_extra {
    char part[12];
    ov_entity entity;
} ov_residue_extra;

typedef struct ov_sites {
    ov_site_extra *extra; /* as many as atoms; NULL: the format knows no identities */
    size_t extra_room, identity_room;
    ov_residue_extra *residue_extra; /* as many as residues */
    size_t residue_extra_room, residue_room;
    bool altlocs;       /* some atom has alternate locations */
    uint64_t cut_names; /* texts that were too long */
    bool too_many;      /* residues or atoms for their 32-bit numbers */

    /* models */
    bool model_any;    /* an atom of some model was met */
    bool model_chosen; /* the wanted model was met */
    bool model_open;   /* what comes now belongs to it */
    bool by_atom;      /* each atom names its model: those of a model need not be together */
    bool model_ended;  /* an atom that follows belongs to another model */
    int32_t announced; /* number of the model to come, OV_NO_MODEL */
    int32_t model;     /* of the current one */
    int32_t chosen, lowest, highest;
    int32_t *numbers; /* of the models so far, owned, some of them more than once */
    size_t number_count, number_room;
    ovoid_status numbers_status; /* why they are not whole, all said */
} ov_sites;

enum { OV_NO_MODEL = INT32_MIN };

void ov_sites_init(ov_sites *sites);
void ov_sites_destroy(ov_sites *sites);

/* Copies text into a field of `size` bytes and fills it up; false where it had to be cut. Control
 * characters become '?': names are shown on terminals and written into tables. */
bool ov_site_text(char *field, size_t size, const char *text, size_t length);

/* The same of one character, which may be 0. */
char ov_site_letter(char c);

/* A model of this number (OV_NO_MODEL: one more than the last) is to come; one has ended. */
void ov_sites_announce_model(ov_sites *sites, int32_t number);
void ov_sites_end_model(ov_sites *sites);

struct ov_reader;

/* Whether the next atom belongs to the wanted model; counts it as left out if not. */
bool ov_sites_wanted(struct ov_reader *reader);

/* The same where every atom names its model. */
bool ov_sites_wanted_of(struct ov_reader *reader, int32_t number);

/* The residues since the last change of chain are a polymer. */
void ov_sites_ter(struct ov_reader *reader);

/* OVOID_ERROR_ARGUMENT where the selection makes no sense; NULL is none. */
ovoid_status ov_selection_check(ovoid_context *context, const char *text);

/* Leaves out the atoms of which keep is 0, and residues without atoms. */
void ov_sites_compact(struct ov_reader *reader, const unsigned char *keep);

/* Selects, resolves alternate locations, and counts. There may be no atom left. */
ovoid_status ov_sites_finish(struct ov_reader *reader);

/* Counts the kinds of the atoms that are left, once nothing more is left out. */
void ov_sites_count(ovoid_molecule *molecule);

#endif
