#include "molecule/structure.h"

#define USE_STD_SNPRINTF 1 /* spares gemmi's copy of stb_sprintf, which Debian's package lacks */
#include <gemmi/elem.hpp>
#include <gemmi/resinfo.hpp>
#include <gemmi/select.hpp>

#include <cctype>
#include <cstdio>
#include <cstring>
#include <exception>

static_assert(static_cast<int>(gemmi::El::D) == OV_DEUTERIUM, "an element's number is gemmi's");
static_assert(static_cast<int>(gemmi::El::END) == OV_ELEMENTS, "an element's number is gemmi's");

int ov_element_find(const char *symbol) {
    while (*symbol == ' ')
        symbol++;
    const size_t length = std::strlen(symbol);
    if (length == 0 || length > 2)
        return 0;
    for (size_t i = 0; i < length; i++)
        if (!std::isalpha(static_cast<unsigned char>(symbol[i])))
            return 0;
    return static_cast<int>(gemmi::find_element(symbol));
}

const char *ov_element_name(int element) {
    return element > 0 && element < OV_ELEMENTS
               ? gemmi::element_name(static_cast<gemmi::El>(element))
               : "";
}

/* The kinds of residue of which gemmi holds a table; names are short, so no string is allocated and
 * nothing can be thrown. */
static gemmi::ResidueInfo::Kind kind_of(const char *name) {
    const size_t length = std::strlen(name);
    for (size_t i = 0; i < length; i++)
        if (i > 6 || static_cast<unsigned char>(name[i]) > 0x7e) /* gemmi shifts its bytes */
            return gemmi::ResidueInfo::UNKNOWN;
    return gemmi::find_tabulated_residue(name).kind;
}

bool ov_residue_is_water(const char *name) {
    return kind_of(name) == gemmi::ResidueInfo::HOH || std::strcmp(name, "TIP3") == 0 ||
           std::strcmp(name, "SOL") == 0;
}

bool ov_residue_is_polymer(const char *name) {
    switch (kind_of(name)) {
    case gemmi::ResidueInfo::AA:
    case gemmi::ResidueInfo::AAD:
    case gemmi::ResidueInfo::PAA:
    case gemmi::ResidueInfo::MAA:
    case gemmi::ResidueInfo::RNA:
    case gemmi::ResidueInfo::DNA:
        return true;
    default:
        return false;
    }
}

/* Of a name without the blanks of PDB columns: an ion is called as its element; else the first
 * letter decides. */
static int element_of_word(const char *name, const char *residue) {
    const char *first = name;
    while (*first && !std::isalpha(static_cast<unsigned char>(*first)))
        first++;
    if (!*first)
        return 0;
    const char symbol[2] = {*first, '\0'};
    if (!ov_residue_is_polymer(residue) && !ov_residue_is_water(residue)) {
        char letters[3] = {first[0], '\0', '\0'};
        if (std::isalpha(static_cast<unsigned char>(first[1])))
            letters[1] = first[1];
        const size_t length = std::strlen(letters);
        const int two = ov_element_find(letters);
        if (two && std::strncmp(letters, residue, length) == 0 &&
            !std::isalpha(static_cast<unsigned char>(residue[length])))
            return two;
    }
    const bool selenium = std::strncmp(first, "SE", 2) == 0 &&
                          (std::strcmp(residue, "MSE") == 0 || std::strcmp(residue, "SEC") == 0);
    return selenium ? static_cast<int>(gemmi::El::Se) : ov_element_find(symbol);
}

int ov_element_of_name(const char *name, const char *residue, const char *columns) {
    /* Hg, He, Hf, Ho and Hs hardly ever have names of four characters: a hydrogen. A name that
     * begins with a digit, or with a letter and a digit, has an element of one letter. */
    if (!columns || ov_residue_is_polymer(residue) || ov_residue_is_water(residue))
        return element_of_word(name, residue);
    const bool letter = std::isalpha(static_cast<unsigned char>(columns[0]));
    if ((columns[0] == 'H' || columns[0] == 'h') && columns[3] != ' ')
        return OV_HYDROGEN;
    if (!letter || !std::isalpha(static_cast<unsigned char>(columns[1])))
        return element_of_word(name, "UNL"); /* no residue: the first letter */
    const char symbol[3] = {columns[0], columns[1], '\0'};
    const int two = ov_element_find(symbol);
    return two ? two : element_of_word(name, residue);
}

/* ---- selections --------------------------------------------------------------------------- */

struct ov_selection {
    gemmi::Selection selection;
    gemmi::Residue residue; /* what is asked about, kept to be filled again */
    gemmi::Atom atom;
    std::string chain;
};

/* What gemmi says holds the text it was given, whatever that is. */
static void copy_error(const char *text, char *error, size_t size) {
    std::snprintf(error, size, "%s", text);
    for (char *c = error; size && *c; c++)
        if (std::iscntrl(static_cast<unsigned char>(*c)))
            *c = '?';
}

ov_selection *ov_selection_create(const char *text, char *error, size_t size) {
    try {
        return new ov_selection{gemmi::Selection(text), {}, {}, {}};
    } catch (const std::bad_alloc &) {
        std::snprintf(error, size, "%s", "");
    } catch (const std::exception &e) {
        copy_error(e.what(), error, size);
    } catch (...) {
        std::snprintf(error, size, "cannot be parsed");
    }
    return nullptr;
}

void ov_selection_destroy(ov_selection **selection) {
    if (!selection)
        return;
    delete *selection;
    *selection = nullptr;
}

static gemmi::EntityType entity_of(ov_entity entity) {
    switch (entity) {
    case OV_ENTITY_POLYMER:
        return gemmi::EntityType::Polymer;
    case OV_ENTITY_WATER:
        return gemmi::EntityType::Water;
    case OV_ENTITY_OTHER:
        return gemmi::EntityType::NonPolymer;
    case OV_ENTITY_UNKNOWN:
        break;
    }
    return gemmi::EntityType::Unknown;
}

bool ov_selection_matches(ov_selection *s, const ov_selectable *atom) {
    try {
        if (s->selection.mdl != 0 && s->selection.mdl != atom->model)
            return false;
        s->chain = atom->chain;
        s->residue.name = atom->residue;
        s->residue.seqid.num = atom->number;
        s->residue.seqid.icode = atom->insertion;
        s->residue.entity_type = entity_of(atom->entity);
        s->atom.name = atom->name;
        s->atom.element = gemmi::Element(static_cast<gemmi::El>(atom->element));
        s->atom.altloc = atom->altloc;
        s->atom.occ = atom->occupancy;
        s->atom.b_iso = atom->b_factor;
        return s->selection.chain_ids.has(s->chain) && s->selection.matches(s->residue) &&
               s->selection.matches(s->atom);
    } catch (...) {
        return false; /* out of memory for a name: none here is long enough */
    }
}
