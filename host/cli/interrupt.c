#include "cli.h"

#include <signal.h>
#include <unistd.h>

static volatile sig_atomic_t caught;
static const char *volatile doomed; /* file to remove when killed */

static void on_signal(int number) {
    if (!caught) {
        caught = number;
        return;
    }
    if (doomed)
        unlink(doomed);
    signal(number, SIG_DFL);
    raise(number); /* takes effect when this handler returns */
}

void cli_catch_signals(void) {
    static const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        struct sigaction action;
        if (sigaction(numbers[i], NULL, &action) != 0 || action.sa_handler == SIG_IGN)
            continue;
        /* Without SA_RESTART: a read from a terminal or pipe that waits is to end. */
        action = (struct sigaction){.sa_handler = on_signal};
        sigemptyset(&action.sa_mask);
        sigaction(numbers[i], &action, NULL);
    }
    signal(SIGPIPE, SIG_IGN);
}

int cli_interrupted(void) {
    return caught;
}

void cli_remove_when_killed(const char *path) {
    doomed = path;
}
