/*
 * For tests of readers: a context whose warnings are kept, and a folder for their files. Included
 * by one file of a program.
 */
#ifndef TEST_READING_H
#define TEST_READING_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "ovoid/ovoid.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static ovoid_context *context;
static char folder[64], warnings[2048]; /* of the last read, one per line */

static void keep_warning(const char *text, void *user) {
    (void)user;
    const size_t used = strlen(warnings);
    snprintf(warnings + used, sizeof warnings - used, "%s\n", text);
}

static int begin(void **state) {
    (void)state;
    strcpy(folder, "/tmp/ovoid-reading-XXXXXX");
    if (!mkdtemp(folder) || ovoid_context_create(&context) != OVOID_OK)
        return -1;
    ovoid_context_on_warning(context, keep_warning, NULL);
    return 0;
}

static int finish(void **state) {
    (void)state;
    ovoid_context_destroy(&context);
    return rmdir(folder);
}

#endif
