/*
 * Bonds by distance: atoms sorted by cells of a lattice, found again by binary search, so that
 * memory follows the atoms and not the space between them.
 */
#include "molecule/radii.h"
#include "molecule/united.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CELL 2.5     /* angstrom: no bond is longer */
#define HYDROGEN 1.4 /* angstrom, longest bond of a hydrogen: S-H has 1.34 */

/* Atoms that are looked at for one: more than fit in 27 cells of a real molecule. */
enum { CANDIDATES_MAX = 4096 };

typedef struct entry {
    uint64_t cell;
    uint32_t atom;
} entry;

struct ov_bonds {
    const ovoid_molecule *molecule;
    entry *entries; /* sorted by cell, then by atom */
    size_t count;
};

/* Coordinates are within 1e6 angstrom: 20 bits for each. */
static uint64_t cell_of(const double place[3], int dx, int dy, int dz) {
    const int steps[3] = {dx, dy, dz};
    uint64_t cell = 0;
    for (int k = 0; k < 3; k++)
        cell = cell << 21 |
               (uint64_t)((int64_t)floor((place[k] + OV_COORDINATE_LIMIT) / CELL) + 1 + steps[k]);
    return cell;
}

static int by_cell(const void *a, const void *b) {
    const entry *x = a, *y = b;
    if (x->cell != y->cell)
        return x->cell < y->cell ? -1 : 1;
    return (x->atom > y->atom) - (x->atom < y->atom);
}

ovoid_status ov_bonds_create(ovoid_context *context, const ovoid_molecule *molecule,
                             ov_bonds **bonds) {
    ov_bonds *made = ov_alloc(context, 1, sizeof *made, "bonds");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->molecule = molecule;
    made->count = molecule->atoms;
    made->entries = ov_alloc(context, made->count, sizeof *made->entries, "bonds");
    if (!made->entries) {
        ov_bonds_destroy(&made);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t i = 0; i < made->count; i++)
        made->entries[i] = (entry){cell_of(molecule->xyzr + 4 * i, 0, 0, 0), (uint32_t)i};
    qsort(made->entries, made->count, sizeof *made->entries, by_cell);
    *bonds = made;
    return OVOID_OK;
}

void ov_bonds_destroy(ov_bonds **bonds) {
    if (!bonds || !*bonds)
        return;
    free((*bonds)->entries);
    free(*bonds);
    *bonds = NULL;
}

static size_t first_of(const ov_bonds *bonds, uint64_t cell) {
    size_t low = 0, high = bonds->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (bonds->entries[middle].cell < cell)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static double distance(const ovoid_molecule *m, size_t a, size_t b) {
    const double *p = m->xyzr + 4 * a, *q = m->xyzr + 4 * b;
    const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return sqrt(x * x + y * y + z * z);
}

/* Calls visit for each atom within CELL of atom i, but for i, until it returns false. */
typedef bool (*visitor)(const ovoid_molecule *m, size_t i, size_t other, double apart, void *user);

static void visit_near(const ov_bonds *bonds, size_t i, visitor visit, void *user) {
    const ovoid_molecule *m = bonds->molecule;
    size_t seen = 0;
    for (int n = 0; n < 9; n++) {
        /* The three cells along z have keys in a row. */
        const uint64_t first = cell_of(m->xyzr + 4 * i, n / 3 - 1, n % 3 - 1, -1);
        for (size_t k = first_of(bonds, first);
             k < bonds->count && bonds->entries[k].cell <= first + 2; k++) {
            const size_t other = bonds->entries[k].atom;
            if (other == i)
                continue;
            const double apart = distance(m, i, other);
            if (apart <= CELL && !visit(m, i, other, apart, user))
                return;
            if (++seen == CANDIDATES_MAX)
                return;
        }
    }
}

static bool is_hydrogen(const ovoid_molecule *m, size_t i) {
    const char *element = m->identity[i].element;
    return (*element == 'H' || *element == 'D') && element[1] == '\0';
}

/* Elements of the third row and on, as far as they bond in ligands. */
static bool is_large(const ovoid_molecule *m, size_t i) {
    static const char *const symbols[] = {"S", "P", "Se", "Cl", "Br"};
    for (size_t k = 0; k < sizeof symbols / sizeof *symbols; k++)
        if (strcmp(m->identity[i].element, symbols[k]) == 0)
            return true;
    return false;
}

/* ---- heavy neighbours ----------------------------------------------------------------------- */

typedef struct found {
    size_t count;
    double (*places)[3];
} found;

static bool add_heavy(const ovoid_molecule *m, size_t i, size_t other, double apart, void *user) {
    found *f = user;
    const double most = is_large(m, i) || is_large(m, other) ? OV_UNITED_BOND_LONG : OV_UNITED_BOND;
    if (is_hydrogen(m, other) || apart > most)
        return true;
    memcpy(f->places[f->count++], m->xyzr + 4 * other, sizeof f->places[0]);
    return f->count < OV_NEIGHBOURS_MAX;
}

size_t ov_bonds_heavy(const ov_bonds *bonds, size_t i, double places[OV_NEIGHBOURS_MAX][3]) {
    found f = {0, places};
    visit_near(bonds, i, add_heavy, &f);
    return f.count;
}

/* ---- an atom of a name ------------------------------------------------------------------------
 */

typedef struct sought_name {
    const char *name;
    double distance;
    bool found;
} sought_name;

static bool compare_name(const ovoid_molecule *m, size_t i, size_t other, double apart,
                         void *user) {
    sought_name *s = user;
    (void)i;
    s->found = apart <= s->distance && strcmp(m->identity[other].name, s->name) == 0;
    return !s->found;
}

bool ov_bonds_near(const ov_bonds *bonds, size_t i, const char *name, double distance_most) {
    sought_name s = {name, distance_most, false};
    visit_near(bonds, i, compare_name, &s);
    return s.found;
}

/* ---- hydrogens ---------------------------------------------------------------------------------
 */

typedef struct nearest {
    size_t atom;
    double apart;
} nearest;

static bool compare_heavy(const ovoid_molecule *m, size_t i, size_t other, double apart,
                          void *user) {
    nearest *n = user;
    (void)i;
    if (apart < n->apart && !is_hydrogen(m, other))
        *n = (nearest){other, apart};
    return true;
}

size_t ov_bonds_of_hydrogen(const ov_bonds *bonds, size_t i) {
    nearest n = {SIZE_MAX, HYDROGEN};
    visit_near(bonds, i, compare_heavy, &n);
    return n.atom;
}
