/* What the testee needs of a link. */
#ifndef CELLWIRE_LINK_H
#define CELLWIRE_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "json.h"

#define MAX_FRAME 4096

/* Adds to the answer, as printf does. */
void print(const char *format, ...);

struct link {
    const char *name;
    /* Begins with `from` and `options` of a request; false: they are not implemented. */
    bool (*begin)(const struct json *request);
    size_t (*push)(const uint8_t *data, size_t size);
    void (*end)(void);
    /* Prints the next item, by print_item and then `"message":…` or `"error":…`; false: there is none. */
    bool (*next)(bool ended);
    /* The bytes of a message; 0: refused. */
    size_t (*encode)(const struct json *message, uint8_t *out, size_t size);
};

/* Begins the object of an item, with `"end":true` if `ended`. */
void print_item(uint64_t offset, size_t length, bool ended);

/* Prints a list of integers. */
#define PRINT_LIST(values, count)                             \
    do {                                                      \
        print("[");                                           \
        for (size_t i_ = 0; i_ < (size_t)(count); i_++)       \
            print("%s%ld", i_ > 0 ? "," : "", (long)(values)[i_]); \
        print("]");                                           \
    } while (0)

/* Reads a list of exactly `count` integers within low..=high; false: it is none. */
bool read_list(const struct json *list, size_t count, int64_t low, int64_t high, int64_t *values);

extern const struct link FANUC_HMI_MODBUS, ISRA_BALL, KAWASAKI_MSG, LASER_EB90, MMACELL_PROTO, VAL2_ALTER, VAL2_VIEWER;

#endif
