/*
 * Tasks side by side: the caller's thread, and others with a context each on the same device, so
 * that it has something to do while the host works, and the host has more than one core. Which of
 * them does what, and when, changes nothing about what comes of it.
 */
#ifndef OV_HANDS_H
#define OV_HANDS_H

#include "base/base.h"

/* Never more of them, whatever is asked for. */
#define OV_HANDS_MOST 64

typedef struct ov_hands ov_hands;

/* wanted: of them, the caller among them; 0: as many as pay. There is but the caller where its
 * launches are timed or its queue is another one's. */
ovoid_status ov_hands_create(ovoid_context *context, size_t wanted, ov_hands **hands);
void ov_hands_destroy(ov_hands **hands);
size_t ov_hands_count(const ov_hands *hands);

typedef struct ov_hands_work {
    size_t count; /* tasks */
    /* Called before a task and after it, one at a time: `begin` as tasks are taken up, `commit` in
     * the order of the tasks. NULL: not called. */
    void (*begin)(size_t task, void *user);
    void (*commit)(size_t task, void *user);
    /* The task itself, of any hand below ov_hands_count(), on its context. One that failed on
     * another hand than the caller's is done again by the caller, so it is to have left nothing. */
    ovoid_status (*task)(ovoid_context *context, size_t hand, size_t task, void *user);
    void *user;
} ov_hands_work;

/* Does all tasks. The caller is asked whether to go on on its own thread alone, and told how many
 * are done. */
ovoid_status ov_hands_do(ov_hands *hands, const ov_hands_work *work);

#endif
