#include "device/internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define PATH_SIZE 4096

bool ov_make_folders(const char *path) {
    char part[PATH_SIZE];
    size_t length = strlen(path);
    if (!length || length >= sizeof part) {
        errno = length ? ENAMETOOLONG : ENOENT;
        return false;
    }
    memcpy(part, path, length + 1);
    for (char *c = part + 1; *c; c++) {
        if (*c != '/')
            continue;
        *c = '\0';
        if (mkdir(part, 0700) != 0 && errno != EEXIST && errno != EROFS && errno != EACCES)
            return false; /* the last mkdir judges the others */
        *c = '/';
    }
    struct stat info;
    if (mkdir(part, 0700) == 0)
        return true;
    int reason = errno;
    if (stat(part, &info) == 0 && S_ISDIR(info.st_mode))
        return true;
    errno = reason;
    return false;
}

/* Whether a file can be written there, with room on the disk for a page. */
static bool can_write(const char *folder) {
    static const char page[4096];
    char path[PATH_SIZE + 32];
    if (strlen(folder) >= PATH_SIZE) {
        errno = ENAMETOOLONG;
        return false;
    }
    snprintf(path, sizeof path, "%s/ovoid-probe-XXXXXX", folder);
    int file = mkstemp(path);
    if (file < 0)
        return false;
    ssize_t written = write(file, page, sizeof page);
    int reason = written < 0 ? errno : ENOSPC;
    if (close(file) != 0 && written == (ssize_t)sizeof page) {
        written = -1;
        reason = errno;
    }
    unlink(path);
    errno = reason;
    return written == (ssize_t)sizeof page;
}

/* Whether a folder can be written, or made where it does not exist yet; makes nothing. */
static bool can_make(const char *folder) {
    char path[PATH_SIZE];
    struct stat info;
    if (strlen(folder) >= sizeof path) {
        errno = ENAMETOOLONG;
        return false;
    }
    strcpy(path, folder);
    while (stat(path, &info) != 0) {
        if ((errno != ENOENT && errno != ENOTDIR) || lstat(path, &info) == 0)
            return false; /* out of reach, or a link to nowhere */
        char *slash = strrchr(path, '/');
        if (!slash)
            strcpy(path, ".");
        else if (slash == path)
            slash[1] = '\0';
        else
            *slash = '\0';
    }
    return can_write(path);
}

/* A folder that only this user can have made: not a link, ours, closed to others. */
static bool make_private(const char *path) {
    struct stat info;
    if (mkdir(path, 0700) != 0 && errno != EEXIST)
        return false;
    return lstat(path, &info) == 0 && S_ISDIR(info.st_mode) && info.st_uid == geteuid() &&
           (info.st_mode & 077) == 0;
}

/* The folder that PoCL takes. */
static void pocl_folder(char *path, size_t size) {
    const char *own = getenv("POCL_CACHE_DIR");
    const char *cache = getenv("XDG_CACHE_HOME");
    const char *home = getenv("HOME");
    if (own)
        snprintf(path, size, "%s", own);
    else if (cache && *cache)
        snprintf(path, size, "%s/pocl/kcache", cache);
    else if (home)
        snprintf(path, size, "%s/.cache/pocl/kcache", home);
    else
        snprintf(path, size, "/tmp/pocl/kcache");
}

bool ov_private_folder(const char *base, char *path, size_t size) {
    if (!base || base[0] != '/')
        return false;
    int length = snprintf(path, size, "%s/ovoid-pocl-%ld", base, (long)geteuid());
    return length > 0 && (size_t)length < size && make_private(path) && can_write(path);
}

void ov_pocl_prepare(char *warning, size_t size) {
    char wanted[PATH_SIZE], taken[PATH_SIZE];
    warning[0] = '\0';
    const char *own = getenv("POCL_CACHE_DIR");
    if (own && !*own)
        unsetenv("POCL_CACHE_DIR");
    pocl_folder(wanted, sizeof wanted);
    if (can_make(wanted))
        return;
    const char *reason = strerror(errno);
    bool found = ov_private_folder(getenv("TMPDIR"), taken, sizeof taken) ||
                 ov_private_folder("/tmp", taken, sizeof taken) ||
                 ov_private_folder("/dev/shm", taken, sizeof taken);
    if (found && setenv("POCL_CACHE_DIR", taken, 1) == 0)
        snprintf(warning, size,
                 "PoCL's cache folder %s cannot be written (%s); it uses %s for this run", wanted,
                 reason, taken);
    else
        snprintf(warning, size,
                 "PoCL's cache folder %s cannot be written (%s) and neither can a replacement; "
                 "PoCL may show no device",
                 wanted, reason);
}
