#include "cli.h"

#include <string.h>
#include <strings.h>
#include <sys/stat.h>

/* Whether the name of a file, .gz aside, ends so. */
static bool ends_in(const char *path, const char *extension) {
    size_t length = strlen(path), tail = strlen(extension);
    if (length > 3 && strcasecmp(path + length - 3, ".gz") == 0)
        length -= 3;
    return length > tail && strncasecmp(path + length - tail, extension, tail) == 0;
}

/* Whether the file begins as a model does: "# ovoid model", after a byte order mark or not. What is
 * no regular file, such as a pipe, gives its bytes once, and is not looked into. */
static bool begins_as_model(const char *path) {
    static const char mark[] = "\xef\xbb\xbf", magic[] = "ovoid model";
    char text[64] = "";
    struct stat info;
    FILE *stream = stat(path, &info) == 0 && S_ISREG(info.st_mode) ? fopen(path, "rb") : NULL;
    if (!stream)
        return false;
    text[fread(text, 1, sizeof text - 1, stream)] = '\0';
    fclose(stream);
    const char *at = text;
    if (strncmp(at, mark, 3) == 0)
        at += 3;
    at += strspn(at, " \t\r\n");
    if (*at++ != '#')
        return false;
    at += strspn(at, " \t");
    return strncmp(at, magic, sizeof magic - 1) == 0;
}

bool cli_is_model(const char *path) {
    static const char *const molecules[] = {".pqr", ".xyzr", ".pdb", ".ent", ".cif", ".mmcif"};
    if (strcmp(path, "-") == 0 || ends_in(path, ".ovoid"))
        return true;
    for (size_t i = 0; i < sizeof molecules / sizeof *molecules; i++)
        if (ends_in(path, molecules[i]))
            return false;
    return begins_as_model(path);
}
