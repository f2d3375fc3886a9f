/* Reads one JSON text into nodes of a fixed array, as far as a testee needs it. */
#ifndef CELLWIRE_JSON_H
#define CELLWIRE_JSON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A value. Its `type` is one of `{ [ " 0 t f n`; `text` is that of a string without its quotes, or of a number. */
struct json {
    char type;
    const char *text;
    size_t length;
    const char *key; /* in an object */
    size_t key_length;
    const struct json *child, *next; /* the first value inside, the next one beside it */
    size_t count;                    /* values inside */
};

/* The value of a text, valid until the next one is parsed; NULL: it is not JSON, or has too many values. */
const struct json *json_parse(const char *text);

/* A value of an object; NULL: it is not there. NULL has none. */
const struct json *json_get(const struct json *object, const char *key);

bool json_is(const struct json *value, const char *text);   /* a string */
bool json_true(const struct json *value);                   /* true; anything else is not */
bool json_boolean(const struct json *value, bool *result);  /* false: no truth value */
bool json_number(const struct json *value, double *result); /* false: no number */
bool json_integer(const struct json *value, int64_t low, int64_t high,
                  int64_t *result); /* false: none within low..=high */

/* A string whose characters are U+0000 to U+00FF, as bytes of the same numbers; -1: it has others, or does not fit. */
long json_latin1(const struct json *value, uint8_t *out, size_t size);

/* A string in UTF-8; -1: it is none, or does not fit. */
long json_utf8(const struct json *value, char *out, size_t size);

#endif
