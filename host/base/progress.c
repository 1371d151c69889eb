#include "base/progress.h"

#include <math.h>

void ovoid_context_on_progress(ovoid_context *context, ovoid_progress_fn fn, void *user) {
    if (!context)
        return;
    context->progress = fn;
    context->progress_user = user;
}

static const char *stage_of(const ovoid_context *context) {
    return context->now.stage ? context->now.stage : "";
}

void ov_progress_begin(ovoid_context *context, const char *stage) {
    if (!context)
        return;
    if (context->works++ == 0) {
        context->now = (ovoid_progress){0};
        context->fitting = 0;
        context->began = ov_seconds();
    }
    ov_progress_stage(context, stage);
}

void ov_progress_end(ovoid_context *context) {
    if (context && --context->works == 0)
        context->now = (ovoid_progress){0};
}

const char *ov_progress_stage(ovoid_context *context, const char *stage) {
    if (!context)
        return stage;
    const char *const before = stage_of(context);
    context->now.stage = stage;
    context->now.done = context->now.total = 0;
    return before;
}

void ov_progress_fit(ovoid_context *context, ovoid_method method) {
    context->fitting = 1 + (int)method;
}

/* What is unknown is 0 within the library, and has marks of its own in the interface. */
static void mark_unknown(const ovoid_context *context, ovoid_progress *told) {
    static const ovoid_l1_progress no_l1 = {NAN, NAN, NAN, NAN, NAN, NAN, NAN};
    told->method = context->fitting - 1;
    if (told->total == 0)
        told->total = OVOID_UNKNOWN;
    if (told->iterations == 0)
        told->iterations = OVOID_UNKNOWN;
    if (told->method != OVOID_METHOD_L1 || told->iteration == 0)
        told->l1 = no_l1;
    if (told->method != OVOID_METHOD_ADAPTIVE || told->iteration == 0)
        told->adaptive.misfit = NAN;
}

static bool ask(ovoid_context *context) {
    if (!context->progress)
        return true;
    ovoid_progress told = context->now; /* a copy: it is the caller's to read, not to change */
    told.size = sizeof told;
    told.stage = stage_of(context);
    told.seconds = context->works ? ov_seconds() - context->began : 0.0;
    mark_unknown(context, &told);
    ++context->calling;
    const bool go_on = context->progress(&told, context->progress_user);
    --context->calling;
    return go_on;
}

static ovoid_status stopped(ovoid_context *context) {
    const char *const stage = stage_of(context);
    return ov_fail(context, OVOID_ERROR_CANCELLED, "stopped by the progress callback%s%s%s",
                   stage[0] ? " (stage '" : "", stage, stage[0] ? "')" : "");
}

ovoid_status ov_progress_ask(ovoid_context *context) {
    if (!context || ask(context))
        return OVOID_OK;
    return stopped(context);
}

ovoid_status ov_progress_step(ovoid_context *context, uint64_t done, uint64_t total) {
    if (context) {
        context->now.done = done;
        context->now.total = total;
    }
    return ov_progress_ask(context);
}

bool ov_progress_report(ovoid_context *context, const ovoid_progress *progress) {
    if (!context)
        return true;
    context->now = *progress;
    return ask(context);
}

ovoid_status ov_watch_ask(ovoid_context *context, const ov_watch *watch) {
    if (!watch || !watch->go_on)
        return ov_progress_ask(context);
    if (watch->go_on(watch->user))
        return OVOID_OK;
    return stopped(context);
}
