#include "cli.h"

#include <signal.h>
#include <unistd.h>

static volatile sig_atomic_t caught, deferred;
static const char *volatile doomed; /* file to remove when killed */

static void on_signal(int number) {
    static const char text[] = "ovoid: error: interrupted\n";
    if (!deferred) {
        (void)!write(STDERR_FILENO, text, sizeof text - 1);
        _exit(128 + number);
    }
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
        action = (struct sigaction){.sa_handler = on_signal, .sa_flags = SA_RESTART};
        sigemptyset(&action.sa_mask);
        sigaction(numbers[i], &action, NULL);
    }
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
