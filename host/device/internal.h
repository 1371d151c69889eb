/*
 * What the files of this room share.
 */
#ifndef OV_DEVICE_INTERNAL_H
#define OV_DEVICE_INTERNAL_H

#include "device/device.h"

/* ---- errors ------------------------------------------------------------------------------- */

/* OVOID_ERROR_MEMORY for the codes that stand for it, else OVOID_ERROR_OPENCL. */
ovoid_status ov_cl_status(cl_int code);

/* As ov_cl_fail() with the device's name given, for failures before the device is open. kernel and
 * device may be NULL. */
ovoid_status ov_cl_fail_on(ovoid_context *context, cl_int code, const char *call,
                           const char *kernel, const char *device);

/* ---- the process -------------------------------------------------------------------------- */

/* Whether this process was forked from one that had used OpenCL. Then no OpenCL call may be made,
 * nor anything released. */
bool ov_opencl_lost(void);

/* Release these, where that may be done. */
void ov_release_memory(cl_mem memory);
void ov_release_kernel(cl_kernel kernel);
void ov_release_program(cl_program program);

/* OVOID_ERROR_DEVICE where that is so. */
ovoid_status ov_opencl_check(ovoid_context *context);

/* The same, before the first call of OpenCL: from now on this process uses it. */
ovoid_status ov_opencl_begin(ovoid_context *context);

/* ---- text --------------------------------------------------------------------------------- */

/* A growing text, or bytes; {0} is an empty one. `text` is NULL or ends with a null byte. */
typedef struct ov_text {
    char *text;
    size_t length;
    size_t capacity;
} ov_text;

ovoid_status ov_text_append(ovoid_context *context, ov_text *text, const char *bytes,
                            size_t length);
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
ovoid_status
ov_text_print(ovoid_context *context, ov_text *text, const char *format, ...);

/* Appends the contents of a regular file. */
ovoid_status ov_text_read(ovoid_context *context, ov_text *text, const char *path);

/* ---- devices ------------------------------------------------------------------------------ */

typedef struct ov_device_entry {
    ovoid_device_info info;
    cl_platform_id platform;
    cl_device_id id;
    cl_device_type type; /* all bits: a simulator may be several types at once */
    char defect[96];     /* why it cannot be used, "" when it can */
} ov_device_entry;

/* Prepares the process for OpenCL once then lists all devices of all platforms.
 * *entries is to be freed; *platforms counts the platforms that answered or failed. */
ovoid_status ov_devices_list(ovoid_context *context, ov_device_entry **entries, size_t *count,
                             size_t *platforms);

/* Describes a device that the caller has found; its index is UINT32_MAX. */
ovoid_status ov_device_describe(ovoid_context *context, cl_device_id id, ov_device_entry *entry);

/* The devices that the selector names, or OVOID_DEVICE, or the default one: see
 * ovoid_context_open_device(). chosen gets their places in the list, each once, and has room for
 * all; *chosen_count is 1 or more. */
ovoid_status ov_device_choose(ovoid_context *context, const char *selector,
                              const ov_device_entry *entries, size_t count, size_t platforms,
                              size_t *chosen, size_t *chosen_count);

/* Fills in pci and uuid, which drivers tell in ways of their own, or leave them empty. */
void ov_device_identify(cl_device_id id, ovoid_device_info *info);

/* What a caller hands over with a device. */
typedef struct ov_handles {
    cl_context context;
    cl_command_queue queue;
} ov_handles;

/* What is known of a device before it is opened: what the entry says, its groups and the shape of
 * its kernels. */
ovoid_status ov_device_plan(ovoid_context *context, const ov_device_entry *entry,
                            ov_device *device);

/* Opens the device in the place of the one that was; handles NULL: with a queue of its own. */
ovoid_status ov_device_open(ovoid_context *context, const ov_device_entry *entry,
                            const ov_handles *handles);

/* "cpu", "gpu", "accelerator", "other". */
const char *ov_device_type_name(ovoid_device_type type);

#define OV_POCL_PLATFORM "Portable Computing Language"
#define OV_OCLGRIND_PLATFORM "Oclgrind"

/* PoCL 3.1 finds no device when it cannot write its own cache folder, ends the process when it
 * cannot run what it has compiled there or when the disk is full, and aborts when POCL_CACHE_DIR is
 * empty. ovoid_prepare_process() mends that; this says what is so now. False: PoCL had better not
 * be used. Writes a line for users of PoCL to text (OV_POCL_TEXT bytes),
 * "" when there is nothing to say. */
bool ov_pocl_usable(char *text, size_t size);

#define OV_PATH_SIZE 4096
#define OV_POCL_REASON 128 /* bytes of what is wrong with a folder */
#define OV_POCL_TEXT (2 * OV_PATH_SIZE + 512)

/* Whether a driver that failed to compile may have met a full disk: text (OV_POCL_TEXT bytes) says
 * where. */
bool ov_full_disk(char *text, size_t size);

/* Makes, or finds, the folder <base>/ovoid-pocl-<user id> that nobody else can have made or can
 * reach. False when base is no absolute path, or what is there is another's, open to others, a
 * link, full, or cannot be written, or when programs cannot run there. */
bool ov_private_folder(const char *base, char *path, size_t size);

/* Creates a folder and those above it, mode 0700 each. False with errno when that fails. */
bool ov_make_folders(const char *path);

/* ---- trust -------------------------------------------------------------------------------- */

/* At a device's first kernel: the short self-test, unless it is remembered that this device, driver
 * and library passed it, or OVOID_SELFTEST=off. OVOID_ERROR_DEVICE where it finds an error, now and
 * whenever asked again. */
ovoid_status ov_device_trust(ovoid_context *context, ov_device *device);

/* ---- drivers without a vendors file ------------------------------------------------------- */

/* A line about a GPU's driver that is installed, while none of `count` devices is its platform's:
 * what to write where, or where to look. False, and text "", where there is nothing to say. */
#define OV_VENDORS_TEXT 1024
bool ov_vendors_hint(const ov_device_entry *entries, size_t count, char text[OV_VENDORS_TEXT]);

/* ---- pool --------------------------------------------------------------------------------- */

/* Buffers kept for the next that need one (pool.c). Those in use hold on to the pool, and are
 * released for good once the device is gone. */

/* NULL with an error where there is no room. memory: the device's, bytes. OVOID_POOL=off makes a
 * pool that keeps nothing. */
ov_pool *ov_pool_create(ovoid_context *context, uint64_t memory);

/* Releases what is kept; the device is gone. pool may be NULL. */
void ov_pool_close(ov_pool *pool);

/* Releases what is kept, for its memory to serve others; whether there was any. */
bool ov_pool_empty(ov_pool *pool);

/* The size that a buffer of so many bytes is to have, for others to fit into it later. */
size_t ov_pool_size(const ov_pool *pool, size_t bytes);

/* Finds a kept buffer of at least so many bytes and not many more; false: there is none. */
bool ov_pool_take(ov_pool *pool, size_t bytes, ov_buffer *buffer);

/* Makes a buffer of new memory. */
void ov_pool_own(ov_pool *pool, cl_mem memory, size_t bytes, ov_buffer *buffer);

/* Takes a buffer back, which is not to be used any more. The queue is in order: what still works on
 * it ends before whatever the next owner asks for. */
void ov_pool_put(ov_buffer *buffer);

/* ---- the caller's queue ------------------------------------------------------------------- */

bool ov_queue_is_timed(cl_command_queue queue);

/* ---- profile ------------------------------------------------------------------------------ */

/* What ovoid_context_profile() asks for. Each launch leaves an event; events are read where the
 * host waits for the device anyway, and at the latest when so many have come together. */
#define OV_PROFILE_PENDING 4096
typedef struct ov_profile ov_profile;

/* Counts the device's launches from now on, beginning with none. A driver without times leaves the
 * counts. */
ovoid_status ov_profile_start(ovoid_context *context, ov_device *device);

/* Before a launch: makes room for it, and says whether it is to leave an event. Nothing to do, and
 * no event, where launches are not counted. */
ovoid_status ov_profile_prepare(ovoid_context *context, ov_device *device, bool *timed);

/* After it: takes over the event, NULL for none. `name` is a string constant. */
void ov_profile_add(ov_device *device, const char *name, cl_event event);

/* Waits for the launches and adds up their times. */
ovoid_status ov_profile_drain(ovoid_context *context, ov_device *device);

void ov_profile_release(ov_device *device);

/* ---- programs ----------------------------------------------------------------------------- */

typedef struct ov_source {
    const char *name; /* file name below kernels/ */
    const char *text;
} ov_source;

/* The embedded kernel sources, ended by a NULL name; made by cmake/EmbedTexts.cmake. */
extern const ov_source ov_sources[];

/* Options of every build of the device's programs. */
#define OV_OPTIONS_SIZE 160
void ov_program_options(const ov_device *device, char options[OV_OPTIONS_SIZE]);

/* Appends platform, device and driver, names and versions, each with its null byte. Fails where a
 * driver does not tell. */
ovoid_status ov_device_key(const ov_device *device, ov_text *key);

/* Appends the sources of all kernels. */
ovoid_status ov_whole_source(ov_text *text);

/* Releases all programs of the device, and their kernels. */
void ov_programs_release(ov_device *device);

/* The cache of compiled programs, and of self-tests passed: one file <program>-<hash of key>.bin
 * each, which holds the whole key and a checksum, so that neither a collision nor a damaged file
 * can pass for a program. The key is everything that the binary depends on. */

/* Whether OVOID_CACHE ("off", "on" or "auto") and the driver call for the cache. "auto" leaves it
 * to drivers that have their own. An unknown value is worth a warning and counts as "auto". */
bool ov_cache_wanted(ovoid_context *context, ov_device *device);

/* Reads the binary kept under the key into `binary`. False when there is none that is whole. */
bool ov_cache_read(const char *program, const ov_text *key, ov_text *binary);

/* Keeps a binary. Failing costs speed alone: it is worth one warning per device. */
void ov_cache_write(ovoid_context *context, ov_device *device, const char *program,
                    const ov_text *key, const unsigned char *binary, size_t bytes);

#endif
