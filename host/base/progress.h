/*
 * How long work reports itself and is stopped: one callback of the context, asked on the way.
 *
 * A public function that may take long is begun and ended here; all that it calls asks between the
 * parts of its work, so that what lies between two questions takes a fraction of a second. Every
 * launch of a kernel asks by itself (host/device/launch.c), so work on the device needs no more;
 * loops on the host that grow with the input ask every few thousand turns.
 */
#ifndef OV_PROGRESS_H
#define OV_PROGRESS_H

#include "base/base.h"

/* Begins a public function's work in this stage, a text that stays. Inside another one's work only
 * the stage changes. Every begin needs its end, failed or not. */
void ov_progress_begin(ovoid_context *context, const char *stage);
void ov_progress_end(ovoid_context *context);

/* What began is a fit, by this method. */
void ov_progress_fit(ovoid_context *context, ovoid_method method);

/* The stage from now on; nothing of it is done. Returns the stage before. */
const char *ov_progress_stage(ovoid_context *context, const char *stage);

/* Asks whether to go on; OVOID_ERROR_CANCELLED if not. context may be NULL. */
ovoid_status ov_progress_ask(ovoid_context *context);

/* The same, with so much of the stage done; total 0: nobody knows. */
ovoid_status ov_progress_step(ovoid_context *context, uint64_t done, uint64_t total);

/* For loops that ask at every turn: the callback is asked once in this many (a power of two). */
#define OV_PROGRESS_TURNS ((uint64_t)1 << 13)

static inline ovoid_status ov_progress_turn(ovoid_context *context, uint64_t turn, uint64_t total) {
    return turn & (OV_PROGRESS_TURNS - 1) ? OVOID_OK : ov_progress_step(context, turn, total);
}

/* Makes this the state that is told from now on, but for the seconds, and asks; false: stop. */
bool ov_progress_report(ovoid_context *context, const ovoid_progress *progress);

/* For work that reports in its caller's words: asked instead of the context's callback; false
 * stops. {0} and NULL leave the question to the context. */
typedef struct ov_watch {
    bool (*go_on)(void *user);
    void *user;
} ov_watch;

ovoid_status ov_watch_ask(ovoid_context *context, const ov_watch *watch);

#endif
