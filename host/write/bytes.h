/*
 * Binary output: little-endian values, whatever the byte order of the machine, gathered into large
 * writes. A failed write shows in the stream's error flag, which ov_output_commit() reports.
 */
#ifndef OV_BYTES_H
#define OV_BYTES_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef struct ov_bytes {
    FILE *stream;
    size_t used;
    unsigned char data[1 << 15];
} ov_bytes;

static inline void ov_bytes_flush(ov_bytes *bytes) {
    if (bytes->used && !ferror(bytes->stream))
        (void)fwrite(bytes->data, 1, bytes->used, bytes->stream);
    bytes->used = 0;
}

static inline void ov_put_u8(ov_bytes *bytes, unsigned value) {
    if (bytes->used == sizeof bytes->data)
        ov_bytes_flush(bytes);
    bytes->data[bytes->used++] = (unsigned char)value;
}

static inline void ov_put_u16(ov_bytes *bytes, unsigned value) {
    ov_put_u8(bytes, value & 0xff);
    ov_put_u8(bytes, value >> 8 & 0xff);
}

static inline void ov_put_u32(ov_bytes *bytes, uint32_t value) {
    ov_put_u16(bytes, value & 0xffff);
    ov_put_u16(bytes, value >> 16);
}

static inline void ov_put_f32(ov_bytes *bytes, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    ov_put_u32(bytes, bits);
}

static inline void ov_put_f64(ov_bytes *bytes, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    ov_put_u32(bytes, (uint32_t)(bits & UINT32_MAX));
    ov_put_u32(bytes, (uint32_t)(bits >> 32));
}

static inline void ov_put_text(ov_bytes *bytes, const char *text, size_t length) {
    for (size_t i = 0; i < length; i++)
        ov_put_u8(bytes, (unsigned char)text[i]);
}

#endif
