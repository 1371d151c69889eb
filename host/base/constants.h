/*
 * Numbers of a table as members of one structure. A header includes this, once for each table, that
 * has defined OV_TABLE, the name of the table's file with its quotes, which has OV_REAL(name,
 * value) for doubles and OV_COUNT(name, value) for uint32_t; OV_TYPE, the structure's name; and
 * OV_TUNED, that of the one object. A program that defines OV_TUNABLE compiles for itself whatever
 * uses the numbers, and varies them; for all others they are constants.
 */
#include <stdint.h>

typedef struct OV_TYPE {
#define OV_REAL(name, value) double name;
#define OV_COUNT(name, value) uint32_t name;
#include OV_TABLE
#undef OV_REAL
#undef OV_COUNT
} OV_TYPE;

#ifdef OV_TUNABLE
extern OV_TYPE OV_TUNED;
#else
static const OV_TYPE OV_TUNED = {
#define OV_REAL(name, value) .name = (value),
#define OV_COUNT(name, value) .name = (value),
#include OV_TABLE
#undef OV_REAL
#undef OV_COUNT
};
#endif

#undef OV_TABLE
#undef OV_TYPE
#undef OV_TUNED
