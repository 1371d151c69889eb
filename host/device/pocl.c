#define _GNU_SOURCE /* ST_NOEXEC */
#include "device/internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

bool ov_make_folders(const char *path) {
    char part[OV_PATH_SIZE];
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

/* What PoCL writes while it compiles all kernels, and more. */
#define ROOM ((double)(16 << 20)) /* bytes */

/* 0 is as good as not known. */
static double room_in(const char *folder) {
    struct statvfs disk;
    return statvfs(folder, &disk) == 0 ? (double)disk.f_bavail * (double)disk.f_frsize : 0.0;
}

/* PoCL loads what it has compiled as a library. */
static bool forbids_programs(const char *folder) {
    struct statvfs disk;
    return statvfs(folder, &disk) == 0 && (disk.f_flag & ST_NOEXEC);
}

/* Whether a file can be written there, with room on the disk for a page. */
static bool can_write(const char *folder) {
    static const char page[4096];
    char path[OV_PATH_SIZE + 32];
    if (strlen(folder) >= OV_PATH_SIZE) {
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

/* The folder, or that above it which exists, as it has to be made; false: out of reach. */
static bool find_existing(const char *folder, char path[OV_PATH_SIZE]) {
    struct stat info;
    if (strlen(folder) >= OV_PATH_SIZE) {
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
    return true;
}

/* What is wrong with a folder for PoCL's cache, which need not exist yet; "" when nothing is. Makes
 * nothing. *usable: it is only short of room, and what it needs may be there already. */
static void judge_folder(const char *folder, char reason[OV_POCL_REASON], bool *usable) {
    char path[OV_PATH_SIZE];
    *usable = false;
    reason[0] = '\0';
    if (folder[0] == '\0')
        snprintf(reason, OV_POCL_REASON, "its name is empty");
    else if (!find_existing(folder, path) || (!can_write(path) && errno != ENOSPC))
        snprintf(reason, OV_POCL_REASON, "cannot be written: %s", strerror(errno));
    else if (forbids_programs(path))
        snprintf(reason, OV_POCL_REASON,
                 "is on a file system that is mounted noexec, where programs cannot run");
    else if (room_in(path) < ROOM)
        snprintf(reason, OV_POCL_REASON, "is on a full disk: %.3g MiB are left",
                 room_in(path) / (1 << 20));
    *usable = reason[0] == '\0' || strstr(reason, "full disk") != NULL;
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
    return length > 0 && (size_t)length < size && make_private(path) && can_write(path) &&
           !forbids_programs(path) && room_in(path) >= ROOM;
}

static bool find_replacement(char *path, size_t size) {
    const char *const bases[] = {getenv("TMPDIR"), "/tmp", "/var/tmp", "/dev/shm"};
    for (size_t i = 0; i < sizeof bases / sizeof *bases; i++)
        if (ov_private_folder(bases[i], path, size))
            return true;
    return false;
}

/* What ovoid_prepare_process() has done. */
static char replaced[OV_POCL_TEXT];

void ovoid_prepare_process(void) {
    char wanted[OV_PATH_SIZE], taken[OV_PATH_SIZE], reason[OV_POCL_REASON];
    bool usable;
    const char *own = getenv("POCL_CACHE_DIR");
    if (own && !*own)
        unsetenv("POCL_CACHE_DIR");
    pocl_folder(wanted, sizeof wanted);
    judge_folder(wanted, reason, &usable);
    if (reason[0] && find_replacement(taken, sizeof taken) &&
        setenv("POCL_CACHE_DIR", taken, 1) == 0)
        snprintf(replaced, sizeof replaced, "PoCL's cache folder %s %s; it uses %s for this run",
                 wanted, reason, taken);
}

bool ov_pocl_usable(char *text, size_t size) {
    char wanted[OV_PATH_SIZE], reason[OV_POCL_REASON];
    bool usable;
    pocl_folder(wanted, sizeof wanted);
    judge_folder(wanted, reason, &usable);
    if (reason[0])
        snprintf(text, size, "PoCL's cache folder %s %s; POCL_CACHE_DIR can name another one",
                 wanted, reason);
    else
        snprintf(text, size, "%s", replaced);
    return usable;
}

bool ov_full_disk(char *text, size_t size) {
    char folders[2][OV_PATH_SIZE], path[OV_PATH_SIZE];
    const char *const temporary = getenv("TMPDIR");
    snprintf(folders[0], OV_PATH_SIZE, "%s", temporary && *temporary ? temporary : "/tmp");
    pocl_folder(folders[1], OV_PATH_SIZE);
    for (int i = 0; i < 2; i++)
        if (find_existing(folders[i], path) && room_in(path) < ROOM) {
            snprintf(text, size, "the disk with %s '%s' is full: %.3g MiB are left",
                     i ? "PoCL's cache folder" : "the folder for temporary files", folders[i],
                     room_in(path) / (1 << 20));
            return true;
        }
    return false;
}
