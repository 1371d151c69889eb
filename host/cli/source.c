#include "measures.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

ovoid_status source_read(ovoid_context *context, const char *path, const reading *how,
                         source *read) {
    return reading_is_model(how, path) ? ovoid_model_read(context, path, &read->model)
                                       : reading_molecule(how, context, path, &read->molecule);
}

ovoid_status source_field(ovoid_context *context, source *read, double decay, double isovalue) {
    return read->model
               ? ovoid_field_of_model(context, read->model, &read->field)
               : ovoid_field_of_molecule(context, read->molecule, decay, isovalue, &read->field);
}

void source_destroy(source *read) {
    ovoid_field_destroy(&read->field);
    ovoid_molecule_destroy(&read->molecule);
    ovoid_model_destroy(&read->model);
}

char *source_output(const char *input, const char *extension) {
    const char *slash = strrchr(input, '/');
    const char *base = slash ? slash + 1 : input;
    size_t length = strlen(base);
    if (length > 3 && strcmp(base + length - 3, ".gz") == 0)
        length -= 3;
    for (size_t i = length; i-- > 1;) /* a dot in front makes no extension */
        if (base[i] == '.') {
            length = i;
            break;
        }
    char *name = malloc(length + strlen(extension) + 1);
    if (name) {
        memcpy(name, base, length);
        strcpy(name + length, extension);
    }
    return name;
}

const char *source_name(const char *path) {
    return strcmp(path, "-") == 0 ? "standard input" : path;
}

void source_print_placements(const ovoid_model *model, FILE *out) {
    size_t placements;
    if (ovoid_model_placements(model, &placements))
        fprintf(out, ", %zu placements of %zu", placements, ovoid_model_unit_size(model));
}

void source_print_model(const ovoid_model *model, const char *path, FILE *out) {
    const size_t size = ovoid_model_size(model);
    fprintf(out, "model     %s: %zu ellipsoid%s", source_name(path), size, size == 1 ? "" : "s");
    source_print_placements(model, out);
}
