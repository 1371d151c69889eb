/*
 * What gemmi knows of structures: elements, residues, and the language of selections. Its C++ stays
 * behind these C functions (structure.cpp), which let no exception out.
 */
#ifndef OV_MOLECULE_STRUCTURE_H
#define OV_MOLECULE_STRUCTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { OV_HYDROGEN = 1, OV_DEUTERIUM = 119, OV_ELEMENTS };

/* Atomic number of a symbol in any case, blanks in front ignored; OV_DEUTERIUM for D; 0 where there
 * is no such element. */
int ov_element_find(const char *symbol);

/* The symbol, "C" or "Zn"; "" for 0. */
const char *ov_element_name(int element);

/* The element that the atom's name stands for in a residue of this name, 0 where none is known.
 * `columns` holds the four characters of a PDB file's columns 13-16, whose blanks tell CA, the
 * carbon, from calcium; NULL where the name is all there is. */
int ov_element_of_name(const char *name, const char *residue, const char *columns);

bool ov_residue_is_water(const char *name);

/* An amino acid or a nucleotide, modified ones included. */
bool ov_residue_is_polymer(const char *name);

typedef enum ov_entity {
    OV_ENTITY_UNKNOWN,
    OV_ENTITY_POLYMER,
    OV_ENTITY_OTHER,
    OV_ENTITY_WATER
} ov_entity;

/* An atom as a selection sees it. */
typedef struct ov_selectable {
    const char *name, *residue, *chain;
    int element;
    char altloc;    /* 0: none */
    char insertion; /* ' ': none */
    int32_t number, model;
    ov_entity entity;
    float occupancy, b_factor;
} ov_selectable;

typedef struct ov_selection ov_selection;

/* Parses a selection in gemmi's syntax. NULL: it makes no sense, and `error` (`size` bytes) says
 * why, or there is no memory, and `error` is empty. */
ov_selection *ov_selection_create(const char *text, char *error, size_t size);
void ov_selection_destroy(ov_selection **selection);
bool ov_selection_matches(ov_selection *selection, const ov_selectable *atom);

#ifdef __cplusplus
}
#endif

#endif
