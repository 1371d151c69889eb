#include "molecule/assembly.h"

#include "base/rigid.h"
#include "molecule/reader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A capsid of 32 million atoms has 1,680 placements, and no entry of the PDB comes near the other
 * limits: they keep memory and time in bounds that a file cannot move. Of generators, each goes
 * through all residues. */
enum {
    PLACEMENTS_MAX = 1000000,
    OPERATORS_MAX = 100000,
    GENERATORS_MAX = 10000,
    TEXT_BYTES_MAX = 1 << 24 /* of chains and expressions */
};

/* ---- what a file says ----------------------------------------------------------------------- */

void ov_assembly_source_destroy(ov_assembly_source *source) {
    for (size_t i = 0; i < source->generator_count; i++) {
        free(source->generators[i].chains);
        free(source->generators[i].expression);
    }
    free(source->generators);
    free(source->operators);
    *source = (ov_assembly_source){0};
}

ovoid_status ov_assembly_add_operator(ovoid_context *context, ov_assembly_source *source,
                                      const ov_text *text, const ov_line *line,
                                      const ov_operator *added) {
    if (source->operator_count == OPERATORS_MAX)
        return ov_text_limit(context, text, line->number, OPERATORS_MAX, "operators of assemblies");
    ovoid_status status = ov_grow(context, &source->operators, &source->operator_room,
                                  source->operator_count + 1, sizeof *added, "operators");
    if (status == OVOID_OK)
        source->operators[source->operator_count++] = *added;
    return status;
}

/* Before so much text of a generator is kept. */
static ovoid_status count_text(ovoid_context *context, ov_assembly_source *source,
                               const ov_text *text, const ov_line *line, size_t bytes) {
    source->text_bytes += bytes;
    if (source->text_bytes <= TEXT_BYTES_MAX)
        return OVOID_OK;
    return ov_text_limit(context, text, line->number, TEXT_BYTES_MAX,
                         "bytes of text about assemblies");
}

static char *copy_text(ovoid_context *context, const char *text) {
    char *copy = ov_alloc(context, strlen(text) + 1, 1, "an assembly");
    return copy ? strcpy(copy, text) : NULL;
}

ovoid_status ov_assembly_add_generator(ovoid_context *context, ov_assembly_source *source,
                                       const ov_text *text, const ov_line *line,
                                       const char *assembly, const char *chains,
                                       const char *expression) {
    if (source->generator_count == GENERATORS_MAX)
        return ov_text_limit(context, text, line->number, GENERATORS_MAX, "parts of assemblies");
    ovoid_status status =
        count_text(context, source, text, line,
                   (chains ? strlen(chains) : 0) + (expression ? strlen(expression) : 0));
    if (status == OVOID_OK)
        status = ov_grow(context, &source->generators, &source->generator_room,
                         source->generator_count + 1, sizeof *source->generators, "assemblies");
    if (status != OVOID_OK)
        return status;
    ov_generator *made = &source->generators[source->generator_count++];
    *made = (ov_generator){.first = source->operator_count};
    ov_site_text(made->assembly, sizeof made->assembly, assembly, strlen(assembly));
    if ((chains && !(made->chains = copy_text(context, chains))) ||
        (expression && !(made->expression = copy_text(context, expression))))
        return OVOID_ERROR_MEMORY;
    return OVOID_OK;
}

/* ---- REMARK 350 ------------------------------------------------------------------------------ */

static void trim(const char **text, const char **end) {
    while (*text < *end && ov_blank(**text))
        (*text)++;
    while (*text < *end && ov_blank((*end)[-1]))
        (*end)--;
}

/* Whether text begins so; if it does, it is moved past it and past the colon behind it. */
static bool passes(const char **text, const char *end, const char *words) {
    if (!ov_begins_with(*text, (size_t)(end - *text), words))
        return false;
    *text += strlen(words);
    return true;
}

/* Appends a list of chains to that of the last generator. "NULL" stands for a chain without name.
 */
static ovoid_status add_chains(ovoid_context *context, ov_assembly_source *source,
                               const ov_text *text, const ov_line *line, const char *names,
                               const char *end) {
    ov_generator *last = &source->generators[source->generator_count - 1];
    const size_t before = last->chains_length, length = (size_t)(end - names);
    ovoid_status status = count_text(context, source, text, line, length + 1);
    if (status == OVOID_OK)
        status = ov_grow(context, &last->chains, &last->chains_room, before + length + 2, 1,
                         "an assembly");
    if (status != OVOID_OK)
        return status;
    char *at = last->chains + before;
    if (before > 0)
        *at++ = ',';
    memcpy(at, names, length);
    at[length] = '\0';
    last->chains_length = (size_t)(at - last->chains) + length;
    return OVOID_OK;
}

/* Reads "BIOMT2   7  0.5 -0.8 0.3  0.0": the row, the operator's name, three factors and a shift.
 */
static ovoid_status read_biomt(ovoid_context *context, ov_assembly_source *source, ov_text *text,
                               const ov_line *line, const char *at, const char *end) {
    ovoid_status status = OVOID_OK;
    const int row = at < end ? *at - '1' : -1;
    size_t length;
    at += at < end;
    const char *name = ov_word_next(&at, end, &length);
    ov_operator made = {{0}, {0}, {0}};
    if (row < 0 || row > 2 || !name || row != source->rows % 3)
        return ov_text_fail(text, line, line->text,
                            "BIOMT1, BIOMT2 and BIOMT3 are expected in turn");
    if (source->generator_count == 0)
        OV_TRY(ov_assembly_add_generator(context, source, text, line,
                                         source->current[0] ? source->current : "1", NULL, NULL));
    ov_site_text(made.id, sizeof made.id, name, length);
    if (row == 0)
        OV_TRY(ov_assembly_add_operator(context, source, text, line, &made));
    ov_operator *current = &source->operators[source->operator_count - 1];
    for (int k = 0; k < 4; k++) {
        ov_number number;
        ov_quote quote;
        const char *word = ov_word_next(&at, end, &length);
        if (!word || ov_number_parse(word, length, &number) != length || !isfinite(number.value))
            return ov_text_fail(text, line, word ? word : end, "%s where a number is expected",
                                word ? ov_quote_text(&quote, word, length) : "the line ends");
        *(k < 3 ? &current->rotation[3 * row + k] : &current->translation[row]) = number.value;
    }
    source->rows = row + 1;
    if (row == 2)
        source->generators[source->generator_count - 1].operators++;
cleanup:
    return status;
}

ovoid_status ov_assembly_remark(ovoid_context *context, ov_assembly_source *source, ov_text *text,
                                const ov_line *line) {
    const char *at = line->text, *end = at + line->length;
    if (!passes(&at, end, "REMARK 350"))
        return OVOID_OK;
    trim(&at, &end);
    if (passes(&at, end, "BIOMOLECULE:")) {
        trim(&at, &end);
        ov_site_text(source->current, sizeof source->current, at, (size_t)(end - at));
        return OVOID_OK;
    }
    const bool begins = passes(&at, end, "APPLY THE FOLLOWING TO CHAINS:");
    if (begins && source->rows % 3 != 0) /* whose operator would it be? */
        return ov_text_fail(text, line, line->text, "a list of chains between BIOMT%d and BIOMT%d",
                            source->rows, source->rows + 1);
    if (begins) {
        ovoid_status status = ov_assembly_add_generator(
            context, source, text, line, source->current[0] ? source->current : "1", NULL, NULL);
        if (status != OVOID_OK)
            return status;
    }
    if (begins || (source->generator_count && passes(&at, end, "AND CHAINS:"))) {
        trim(&at, &end);
        return add_chains(context, source, text, line, at, end);
    }
    if (passes(&at, end, "BIOMT"))
        return read_biomt(context, source, text, line, at, end);
    return OVOID_OK;
}

/* ---- expressions ----------------------------------------------------------------------------- */

typedef struct product {
    ovoid_placement *placements;
    size_t count, room;
} product;

static int by_id(const void *a, const void *b) {
    return strcmp(((const ov_operator *)a)->id, ((const ov_operator *)b)->id);
}

static const ov_operator *find_operator(ov_assembly_source *source, const char *id) {
    ov_operator key = {{0}, {0}, {0}};
    if (!source->sorted &&
        source
            ->operator_count) /* only mmCIF looks for names, and its generators have expressions */
        qsort(source->operators, source->operator_count, sizeof key, by_id);
    source->sorted = true;
    if (!ov_site_text(key.id, sizeof key.id, id, strlen(id)) || !source->operator_count)
        return NULL;
    return bsearch(&key, source->operators, source->operator_count, sizeof key, by_id);
}

/* A name of an expression, or the names from one number to another. */
typedef struct names {
    char name[64]; /* as it is in the text, cut */
    bool range;
    long first, last; /* of a range, not negative */
} names;

/* What is done with these. */
typedef ovoid_status (*on_names)(const names *met, void *user);

/* Recognises "3-60". */
static void find_range(names *met) {
    const char *dash = strchr(met->name, '-');
    char *end_first, *end_last;
    met->first = strtol(met->name, &end_first, 10);
    met->last = dash ? strtol(dash + 1, &end_last, 10) : 0;
    met->range =
        dash && dash != met->name && end_first == dash && !*end_last && end_last != dash + 1;
}

/* Calls for each name or range of "1,3-5,P". */
static ovoid_status each_name(const char *text, const char *end, on_names fn, void *user) {
    names met;
    ovoid_status status = OVOID_OK;
    while (text <= end && status == OVOID_OK) {
        const char *comma = memchr(text, ',', (size_t)(end - text));
        const char *stop = comma ? comma : end, *first = text, *last = stop;
        trim(&first, &last);
        ov_site_text(met.name, sizeof met.name, first, (size_t)(last - first));
        find_range(&met);
        if (met.name[0])
            status = fn(&met, user);
        text = stop + 1;
    }
    return status;
}

/* The factors of "(1-60)(61-88)" one by one, from the left: the text within the next brackets, or
 * all of it up to a bracket. False at the end. */
static bool next_factor(const char **at, const char **first, const char **end) {
    while (ov_blank(**at))
        (*at)++;
    if (!**at)
        return false;
    const bool bracket = **at == '(';
    *first = *at + bracket;
    *end = *first + strcspn(*first, bracket ? ")" : "(");
    *at = *end + (bracket && **end == ')');
    return true;
}

typedef struct multiplication {
    ovoid_context *context;
    const char *name; /* of the file */
    ov_assembly_source *source;
    const char *assembly;
    const product *left;
    product *result;
    uint32_t part;
} multiplication;

/* a after b. */
static ovoid_placement compose(const ovoid_placement *a, const ov_operator *b) {
    ovoid_placement c = *a;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++)
                sum += a->rotation[3 * i + k] * b->rotation[3 * k + j];
            c.rotation[3 * i + j] = sum;
        }
        for (int k = 0; k < 3; k++)
            c.translation[i] += a->rotation[3 * i + k] * b->translation[k];
    }
    return c;
}

static ovoid_status too_many(const multiplication *m) {
    return ov_fail(m->context, OVOID_ERROR_LIMIT, "%s: assembly %s has more than %d placements",
                   m->name, m->assembly, PLACEMENTS_MAX);
}

static ovoid_status multiply(multiplication *m, const ov_operator *by) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < m->left->count; i++) {
        if (m->result->count >= PLACEMENTS_MAX)
            return too_many(m);
        OV_TRY(ov_grow(m->context, &m->result->placements, &m->result->room, m->result->count + 1,
                       sizeof *m->result->placements, "placements"));
        m->result->placements[m->result->count++] = compose(&m->left->placements[i], by);
    }
cleanup:
    return status;
}

static ovoid_status multiply_by_name(multiplication *m, const char *name) {
    const ov_operator *by = find_operator(m->source, name);
    if (!by)
        return ov_fail(m->context, OVOID_ERROR_FORMAT,
                       "%s: assembly %s needs the operator %s, which is not there", m->name,
                       m->assembly, name);
    return multiply(m, by);
}

/* Ends early: at a number that is no operator's, or with more placements than there may be. */
static ovoid_status multiply_by_names(const names *met, void *user) {
    if (!met->range)
        return multiply_by_name(user, met->name);
    ovoid_status status = OVOID_OK;
    for (long n = met->first; n <= met->last; n++) {
        char name[24];
        snprintf(name, sizeof name, "%ld", n);
        status = multiply_by_name(user, name);
        if (status != OVOID_OK || n == met->last) /* which may be the largest there is */
            break;
    }
    return status;
}

/* The order is that of the text: the left factor varies slowest. */
static void order_by_left(product *p, size_t left, size_t right, ovoid_placement *room) {
    for (size_t i = 0; i < left; i++)
        for (size_t k = 0; k < right; k++)
            room[i * right + k] = p->placements[k * left + i];
    memcpy(p->placements, room, left * right * sizeof *room);
}

/* All products of the operators of a generator, appended to `all`. */
static ovoid_status evaluate(multiplication *m, const ov_generator *generator, product *all) {
    static const ovoid_placement identity = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    ovoid_placement one = identity;
    product left = {&one, 1, 1}, result = {0};
    ovoid_placement *room = NULL;
    const char *at = generator->expression, *first, *end;
    ovoid_status status = OVOID_OK;
    m->left = &left;
    m->result = &result;
    for (size_t i = 0; !at && i < generator->operators; i++)
        OV_TRY(multiply(m, &m->source->operators[generator->first + i]));
    while (at && next_factor(&at, &first, &end)) {
        result = (product){0};
        OV_TRY(each_name(first, end, multiply_by_names, m));
        if (result.count == 0) {
            ov_quote quote;
            status = ov_fail(
                m->context, OVOID_ERROR_FORMAT,
                "%s: assembly %s: its expression names no operator: %s", m->name, m->assembly,
                ov_quote_text(&quote, generator->expression, strlen(generator->expression)));
            goto cleanup;
        }
        room = ov_alloc(m->context, result.count, sizeof *room, "placements");
        if (!room) {
            status = OVOID_ERROR_MEMORY;
            goto cleanup;
        }
        order_by_left(&result, left.count, result.count / left.count, room);
        free(room);
        room = NULL;
        if (left.placements != &one)
            free(left.placements);
        left = result;
        result = (product){0};
    }
    if (at) { /* the last product */
        free(result.placements);
        result = left.placements == &one ? (product){0} : left;
        left = (product){&one, 1, 1};
    }
    if (all->count + result.count > PLACEMENTS_MAX)
        OV_TRY(too_many(m));
    OV_TRY(ov_grow(m->context, &all->placements, &all->room, all->count + result.count + 1,
                   sizeof *all->placements, "placements"));
    for (size_t i = 0; i < result.count; i++) {
        result.placements[i].part = m->part;
        all->placements[all->count++] = result.placements[i];
    }
cleanup:
    if (left.placements != &one)
        free(left.placements);
    free(result.placements);
    return status;
}

/* ---- chains ---------------------------------------------------------------------------------- */

/* Whether a list of names with commas or blanks between them holds this one. */
static bool lists(const char *chains, const char *name) {
    const size_t size = strlen(name);
    for (const char *at = chains; *at;) {
        const size_t length = strcspn(at, ", \t\r\n");
        if (length > 0 && length == size && memcmp(at, name, size) == 0)
            return true;
        at += length;
        at += strspn(at, ", \t\r\n");
    }
    return false;
}

/* Files without names of chains, as PQR files often are, are one chain; "NULL" is the chain without
 * name of old PDB files. */
static bool has_chains(const ovoid_molecule *m, const ov_sites *sites) {
    for (size_t i = 0; i < m->residue_count; i++)
        if (sites->residue_extra[i].part[0])
            return true;
    return false;
}

static bool concerns(const ov_generator *generator, const char *part, bool named) {
    return !generator->chains || !named || lists(generator->chains, part) ||
           (!part[0] && lists(generator->chains, "NULL"));
}

static size_t residue_atoms(const ovoid_molecule *m, size_t residue) {
    const size_t end = residue + 1 < m->residue_count ? m->residues[residue + 1].first : m->atoms;
    return end - m->residues[residue].first;
}

/* Marks the residues that a generator is about; returns how many atoms these have. A chain is asked
 * for once, not for each residue. */
static size_t mark(const ovoid_molecule *m, const ov_sites *sites, const ov_generator *generator,
                   bool named, unsigned char *marked) {
    size_t atoms = 0;
    for (size_t i = 0; i < m->residue_count; i++) {
        const char *part = sites->residue_extra[i].part;
        const bool same = i > 0 && strcmp(part, sites->residue_extra[i - 1].part) == 0;
        marked[i] = same ? marked[i - 1] : concerns(generator, part, named);
        atoms += marked[i] ? residue_atoms(m, i) : 0;
    }
    return atoms;
}

/* ---- the list -------------------------------------------------------------------------------- */

static uint64_t saturated(uint64_t sum, uint64_t a, uint64_t b) {
    const uint64_t more = a && b > UINT64_MAX / a ? UINT64_MAX : a * b;
    return more > UINT64_MAX - sum ? UINT64_MAX : sum + more;
}

static ovoid_status count_names(const names *met, void *user) {
    uint64_t *count = user;
    const uint64_t more = !met->range               ? 1
                          : met->last >= met->first ? (uint64_t)(met->last - met->first) + 1
                                                    : 0;
    *count = saturated(*count, more, 1);
    return OVOID_OK;
}

static uint64_t count_placements(const ov_generator *generator) {
    const char *at = generator->expression, *first, *end;
    uint64_t total = 1;
    bool any = false;
    if (!at)
        return generator->operators;
    while (next_factor(&at, &first, &end)) {
        uint64_t count = 0;
        each_name(first, end, count_names, &count);
        total = saturated(0, total, count);
        any = true;
    }
    return any ? total : 0;
}

static ovoid_assembly_info *info_of(ovoid_molecule *m, const char *id) {
    for (size_t i = 0; i < m->assembly_count; i++)
        if (strcmp(m->assemblies[i].id, id) == 0)
            return &m->assemblies[i];
    ovoid_assembly_info *made = &m->assemblies[m->assembly_count++];
    *made = (ovoid_assembly_info){{0}, 0, 0};
    memcpy(made->id, id, strlen(id));
    return made;
}

static ovoid_status list(ov_reader *reader, bool named, unsigned char *marked) {
    const ov_assembly_source *source = &reader->assemblies;
    ovoid_molecule *m = reader->molecule;
    m->assemblies = ov_alloc(reader->context, source->generator_count, sizeof *m->assemblies,
                             "a list of assemblies");
    if (!m->assemblies)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < source->generator_count; i++) {
        const ov_generator *generator = &source->generators[i];
        ovoid_assembly_info *info = info_of(m, generator->assembly);
        const uint64_t placements = count_placements(generator);
        const size_t atoms = mark(m, &reader->sites, generator, named, marked);
        info->placements = saturated(info->placements, placements, 1);
        info->atoms = saturated(info->atoms, placements, atoms);
    }
    return OVOID_OK;
}

/* ---- making one ------------------------------------------------------------------------------ */

static ovoid_status no_such(const ov_reader *reader) {
    const ovoid_molecule *m = reader->molecule;
    char wanted[16], text[256] = "";
    size_t used = 0;
    ov_site_text(wanted, sizeof wanted, reader->options->assembly,
                 strlen(reader->options->assembly));
    for (size_t i = 0; i < m->assembly_count && used < sizeof text - 20; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%s", i ? ", " : "",
                                 m->assemblies[i].id);
    if (m->assembly_count == 0)
        return ov_fail(reader->context, OVOID_ERROR_ARGUMENT,
                       "%s: no assembly %s: the file describes none", ov_text_name(reader->text),
                       wanted);
    return ov_fail(reader->context, OVOID_ERROR_ARGUMENT, "%s: no assembly %s: the file has %s",
                   ov_text_name(reader->text), wanted, text);
}

static ovoid_status check_rotation(const ov_reader *reader, const ovoid_placement *p) {
    if (ov_is_rotation(p->rotation, 1e-2))
        return OVOID_OK;
    return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                   "%s: assembly %s: a placement that is no rotation and translation",
                   ov_text_name(reader->text), reader->options->assembly);
}

/* Farthest that an atom of the unit is from the origin. */
static double reach(const ovoid_molecule *m) {
    double most = 0.0;
    for (size_t i = 0; i < m->atoms; i++) {
        const double *p = m->xyzr + 4 * i;
        most = fmax(most, p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    }
    return sqrt(most);
}

static ovoid_status check_placements(const ov_reader *reader, const product *all) {
    const double far = reach(reader->molecule);
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < all->count; i++) {
        const double *t = all->placements[i].translation;
        OV_TRY(check_rotation(reader, &all->placements[i]));
        if (!(1.1 * far + sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) <= OV_COORDINATE_LIMIT))
            return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                           "%s: assembly %s: placement %zu takes atoms beyond 1e6 angstrom",
                           ov_text_name(reader->text), reader->options->assembly, i + 1);
    }
cleanup:
    return status;
}

static bool is_wanted(const ov_reader *reader, const ov_generator *generator) {
    return strcmp(generator->assembly, reader->options->assembly) == 0;
}

/* Leaves out the atoms of chains that are not in the assembly. */
static ovoid_status drop_others(ov_reader *reader, bool named, unsigned char *marked) {
    ovoid_molecule *m = reader->molecule;
    unsigned char *keep = ov_alloc(reader->context, m->atoms, 1, "a selection");
    uint64_t dropped = 0;
    if (!keep)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 0; g < reader->assemblies.generator_count; g++) {
        if (!is_wanted(reader, &reader->assemblies.generators[g]))
            continue;
        mark(m, &reader->sites, &reader->assemblies.generators[g], named, marked);
        for (size_t i = 0; i < m->atoms; i++)
            keep[i] |= marked[m->identity[i].residue];
    }
    for (size_t i = 0; i < m->atoms; i++)
        dropped += !keep[i];
    if (dropped)
        ov_sites_compact(reader, keep);
    m->counts.skipped += dropped;
    m->counts.skipped_assembly = dropped;
    free(keep);
    return OVOID_OK;
}

/* The unit's atoms that a generator is about. */
static ovoid_status add_part(ov_reader *reader, const ov_generator *generator, bool named,
                             unsigned char *marked, size_t *room) {
    ovoid_molecule *m = reader->molecule;
    ovoid_status status = ov_grow(reader->context, &m->parts, room, m->part_count + 1,
                                  sizeof *m->parts, "parts of an assembly");
    if (status != OVOID_OK)
        return status;
    ov_part *part = &m->parts[m->part_count++];
    *part = (ov_part){NULL, mark(m, &reader->sites, generator, named, marked)};
    if (part->atoms == m->atoms)
        return OVOID_OK;
    part->index = ov_alloc(reader->context, part->atoms, sizeof *part->index, "an assembly");
    if (!part->index)
        return OVOID_ERROR_MEMORY;
    size_t used = 0;
    for (size_t i = 0; i < m->atoms; i++)
        if (marked[m->identity[i].residue])
            part->index[used++] = (uint32_t)i;
    return OVOID_OK;
}

/* Numbers the atoms of all placements in a row. */
static ovoid_status count_all(ov_reader *reader) {
    ovoid_molecule *m = reader->molecule;
    uint64_t total = 0;
    for (size_t i = 0; i < m->placement_count; i++) {
        m->placements[i].first = total;
        total += m->parts[m->placements[i].part].atoms;
    }
    if (total > UINT32_MAX)
        return ov_fail(reader->context, OVOID_ERROR_LIMIT,
                       "%s: assembly %s has %llu atoms, more than %u", ov_text_name(reader->text),
                       reader->options->assembly, (unsigned long long)total, UINT32_MAX);
    m->all_atoms = (size_t)total;
    return OVOID_OK;
}

static ovoid_status make(ov_reader *reader, bool named, unsigned char *marked) {
    ovoid_molecule *m = reader->molecule;
    ov_assembly_source *source = &reader->assemblies;
    multiplication product_of = {.context = reader->context,
                                 .name = ov_text_name(reader->text),
                                 .source = source,
                                 .assembly = reader->options->assembly};
    product all = {0};
    size_t part_room = 0;
    ovoid_status status = OVOID_OK;
    OV_TRY(drop_others(reader, named, marked));
    for (size_t g = 0; g < source->generator_count; g++) {
        if (!is_wanted(reader, &source->generators[g]))
            continue;
        product_of.part = (uint32_t)m->part_count;
        OV_TRY(add_part(reader, &source->generators[g], named, marked, &part_room));
        if (m->parts[product_of.part].atoms)
            OV_TRY(evaluate(&product_of, &source->generators[g], &all));
    }
    OV_TRY(check_placements(reader, &all));
    m->placements = all.placements;
    m->placement_count = all.count;
    all.placements = NULL;
    if (m->placement_count == 0)
        status = ov_fail(reader->context, OVOID_ERROR_EMPTY,
                         "%s: assembly %s: none of its chains has an atom that is left",
                         ov_text_name(reader->text), reader->options->assembly);
    else
        status = count_all(reader);
cleanup:
    free(all.placements);
    return status;
}

ovoid_status ov_assembly_finish(ov_reader *reader) {
    ovoid_molecule *m = reader->molecule;
    const bool wanted = reader->options->assembly != NULL;
    ovoid_status status = OVOID_OK;
    if (reader->assemblies.rows % 3 != 0)
        return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                       "%s: REMARK 350: the last operator has no BIOMT%d",
                       ov_text_name(reader->text), reader->assemblies.rows + 1);
    if (!m->identity || reader->assemblies.generator_count == 0)
        return wanted ? no_such(reader) : OVOID_OK;
    const bool named = has_chains(m, &reader->sites);
    unsigned char *marked = ov_alloc(reader->context, m->residue_count, 1, "an assembly");
    if (!marked)
        return OVOID_ERROR_MEMORY;
    OV_TRY(list(reader, named, marked));
    if (!wanted)
        goto cleanup;
    bool found = false;
    for (size_t i = 0; i < m->assembly_count; i++)
        found |= strcmp(m->assemblies[i].id, reader->options->assembly) == 0;
    status = found ? make(reader, named, marked) : no_such(reader);
cleanup:
    free(marked);
    return status;
}

/* ---- all atoms ------------------------------------------------------------------------------- */

void ov_placement_atoms(const ovoid_molecule *m, const ovoid_placement *p, double *out) {
    const ov_part *part = &m->parts[p->part];
    for (size_t i = 0; i < part->atoms; i++, out += 4) {
        const double *in = m->xyzr + 4 * (part->index ? part->index[i] : i);
        for (int k = 0; k < 3; k++)
            out[k] = p->rotation[3 * k] * in[0] + p->rotation[3 * k + 1] * in[1] +
                     p->rotation[3 * k + 2] * in[2] + p->translation[k];
        out[3] = in[3];
    }
}

ovoid_status ov_molecule_expand(ovoid_context *context, const ovoid_molecule *molecule) {
    /* What a molecule looks like does not change: the array is a cache. */
    ovoid_molecule *m = (ovoid_molecule *)molecule;
    if (m->placement_count == 0 || m->all_xyzr)
        return OVOID_OK;
    double *all = malloc(m->all_atoms * 4 * sizeof *all);
    if (!all)
        return ov_fail(context, OVOID_ERROR_MEMORY,
                       "out of memory for the assembly's %zu atoms (%.1f MB)", m->all_atoms,
                       (double)m->all_atoms * 4 * sizeof *all / 1e6);
    for (size_t i = 0; i < m->placement_count; i++)
        ov_placement_atoms(m, &m->placements[i], all + 4 * m->placements[i].first);
    m->all_xyzr = all;
    return OVOID_OK;
}
