/* A locale with a decimal comma, for tests that numbers in files are free of it. */
#ifndef COMMA_H
#define COMMA_H

#include "scratch.h"

#include <locale.h>
#include <stdbool.h>

/* Enters one of the system's, else one made in the scratch folder. */
static inline bool comma_enter(scratch *s) {
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (setlocale(LC_ALL, names[i]))
            return localeconv()->decimal_point[0] == ',';
    char command[512];
    snprintf(command, sizeof command,
             "localedef -i de_DE -f UTF-8 '%s/de_DE.UTF-8' >/dev/null 2>&1", s->folder);
    if (system(command) != 0 || setenv("LOCPATH", s->folder, 1) != 0)
        return false;
    return setlocale(LC_ALL, "de_DE.UTF-8") && localeconv()->decimal_point[0] == ',';
}

/* Back to "C"; true if the decimal point was still a comma until now. */
static inline bool comma_leave(scratch *s) {
    char command[512], half[16];
    snprintf(half, sizeof half, "%.1f", 0.5);
    setlocale(LC_ALL, "C");
    snprintf(command, sizeof command, "rm -rf '%s/de_DE.UTF-8'", s->folder);
    (void)!system(command);
    return strcmp(half, "0,5") == 0;
}

#endif
