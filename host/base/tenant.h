/*
 * What lives longer than a call and has memory of a context's device: a list that the context
 * keeps, so that they give that memory back before the device is closed, and know when the context
 * is gone.
 */
#ifndef OV_TENANT_H
#define OV_TENANT_H

#include "base/base.h"

typedef struct ov_tenant {
    ovoid_context *context; /* NULL once it is gone */
    struct ov_tenant *next, **place;
    void (*leave)(struct ov_tenant *tenant); /* gives back all memory of the device */
} ov_tenant;

void ov_tenant_join(ovoid_context *context, ov_tenant *tenant,
                    void (*leave)(struct ov_tenant *tenant));

/* Leaves the context's list, and gives back what it has of the device. Repeats do nothing. */
void ov_tenant_part(ov_tenant *tenant);

/* OVOID_ERROR_ARGUMENT unless it is this context's; `what` is its name, "field". */
ovoid_status ov_tenant_check(ovoid_context *context, const ov_tenant *tenant, const char *what);

/* All give back what they have of the device, which is about to be closed. */
void ov_tenants_leave(ovoid_context *context);

/* The context is about to go. */
void ov_tenants_release(ovoid_context *context);

#endif
