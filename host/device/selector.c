/* Which of the devices that were found a selector names. */
#include "device/internal.h"

#include <ctype.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OV_SELECTOR_SIZE 256 /* bytes of a part of a list */

/* ---- one device --------------------------------------------------------------------------- */

static bool same_text(const char *a, const char *b) {
    while (*a && tolower((unsigned char)*a) == tolower((unsigned char)*b))
        a++, b++;
    return *a == *b;
}

static bool contains(const char *text, const char *part) {
    size_t length = strlen(part);
    for (; *text; text++) {
        size_t i = 0;
        while (i < length && tolower((unsigned char)text[i]) == tolower((unsigned char)part[i]))
            i++;
        if (i == length)
            return true;
    }
    return false;
}

/* The selector as an index below count, or count. A larger number may still be part of a name, such
 * as 4090. */
static size_t as_index(const char *selector, size_t count) {
    size_t value = 0;
    for (const char *c = selector; *c; c++) {
        if (!isdigit((unsigned char)*c))
            return count;
        value = 10 * value + (size_t)(*c - '0');
        if (value >= count)
            return count;
    }
    return value;
}

static cl_device_type as_type(const char *selector) {
    if (same_text(selector, "cpu"))
        return CL_DEVICE_TYPE_CPU;
    if (same_text(selector, "gpu"))
        return CL_DEVICE_TYPE_GPU;
    return same_text(selector, "accelerator") ? CL_DEVICE_TYPE_ACCELERATOR : 0;
}

static bool matches(const ov_device_entry *entry, cl_device_type type, const char *selector) {
    if (type)
        return (entry->type & type) != 0;
    return contains(entry->info.name, selector) || contains(entry->info.platform, selector);
}

/* The first usable entry that matches, else the first that matches, else NULL. */
static const ov_device_entry *find(const ov_device_entry *entries, size_t count,
                                   cl_device_type type, const char *selector) {
    const ov_device_entry *defective = NULL;
    for (size_t i = 0; i < count; i++) {
        if (!matches(&entries[i], type, selector))
            continue;
        if (!entries[i].defect[0])
            return &entries[i];
        if (!defective)
            defective = &entries[i];
    }
    return defective;
}

/* Hexadecimal digits, upper or lower case; *end: what follows. */
static bool read_hex(const char **text, unsigned long *value) {
    char *end;
    if (!isxdigit((unsigned char)**text))
        return false;
    *value = strtoul(*text, &end, 16);
    *text = end;
    return true;
}

/* domain:bus:device.function, the domain left out or of 4 or 8 digits: what lspci and nvidia-smi
 * print. */
static bool parse_pci(const char *text, unsigned long part[4]) {
    size_t colons = 0;
    for (const char *c = text; *c; c++)
        colons += *c == ':';
    part[0] = 0;
    if (colons == 2 && (!read_hex(&text, &part[0]) || *text++ != ':'))
        return false;
    return (colons == 1 || colons == 2) && read_hex(&text, &part[1]) && *text++ == ':' &&
           read_hex(&text, &part[2]) && *text++ == '.' && read_hex(&text, &part[3]) && !*text;
}

static bool has_pci(const ov_device_entry *entry, const char *selector) {
    unsigned long wanted[4], own[4];
    return parse_pci(selector, wanted) && parse_pci(entry->info.pci, own) &&
           memcmp(wanted, own, sizeof own) == 0;
}

/* "GPU-" and the UUID or how it begins, or the whole UUID alone. */
#define UUID_LENGTH 36
#define UUID_BEGINNING 4
static bool has_uuid(const ov_device_entry *entry, const char *selector) {
    const bool named = strlen(selector) > 4 && toupper((unsigned char)selector[0]) == 'G' &&
                       toupper((unsigned char)selector[1]) == 'P' &&
                       toupper((unsigned char)selector[2]) == 'U' && selector[3] == '-';
    const char *const digits = named ? selector + 4 : selector;
    const size_t length = strlen(digits);
    if (!entry->info.uuid[0] || length > UUID_LENGTH ||
        length < (named ? UUID_BEGINNING : UUID_LENGTH))
        return false;
    for (size_t i = 0; i < length; i++)
        if (tolower((unsigned char)digits[i]) != entry->info.uuid[i])
            return false;
    return true;
}

static const ov_device_entry *select_named(const ov_device_entry *entries, size_t count,
                                           const char *selector) {
    size_t index = as_index(selector, count);
    if (index < count)
        return &entries[index];
    for (size_t i = 0; i < count; i++)
        if (has_pci(&entries[i], selector) || has_uuid(&entries[i], selector))
            return &entries[i];
    cl_device_type type = as_type(selector);
    const ov_device_entry *entry = type ? find(entries, count, type, selector) : NULL;
    return entry ? entry : find(entries, count, 0, selector);
}

static const ov_device_entry *select_default(const ov_device_entry *entries, size_t count) {
    const ov_device_entry *first = NULL;
    for (size_t i = 0; i < count; i++) {
        if (entries[i].defect[0])
            continue;
        if (entries[i].info.type == OVOID_DEVICE_GPU)
            return &entries[i];
        if (!first)
            first = &entries[i];
    }
    return first;
}

/* ---- lists -------------------------------------------------------------------------------- */

/* What a selector names so far: places in the list of entries, each once. */
typedef struct selection {
    const ov_device_entry *entries;
    size_t count;
    size_t *chosen, chosen_count;
} selection;

static void choose(selection *s, const ov_device_entry *entry) {
    const size_t place = (size_t)(entry - s->entries);
    for (size_t n = 0; n < s->chosen_count; n++)
        if (s->chosen[n] == place)
            return;
    s->chosen[s->chosen_count++] = place;
}

/* The types of "all", "gpus" and so on; 0: the text is none of these. */
static cl_device_type as_types(const char *selector) {
    if (same_text(selector, "all"))
        return CL_DEVICE_TYPE_ALL;
    if (same_text(selector, "cpus"))
        return CL_DEVICE_TYPE_CPU;
    if (same_text(selector, "gpus"))
        return CL_DEVICE_TYPE_GPU;
    return same_text(selector, "accelerators") ? CL_DEVICE_TYPE_ACCELERATOR : 0;
}

/* All of these types that can be used; false: there are none. */
static bool select_types(selection *s, cl_device_type types) {
    bool any = false;
    for (size_t i = 0; types && i < s->count; i++) {
        if ((s->entries[i].type & types) == 0 || s->entries[i].defect[0])
            continue;
        any = true;
        choose(s, &s->entries[i]);
    }
    return any;
}

static bool select_part(selection *s, const char *name) {
    if (select_types(s, as_types(name)))
        return true;
    const ov_device_entry *const entry = select_named(s->entries, s->count, name);
    if (entry)
        choose(s, entry);
    return entry != NULL;
}

/* "0,1", "gpu, 2"; false: a part names none. */
static bool select_list(selection *s, const char *selector) {
    for (const char *part = selector; part; part = strchr(part, ',')) {
        char name[OV_SELECTOR_SIZE];
        part += *part == ',';
        part += strspn(part, " ");
        size_t length = strcspn(part, ",");
        snprintf(name, sizeof name, "%.*s", (int)length, part);
        while (length > 0 && length < sizeof name && name[length - 1] == ' ')
            name[--length] = '\0';
        if (length == 0 || length >= sizeof name || !select_part(s, name))
            return false;
    }
    return true;
}

/* The whole selector before its parts: names may have commas. */
static bool select_all(selection *s, const char *selector) {
    return select_part(s, selector) || (strchr(selector, ',') && select_list(s, selector));
}

/* ---- messages ----------------------------------------------------------------------------- */

static ovoid_status append_list(ovoid_context *context, ov_text *text,
                                const ov_device_entry *entries, size_t count) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < count && status == OVOID_OK; i++) {
        const ovoid_device_info *info = &entries[i].info;
        bool bad = entries[i].defect[0] != '\0';
        status = ov_text_print(context, text, "\n  %u: %s, %s, platform %s%s%s%s",
                               (unsigned)info->index, ov_device_type_name(info->type), info->name,
                               info->platform, bad ? " (" : "", entries[i].defect, bad ? ")" : "");
    }
    return status;
}

static ovoid_status fail_without_devices(ovoid_context *context, size_t platforms) {
    char hint[OV_VENDORS_TEXT];
    const bool hinted = ov_vendors_hint(NULL, 0, hint);
    return ov_fail(context, OVOID_ERROR_DEVICE,
                   "no OpenCL device found (%zu OpenCL platform%s installed)\n"
                   "Install an OpenCL driver: pocl-opencl-icd makes the CPU a device on Debian and "
                   "Ubuntu; a GPU needs its vendor's OpenCL driver, or mesa-opencl-icd. clinfo -l "
                   "shows what is found.%s%s",
                   platforms, platforms == 1 ? "" : "s", hinted ? "\n" : "", hint);
}

static ovoid_status fail_without_match(ovoid_context *context, const char *selector,
                                       const char *origin, const ov_device_entry *entries,
                                       size_t count) {
    ov_text text = {0};
    ovoid_status status = OVOID_OK;
    char hint[OV_VENDORS_TEXT];
    if (selector)
        OV_TRY(ov_text_print(context, &text, "no OpenCL device matches \"%s\"%s; there %s",
                             selector, origin, count == 1 ? "is:" : "are:"));
    else
        OV_TRY(ov_text_print(context, &text, "no OpenCL device can be used; there %s",
                             count == 1 ? "is:" : "are:"));
    OV_TRY(append_list(context, &text, entries, count));
    if (ov_vendors_hint(entries, count, hint))
        OV_TRY(ov_text_print(context, &text, "\n%s", hint));
    status = ov_fail(context, OVOID_ERROR_DEVICE, "%s", text.text);
cleanup:
    free(text.text);
    return status;
}

/* Once in a process: the CPU does the work, while a GPU's driver is there that is not found. */
static void tell_hint(ovoid_context *context, const ov_device_entry *entries, size_t count) {
    static atomic_flag told = ATOMIC_FLAG_INIT;
    char hint[OV_VENDORS_TEXT];
    if (context->warn && ov_vendors_hint(entries, count, hint) && !atomic_flag_test_and_set(&told))
        ov_warn(context, "%s", hint);
}

/* ---- the choice --------------------------------------------------------------------------- */

/* One that can be used, or the default one. */
static bool select_any(selection *s, const char *selector) {
    if (selector)
        return select_all(s, selector);
    const ov_device_entry *const entry = select_default(s->entries, s->count);
    if (entry)
        choose(s, entry);
    return entry != NULL;
}

static ovoid_status check_defects(ovoid_context *context, const selection *s) {
    for (size_t n = 0; n < s->chosen_count; n++) {
        const ov_device_entry *const entry = &s->entries[s->chosen[n]];
        if (entry->defect[0])
            return ov_fail(context, OVOID_ERROR_DEVICE, "device %u, %s, %s",
                           (unsigned)entry->info.index, entry->info.name, entry->defect);
    }
    return OVOID_OK;
}

ovoid_status ov_device_choose(ovoid_context *context, const char *selector,
                              const ov_device_entry *entries, size_t count, size_t platforms,
                              size_t *chosen, size_t *chosen_count) {
    selection s = {entries, count, chosen, 0};
    const char *origin = "";
    if (!selector || !*selector) {
        selector = getenv("OVOID_DEVICE");
        origin = " (from OVOID_DEVICE)";
    }
    if (selector && !*selector)
        selector = NULL;
    if (!count)
        return fail_without_devices(context, platforms);
    if (!select_any(&s, selector))
        return fail_without_match(context, selector, origin, entries, count);
    const ovoid_status status = check_defects(context, &s);
    if (status == OVOID_OK && !selector && entries[chosen[0]].info.type != OVOID_DEVICE_GPU)
        tell_hint(context, entries, count);
    *chosen_count = s.chosen_count;
    return status;
}
