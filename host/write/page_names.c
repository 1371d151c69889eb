#include "write/page_names.h"

#include "write/text.h"

#include <string.h>

typedef struct place {
    const ovoid_residue *residue;
    size_t placement;
} place;

static place place_of(const ovoid_molecule *molecule, size_t atom) {
    size_t count;
    place p;
    const size_t origin = ovoid_molecule_origin(molecule, atom, &p.placement);
    const ovoid_atom *const atoms = ovoid_molecule_identity(molecule);
    p.residue = ovoid_molecule_residues(molecule, &count) + atoms[origin].residue;
    return p;
}

static void put_chain(const place *p, bool copies, FILE *stream) {
    ov_json_text(p->residue->chain, stream);
    if (copies)
        fprintf(stream, "/%zu", p->placement + 1);
    if (copies || p->residue->chain[0])
        fputs(": ", stream);
}

static void put_residue(const ovoid_residue *r, FILE *stream) {
    const char insertion[2] = {r->insertion, '\0'};
    ov_json_text(r->name, stream);
    if (r->number != OVOID_NO_NUMBER)
        fprintf(stream, " %ld", (long)r->number);
    ov_json_text(insertion, stream);
}

/* Atoms come in the molecule's order, so those of a residue, and of a chain, mostly together. */
static void put_residues(const ovoid_molecule *molecule, const uint32_t *atoms, size_t count,
                         FILE *stream) {
    size_t placements;
    const bool copies = ovoid_molecule_placements(molecule, &placements) != NULL;
    place before = {NULL, 0};
    for (size_t i = 0; i < count; i++) {
        const place now = place_of(molecule, atoms[i]);
        const bool same = before.residue && now.placement == before.placement;
        if (same && now.residue == before.residue)
            continue;
        if (same && strcmp(now.residue->chain, before.residue->chain) == 0) {
            fputs(", ", stream);
        } else {
            fputs(before.residue ? "; " : "", stream);
            put_chain(&now, copies, stream);
        }
        put_residue(now.residue, stream);
        before = now;
    }
}

void ov_page_names(const ovoid_molecule *molecule, const uint32_t *first, const uint32_t *order,
                   size_t count, FILE *stream) {
    const bool known = ovoid_molecule_identity(molecule) != NULL;
    for (size_t e = 0; e < count; e++) {
        fputs(e ? ",\"" : "[\"", stream);
        if (known)
            put_residues(molecule, order + first[e], first[e + 1] - first[e], stream);
        putc('"', stream);
    }
    fputs(count ? "]" : "[]", stream);
}
