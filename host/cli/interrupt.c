#include "cli.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <time.h>
#include <unistd.h>

/* Work asks every few milliseconds whether to go on. What cannot ask, a driver's compiler or a
 * write that waits, is not waited for any longer than this. */
#define PATIENCE_NANOSECONDS 500000000L

static atomic_int caught; /* two signals may come at once, in threads of the driver */
static atomic_bool told;  /* that the work was interrupted */
static timer_t timer;
static bool timer_made;

/* Ends the program from a handler, and with it all that it has begun. */
static _Noreturn void leave(int number) {
    static const char text[] = "ovoid: error: interrupted\n";
    ovoid_remove_temporaries();
    if (!atomic_exchange(&told, true))
        (void)!write(STDERR_FILENO, text, sizeof text - 1);
    _exit(128 + number);
}

static void on_signal(int number) {
    const int before = errno;
    int none = 0;
    if (!atomic_compare_exchange_strong(&caught, &none, number)) /* the second one */
        leave(number);
    const struct itimerspec patience = {.it_value = {.tv_nsec = PATIENCE_NANOSECONDS}};
    if (!timer_made || timer_settime(timer, 0, &patience, NULL) != 0)
        leave(number);
    errno = before;
}

static void on_timer(int number) {
    (void)number;
    leave(caught);
}

/* A driver whose compiler the signal has reached, too, may give up. */
static void on_abort(int number) {
    if (caught)
        leave(caught);
    signal(number, SIG_DFL); /* and abort() goes on */
}

enum { SIGNALS = 3 };
static const int numbers[SIGNALS] = {SIGINT, SIGTERM, SIGHUP};
static bool ignored[SIGNALS]; /* by the caller */

static void handle(int number, void (*handler)(int)) {
    struct sigaction action = {.sa_handler = handler}; /* a call that waits ends, with EINTR */
    sigemptyset(&action.sa_mask);
    sigaction(number, &action, NULL);
}

void cli_keep_signals(void) {
    for (int i = 0; i < SIGNALS; i++)
        handle(numbers[i], ignored[i] ? SIG_IGN : on_signal);
}

void cli_catch_signals(void) {
    struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = SIGALRM};
    for (int i = 0; i < SIGNALS; i++) {
        struct sigaction action;
        ignored[i] = sigaction(numbers[i], NULL, &action) == 0 && action.sa_handler == SIG_IGN;
    }
    handle(SIGALRM, on_timer);
    handle(SIGABRT, on_abort);
    timer_made = timer_create(CLOCK_MONOTONIC, &event, &timer) == 0;
    cli_keep_signals();
    signal(SIGPIPE, SIG_IGN);
#ifdef SIGXFSZ
    signal(SIGXFSZ, SIG_IGN);
#endif
}

static bool in_any_case;

void cli_finish_in_any_case(bool on) {
    in_any_case = on;
}

bool cli_on_progress(const ovoid_progress *progress, void *user) {
    (void)user;
    cli_keep_signals();
    cli_progress_show(progress);
    return in_any_case || !caught;
}

void cli_watch(ovoid_context *context, bool quiet) {
    cli_progress_start(quiet, NULL);
    ovoid_context_on_progress(context, cli_on_progress, NULL);
}

int cli_interrupted(void) {
    return caught;
}

void cli_hush_interrupted(void) {
    atomic_store(&told, true);
}

void cli_tell_interrupted(void) {
    if (!atomic_exchange(&told, true))
        cli_error("interrupted");
}
