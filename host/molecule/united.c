#include "molecule/united.h"

#include "molecule/united_table.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* ---- known residues ----------------------------------------------------------------------- */

static int compare_residues(const void *name, const void *row) {
    return strcmp(name, ((const ov_united_residue *)row)->name);
}

static int compare_atoms(const void *wanted, const void *row) {
    const ov_united_atom *a = wanted, *b = row;
    int order = strcmp(a->residue, b->residue);
    return order ? order : strcmp(a->atom, b->atom);
}

static const ov_united_residue *find_residue(const char *name) {
    return bsearch(name, ov_united_residues, ov_united_residues_count, sizeof ov_united_residues[0],
                   compare_residues);
}

static const ov_united_atom *find_atom(const char *residue, const char *atom) {
    ov_united_atom wanted = {.hydrogens = 0};
    strcpy(wanted.residue, residue);
    strcpy(wanted.atom, atom);
    return bsearch(&wanted, ov_united_atoms, ov_united_atoms_count, sizeof ov_united_atoms[0],
                   compare_atoms);
}

/* Files from before 2008 write C1* for C1' and O1P for OP1. False for names too long to be known.
 */
static bool modern_name(const char *atom, char name[8]) {
    if (strlen(atom) > 7)
        return false;
    strcpy(name, atom);
    for (char *c = name; *c; c++)
        if (*c == '*')
            *c = '\'';
    if (strlen(name) == 3 && name[0] == 'O' && name[1] >= '1' && name[1] <= '3' && name[2] == 'P') {
        name[2] = name[1];
        name[1] = 'P';
    }
    return true;
}

/* What an atom has more of at the end of a chain than inside. */
static int added_at_end(const char *backbone, const char *atom, unsigned ends) {
    bool amino = strcmp(backbone, "=amino") == 0;
    if (amino)
        return ends & OV_UNITED_FIRST && strcmp(atom, "N") == 0 ? 2 : 0;
    return (ends & OV_UNITED_FIRST && strcmp(atom, "O5'") == 0) ||
           (ends & OV_UNITED_LAST && strcmp(atom, "O3'") == 0);
}

int ov_united_hydrogens(const char *residue, const char *atom, unsigned ends) {
    char name[8];
    const ov_united_residue *known = find_residue(residue);
    if (!known || !modern_name(atom, name))
        return -1;
    const ov_united_atom *found = find_atom(known->same, name);
    if (!found)
        found = find_atom(known->backbone, name);
    return found ? found->hydrogens + added_at_end(known->backbone, name, ends) : -1;
}

/* ---- unknown residues --------------------------------------------------------------------- */

static double length_of(const double a[3], const double b[3]) {
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt(x * x + y * y + z * z);
}

/* Angle between two bonds in degrees; 0 where a bond has no length. */
static double angle_of(const double at[3], const double a[3], const double b[3]) {
    double p = length_of(at, a), q = length_of(at, b), dot = 0;
    for (int k = 0; k < 3; k++)
        dot += (a[k] - at[k]) * (b[k] - at[k]);
    double cosine = p * q > 0 ? fmin(1, fmax(-1, dot / (p * q))) : 1;
    return acos(cosine) * 180 / acos(-1);
}

/* Three bonds in a plane have angles of 360 degrees in all, those of a tetrahedron 328. */
static bool planar(const double at[3], const double (*others)[3]) {
    return angle_of(at, others[0], others[1]) + angle_of(at, others[1], others[2]) +
               angle_of(at, others[2], others[0]) >
           345;
}

static int carbon(const double at[3], size_t neighbours, const double (*others)[3]) {
    if (neighbours == 0)
        return 4;
    double first = length_of(at, others[0]);
    if (neighbours == 1)
        return first > 1.4 ? 3 : first > 1.25 ? 2 : 1; /* single, double, triple bond */
    if (neighbours == 2) {
        double angle = angle_of(at, others[0], others[1]);
        double mean = (first + length_of(at, others[1])) / 2;
        /* Aromatic bonds measure 1.32 to 1.40, single ones 1.43 (to oxygen) and more. Angles alone
         * tell less: those of CH2 reach 120 degrees where a structure is strained. */
        if (angle > 155)
            return 0;
        return mean < 1.42 || (angle > 118 && mean < 1.46) ? 1 : 2;
    }
    return neighbours == 3 && !planar(at, others);
}

static int nitrogen(const double at[3], size_t neighbours, const double (*others)[3]) {
    if (neighbours == 0)
        return 4;
    double first = length_of(at, others[0]);
    if (neighbours == 1)
        return first > 1.42 ? 3 : first > 1.22 ? 2 : 0; /* ammonium; amide; nitrile */
    if (neighbours == 2) {
        /* A proton on a ring's nitrogen widens its angle: in rings of five from 105 to 108 degrees,
         * of six from 117 to 124. */
        double angle = angle_of(at, others[0], others[1]);
        double mean = (first + length_of(at, others[1])) / 2;
        if (mean > 1.44)
            return 2;
        if (mean > 1.375) /* a peptide's, with one single bond */
            return 1;
        return !(angle < 106.5 || (angle > 111 && angle < 120.5));
    }
    return neighbours == 3 && !planar(at, others);
}

static int oxygen(const double at[3], size_t neighbours, const double (*others)[3]) {
    if (neighbours == 0)
        return 2;
    double first = length_of(at, others[0]);
    /* C-OH measures 1.36 to 1.43; C=O is shorter, and S=O and P-O of acids are longer. */
    return neighbours == 1 && first > 1.32 && first < 1.455;
}

static int sulfur(const double at[3], size_t neighbours, const double (*others)[3]) {
    if (neighbours == 0)
        return 2;
    double first = length_of(at, others[0]); /* C-SH, neither C=S nor S-S */
    return neighbours == 1 && first > 1.74 && first < 1.95;
}

int ov_united_hydrogens_of_shape(const char *element, const double place[3], size_t neighbours,
                                 const double (*others)[3]) {
    if (strcasecmp(element, "C") == 0)
        return carbon(place, neighbours, others);
    if (strcasecmp(element, "N") == 0)
        return nitrogen(place, neighbours, others);
    if (strcasecmp(element, "O") == 0)
        return oxygen(place, neighbours, others);
    if (strcasecmp(element, "P") == 0)
        return 0; /* phosphate */
    return strcasecmp(element, "S") == 0 ? sulfur(place, neighbours, others) : -1;
}

/* ---- radii -------------------------------------------------------------------------------- */

static const ov_united_element *find_element(const char *element) {
    for (size_t i = 0; i < ov_united_elements_count; i++)
        if (strcasecmp(element, ov_united_elements[i].element) == 0)
            return &ov_united_elements[i];
    return NULL;
}

ov_united_source ov_united_radius(const char *residue, const char *atom, const char *element,
                                  int hydrogens, double *radius) {
    const ov_united_element *row = find_element(element);
    if (!row)
        return OV_UNITED_NONE;
    if (hydrogens < 0)
        hydrogens = ov_united_hydrogens(residue, atom, 0);
    ov_united_source source = hydrogens < 0 ? OV_UNITED_ELEMENT : OV_UNITED_ATOM;
    if (hydrogens < 0)
        hydrogens = row->usual;
    if (hydrogens >= row->count)
        hydrogens = row->count - 1;
    *radius = row->radii[hydrogens];
    return source;
}
