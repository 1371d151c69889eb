#include "base/tenant.h"

void ov_tenant_join(ovoid_context *context, ov_tenant *tenant,
                    void (*leave)(struct ov_tenant *tenant)) {
    *tenant = (ov_tenant){context, context->tenants, &context->tenants, leave};
    if (tenant->next)
        tenant->next->place = &tenant->next;
    context->tenants = tenant;
}

void ov_tenant_part(ov_tenant *tenant) {
    if (!tenant->context)
        return;
    tenant->leave(tenant);
    *tenant->place = tenant->next;
    if (tenant->next)
        tenant->next->place = tenant->place;
    *tenant = (ov_tenant){0};
}

ovoid_status ov_tenant_check(ovoid_context *context, const ov_tenant *tenant, const char *what) {
    if (tenant->context == context)
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_ARGUMENT,
                   tenant->context ? "this %s belongs to another context"
                                   : "the context of this %s is gone",
                   what);
}

void ov_tenants_leave(ovoid_context *context) {
    for (ov_tenant *tenant = context->tenants; tenant; tenant = tenant->next)
        tenant->leave(tenant);
}

void ov_tenants_release(ovoid_context *context) {
    while (context->tenants)
        ov_tenant_part(context->tenants);
}
