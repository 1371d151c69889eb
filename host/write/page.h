/*
 * A scene as a page for a browser.
 */
#ifndef OV_PAGE_H
#define OV_PAGE_H

#include "write/scene.h"

/* A file of write/page/. The table, embedded by the build, ends with a name of NULL. */
typedef struct ov_page_source {
    const char *name;
    const char *text;
} ov_page_source;
extern const ov_page_source ov_page_sources[];

/* The scene has its fields, and the context a device. title is UTF-8. */
ovoid_status ov_write_page(ovoid_context *context, const ov_scene *scene,
                           const ovoid_export_options *options, const char *title, FILE *stream);

#endif
