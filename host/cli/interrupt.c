#include "cli.h"

#include <signal.h>
#include <stdatomic.h>
#include <unistd.h>

static volatile sig_atomic_t deferred;
static atomic_int caught;           /* two signals may come at once, in threads of the driver */
static const char *volatile doomed; /* file to remove when killed */

static void on_signal(int number) {
    static const char text[] = "ovoid: error: interrupted\n";
    if (!deferred) {
        (void)!write(STDERR_FILENO, text, sizeof text - 1);
        _exit(128 + number);
    }
    int none = 0;
    if (atomic_compare_exchange_strong(&caught, &none, number))
        return;
    if (doomed)
        unlink(doomed);
    signal(number, SIG_DFL);
    raise(number); /* takes effect when this handler returns */
}

enum { SIGNALS = 3 };
static const int numbers[SIGNALS] = {SIGINT, SIGTERM, SIGHUP};
static bool ignored[SIGNALS]; /* by the caller */

void cli_keep_signals(void) {
    for (int i = 0; i < SIGNALS; i++) {
        struct sigaction action = {.sa_handler = ignored[i] ? SIG_IGN : on_signal,
                                   .sa_flags = SA_RESTART};
        sigemptyset(&action.sa_mask);
        sigaction(numbers[i], &action, NULL);
    }
}

void cli_catch_signals(void) {
    for (int i = 0; i < SIGNALS; i++) {
        struct sigaction action;
        ignored[i] = sigaction(numbers[i], NULL, &action) == 0 && action.sa_handler == SIG_IGN;
    }
    cli_keep_signals();
    signal(SIGPIPE, SIG_IGN);
#ifdef SIGXFSZ
    signal(SIGXFSZ, SIG_IGN);
#endif
}

void cli_defer_signals(void) {
    deferred = 1;
}

int cli_interrupted(void) {
    return caught;
}

void cli_remove_when_killed(const char *path) {
    doomed = path;
}
