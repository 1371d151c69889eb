#include "fit/adaptive/search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The atoms that the chosen ellipsoids are made of, as quadrics and by number; returns how many. */
static size_t atoms_of(const ov_adaptive *f, const ov_trial *t, const bool *chosen,
                       ov_quadric *quadrics, uint32_t *atom) {
    size_t count = 0;
    for (size_t i = 0; i < f->atoms; ++i)
        if (chosen[t->owner[i]]) {
            ov_quadric_of_atom(f->xyzr + 4 * i, f->options->decay, &quadrics[count]);
            atom[count++] = (uint32_t)i;
        }
    return count;
}

/* Puts `fresh` ellipsoids in the place of the chosen ones: into their slots, what is more of them
 * at the end, and closes the gaps where they are fewer. slot gets where each one went. */
static void take_places(ov_trial *t, const bool *chosen, const ov_quadric *fresh, size_t count,
                        uint32_t *moved, uint32_t *slot) {
    size_t kept = 0, taken = 0;
    for (size_t i = 0; i < t->count; ++i) {
        double *const to = t->x + kept * OV_FACTOR_PARAMETERS;
        if (chosen[i] && taken == count)
            continue;
        if (chosen[i]) {
            slot[taken] = (uint32_t)kept;
            ov_factor_of_quadric(&fresh[taken++], to);
        } else {
            memmove(to, t->x + i * OV_FACTOR_PARAMETERS, OV_FACTOR_PARAMETERS * sizeof *to);
        }
        moved[i] = (uint32_t)kept++;
    }
    for (; taken < count; ++taken, ++kept) {
        slot[taken] = (uint32_t)kept;
        ov_factor_of_quadric(&fresh[taken], t->x + kept * OV_FACTOR_PARAMETERS);
    }
    t->count = kept;
}

ovoid_status ov_adaptive_rebuild(ov_adaptive *f, ov_trial *t, double factor, const bool *chosen) {
    ovoid_status status = OVOID_OK;
    ov_reduction *reduction = NULL;
    const size_t before = t->count;
    size_t old = 0;
    ov_quadric *const quadrics = ov_alloc(f->context, f->atoms, sizeof *quadrics, "atoms");
    uint32_t *const atom = ov_alloc(f->context, 2 * f->atoms, sizeof *atom, "owners");
    uint32_t *const moved = ov_alloc(f->context, before + f->atoms, sizeof *moved, "owners");
    if (!quadrics || !atom || !moved) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    uint32_t *const owner = atom + f->atoms, *const slot = moved + before;
    const size_t atoms = atoms_of(f, t, chosen, quadrics, atom);
    for (size_t i = 0; i < before; ++i)
        old += chosen[i];
    if (atoms == 0)
        goto cleanup;
    const size_t room = f->capacity - (before - old), most = atoms < room ? atoms : room;
    const size_t count = (size_t)fmin(fmax(ceil(factor * (double)old), 1.0), (double)most);
    const ov_reduction_options merging = ov_adaptive_merging();
    OV_TRY(ov_reduction_create(f->context, quadrics, atoms, count, &merging, &reduction));
    OV_TRY(ov_reduction_cut(f->context, reduction, count, quadrics, owner));
    take_places(t, chosen, quadrics, count, moved, slot);
    for (size_t i = 0; i < f->atoms; ++i)
        if (!chosen[t->owner[i]])
            t->owner[i] = moved[t->owner[i]];
    for (size_t n = 0; n < atoms; ++n)
        t->owner[atom[n]] = slot[owner[n]];
cleanup:
    ov_reduction_destroy(&reduction);
    free(quadrics);
    free(atom);
    free(moved);
    return status;
}
