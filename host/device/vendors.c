/* Drivers that are installed without the file by which the OpenCL loader finds them: so it often is
 * in containers, into which a GPU's libraries were brought from outside. Looked for among the files
 * alone: opening a driver's library would run it. */
#include "device/internal.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct driver {
    const char *vendor;   /* as the message has it */
    const char *platform; /* part of its platform's name */
    const char *library, *icd;
    const char *node; /* by which its devices are reached; a container has to let it in */
} driver;

static const driver drivers[] = {
    {"NVIDIA", "NVIDIA", "libnvidia-opencl.so.1", "nvidia.icd", "/dev/nvidiactl"},
    {"AMD", "AMD", "libamdocl64.so", "amdocl64.icd", "/dev/kfd"},
    {"Intel", "Intel(R) OpenCL Graphics", "libigdrcl.so", "intel.icd", "/dev/dri"},
};

/* ---- the library -------------------------------------------------------------------------- */

static bool exists(const char *folder, size_t length, const char *name, char path[OV_PATH_SIZE]) {
    const int written = snprintf(path, OV_PATH_SIZE, "%.*s/%s", (int)length, folder, name);
    return length > 0 && written > 0 && written < OV_PATH_SIZE && access(path, R_OK) == 0;
}

/* Where containers and distributions put such libraries, after LD_LIBRARY_PATH. */
static bool find_library(const char *name, char path[OV_PATH_SIZE]) {
    static const char *const folders[] = {"/usr/lib/x86_64-linux-gnu",
                                          "/usr/lib/aarch64-linux-gnu",
                                          "/usr/lib64",
                                          "/usr/lib",
                                          "/usr/local/nvidia/lib64",
                                          "/usr/local/lib",
                                          "/usr/lib/x86_64-linux-gnu/intel-opencl",
                                          "/opt/rocm/lib",
                                          "/usr/lib/wsl/lib",
                                          "/.singularity.d/libs"};
    const char *own = getenv("LD_LIBRARY_PATH");
    while (own && *own) {
        const size_t length = strcspn(own, ":");
        if (exists(own, length, name, path))
            return true;
        own += length + (own[length] == ':');
    }
    for (size_t k = 0; k < sizeof folders / sizeof *folders; k++)
        if (exists(folders[k], strlen(folders[k]), name, path))
            return true;
    return false;
}

/* ---- the vendors file --------------------------------------------------------------------- */

static bool names(const char *path, const char *library) {
    char line[OV_PATH_SIZE] = "";
    FILE *const file = fopen(path, "r");
    if (!file)
        return false;
    if (!fgets(line, sizeof line, file))
        line[0] = '\0';
    fclose(file);
    return strstr(line, library) != NULL;
}

static bool has_icd_end(const char *name) {
    const size_t length = strlen(name);
    return length > 4 && strcmp(name + length - 4, ".icd") == 0;
}

/* The folder, or the one file, where the loaders look. */
static bool find_icd(const char *library, char path[OV_PATH_SIZE]) {
    const char *const wish = getenv("OCL_ICD_VENDORS");
    const char *const place = wish && *wish ? wish : "/etc/OpenCL/vendors";
    bool found = false;
    struct dirent *entry;
    DIR *const folder = opendir(place);
    snprintf(path, OV_PATH_SIZE, "%s", place);
    while (folder && !found && (entry = readdir(folder))) {
        const int written = snprintf(path, OV_PATH_SIZE, "%s/%s", place, entry->d_name);
        found = written > 0 && written < OV_PATH_SIZE && has_icd_end(entry->d_name) &&
                names(path, library);
    }
    if (folder)
        closedir(folder);
    else if (!found)
        found = has_icd_end(place) && names(place, library);
    return found;
}

/* ---- what to say -------------------------------------------------------------------------- */

static bool has_platform(const ov_device_entry *entries, size_t count, const char *part) {
    for (size_t i = 0; i < count; i++)
        if (strstr(entries[i].info.platform, part))
            return true;
    return false;
}

/* What the loader of Khronos reads as well, and ocl-icd 2.3.1 does not. */
static bool is_in_filenames(const char *library) {
    const char *const list = getenv("OCL_ICD_FILENAMES");
    return list && strstr(list, library);
}

static void say(const driver *own, const char *library, char text[OV_VENDORS_TEXT]) {
    char icd[OV_PATH_SIZE];
    if (find_icd(own->library, icd))
        snprintf(text, OV_VENDORS_TEXT,
                 "%s's OpenCL driver, %.400s, is installed and %.300s names it, but it offers no "
                 "device: %s %s",
                 own->vendor, library, icd, own->node,
                 access(own->node, F_OK) == 0
                     ? "is there, so its kernel module may not fit the library"
                     : "is missing, by which it reaches one (in a container: let the GPU in)");
    else
        snprintf(
            text, OV_VENDORS_TEXT,
            "%s's OpenCL driver is installed, but no vendors file names it%s, so that it is not "
            "found: write the line %.400s into the file /etc/OpenCL/vendors/%s, or into a "
            "file of that name in a folder of your own and set OCL_ICD_VENDORS to that folder",
            own->vendor,
            is_in_filenames(own->library)
                ? " (OCL_ICD_FILENAMES does, which not every loader reads)"
                : "",
            library, own->icd);
}

bool ov_vendors_hint(const ov_device_entry *entries, size_t count, char text[OV_VENDORS_TEXT]) {
    char library[OV_PATH_SIZE];
    text[0] = '\0';
    for (size_t k = 0; k < sizeof drivers / sizeof *drivers; k++) {
        if (has_platform(entries, count, drivers[k].platform) ||
            !find_library(drivers[k].library, library))
            continue;
        say(&drivers[k], library, text);
        return true;
    }
    return false;
}
