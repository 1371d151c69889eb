#include "measures.h"

#include <stdlib.h>
#include <string.h>

bool source_parse_molecule(const char *text, ovoid_molecule_format *format) {
    if (strcmp(text, "pqr") == 0) {
        *format = OVOID_MOLECULE_PQR;
    } else if (strcmp(text, "xyzr") == 0) {
        *format = OVOID_MOLECULE_XYZR;
    } else {
        cli_error("--format takes pqr or xyzr, not '%s'", text);
        return false;
    }
    return true;
}

bool source_parse_format(const char *text, source_format *format) {
    static const struct {
        const char *name;
        source_format format;
    } names[] = {{"pqr", SOURCE_PQR}, {"xyzr", SOURCE_XYZR}, {"ovoid", SOURCE_MODEL}};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(text, names[i].name) == 0) {
            *format = names[i].format;
            return true;
        }
    cli_error("--format takes pqr, xyzr or ovoid, not '%s'", text);
    return false;
}

static bool is_model(const char *path, source_format format) {
    return format == SOURCE_AUTO ? cli_is_model(path) : format == SOURCE_MODEL;
}

ovoid_status source_read(ovoid_context *context, const char *path, source_format format,
                         source *read) {
    if (is_model(path, format))
        return ovoid_model_read(context, path, &read->model);
    return ovoid_molecule_read(context, path,
                               format == SOURCE_PQR    ? OVOID_MOLECULE_PQR
                               : format == SOURCE_XYZR ? OVOID_MOLECULE_XYZR
                                                       : OVOID_MOLECULE_AUTO,
                               &read->molecule);
}

void source_destroy(source *read) {
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
