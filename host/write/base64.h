/*
 * Base64 (RFC 4648) of what comes piece by piece.
 */
#ifndef OV_BASE64_H
#define OV_BASE64_H

#include "write/bytes.h"

/* Starts as {.stream = ...}. */
typedef struct ov_base64 {
    FILE *stream;
    uint32_t bits;
    int held; /* bytes in bits */
} ov_base64;

/* Writes so many of the four digits that stand for three bytes, and '=' for the others. */
static inline void ov_base64_digits(ov_base64 *b, uint32_t three, int digits) {
    static const char all[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char text[4];
    for (int i = 0; i < 4; i++)
        text[i] = i < digits ? all[three >> (18 - 6 * i) & 63] : '=';
    fwrite(text, 1, 4, b->stream);
}

static inline void ov_base64_put(ov_base64 *b, const unsigned char *data, size_t size) {
    for (size_t i = 0; i < size && !ferror(b->stream); i++) {
        b->bits = b->bits << 8 | data[i];
        if (++b->held == 3) {
            ov_base64_digits(b, b->bits & 0xffffff, 4);
            b->held = 0;
        }
    }
}

static inline void ov_base64_end(ov_base64 *b) {
    if (b->held)
        ov_base64_digits(b, b->bits << (b->held == 1 ? 16 : 8) & 0xffffff, b->held + 1);
    b->held = 0;
}

static inline void ov_base64_f32(ov_base64 *b, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    const unsigned char bytes[4] = {bits & 0xff, bits >> 8 & 0xff, bits >> 16 & 0xff, bits >> 24};
    ov_base64_put(b, bytes, 4);
}

#endif
