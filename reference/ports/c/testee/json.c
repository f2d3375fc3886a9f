#include "json.h"

#include <stdlib.h>
#include <string.h>

#define MAX_NODES 100000
#define MAX_DEPTH 32

static struct json nodes[MAX_NODES];
static size_t used;

static const char *skip_space(const char *at) { return at + strspn(at, " \t\r\n"); }

/* A string behind its first quote; the text behind its last one, or NULL. */
static const char *read_string(const char *at, const char **text, size_t *length)
{
    *text = at;
    while (*at != '"') {
        if (*at == '\0' || (*at == '\\' && *++at == '\0'))
            return NULL;
        at++;
    }
    *length = (size_t)(at - *text);
    return at + 1;
}

static const char *read_value(const char *at, struct json *value, int depth);

/* The values of an object or a list behind its bracket. */
static const char *read_values(const char *at, struct json *value, char close, int depth)
{
    const struct json **link = &value->child;
    at = skip_space(at);
    if (*at == close)
        return at + 1;
    for (;;) {
        if (used == MAX_NODES)
            return NULL;
        struct json *inner = &nodes[used++];
        memset(inner, 0, sizeof *inner);
        if (close == '}') {
            at = *at == '"' ? read_string(at + 1, &inner->key, &inner->key_length) : NULL;
            if (at == NULL || *(at = skip_space(at)) != ':')
                return NULL;
            at++;
        }
        at = read_value(at, inner, depth);
        if (at == NULL)
            return NULL;
        *link = inner;
        link = &inner->next;
        value->count++;
        at = skip_space(at);
        if (*at == close)
            return at + 1;
        if (*at != ',')
            return NULL;
        at = skip_space(at + 1);
    }
}

static const char *read_value(const char *at, struct json *value, int depth)
{
    static const char *const WORDS[] = {"true", "false", "null"};
    at = skip_space(at);
    value->type = *at;
    if (depth == MAX_DEPTH)
        return NULL;
    if (*at == '{' || *at == '[')
        return read_values(at + 1, value, *at == '{' ? '}' : ']', depth + 1);
    if (*at == '"')
        return read_string(at + 1, &value->text, &value->length);
    for (size_t i = 0; i < 3; i++)
        if (strncmp(at, WORDS[i], strlen(WORDS[i])) == 0)
            return at + strlen(WORDS[i]);
    value->type = '0';
    value->text = at;
    value->length = strspn(at, "+-.0123456789eE");
    return value->length > 0 ? at + value->length : NULL;
}

const struct json *json_parse(const char *text)
{
    used = 1;
    memset(nodes, 0, sizeof *nodes);
    const char *end = read_value(text, nodes, 0);
    return end != NULL && *skip_space(end) == '\0' ? nodes : NULL;
}

const struct json *json_get(const struct json *object, const char *key)
{
    for (const struct json *value = object == NULL ? NULL : object->child; value != NULL; value = value->next)
        if (value->key != NULL && value->key_length == strlen(key) && memcmp(value->key, key, value->key_length) == 0)
            return value;
    return NULL;
}

bool json_is(const struct json *value, const char *text)
{
    return value != NULL && value->type == '"' && value->length == strlen(text) &&
           memcmp(value->text, text, value->length) == 0;
}

bool json_true(const struct json *value) { return value != NULL && value->type == 't'; }

bool json_boolean(const struct json *value, bool *result)
{
    *result = json_true(value);
    return *result || (value != NULL && value->type == 'f');
}

bool json_number(const struct json *value, double *result)
{
    if (value == NULL || value->type != '0')
        return false;
    *result = strtod(value->text, NULL);
    return true;
}

bool json_integer(const struct json *value, int64_t low, int64_t high, int64_t *result)
{
    if (value == NULL || value->type != '0')
        return false;
    char *end;
    *result = strtoll(value->text, &end, 10);
    return end == value->text + value->length && *result >= low && *result <= high;
}

/* A character of a string, moving `*at` behind it; -1: it is not one of U+0000 to U+00FF. */
static long character(const char **at, const char *end)
{
    static const char ESCAPES[] = "\"\\/bfnrt", MEANT[] = "\"\\/\b\f\n\r\t";
    unsigned char byte = (unsigned char)*(*at)++;
    if (byte == '\\' && **at == 'u' && end - *at >= 5) {
        char digits[5] = {0};
        memcpy(digits, *at + 1, 4);
        *at += 5;
        long value = strtol(digits, NULL, 16);
        return value <= 0xFF ? value : -1;
    }
    if (byte == '\\') {
        const char *escape = strchr(ESCAPES, *(*at)++);
        return escape == NULL ? -1 : MEANT[escape - ESCAPES];
    }
    if (byte < 0x80)
        return byte;
    if ((byte == 0xC2 || byte == 0xC3) && *at < end)
        return (byte & 3) << 6 | ((unsigned char)*(*at)++ & 0x3F);
    return -1;
}

long json_latin1(const struct json *value, uint8_t *out, size_t size)
{
    if (value == NULL || value->type != '"')
        return -1;
    size_t length = 0;
    for (const char *at = value->text, *end = at + value->length; at < end;) {
        long found = character(&at, end);
        if (found < 0 || length == size)
            return -1;
        out[length++] = (uint8_t)found;
    }
    return (long)length;
}

/* Four hex digits. */
static unsigned long hex4(const char *at)
{
    char digits[5] = {0};
    memcpy(digits, at, 4);
    return strtoul(digits, NULL, 16);
}

/* A code point as UTF-8; returns its length. */
static size_t put_utf8(unsigned long c, char out[4])
{
    if (c < 0x80) {
        out[0] = (char)c;
        return 1;
    }
    size_t count = c < 0x800 ? 2 : c < 0x10000 ? 3 : 4;
    for (size_t i = count; --i > 0; c >>= 6)
        out[i] = (char)(0x80 | (c & 0x3F));
    out[0] = (char)((count == 2 ? 0xC0 : count == 3 ? 0xE0 : 0xF0) | c);
    return count;
}

long json_utf8(const struct json *value, char *out, size_t size)
{
    static const char ESCAPES[] = "\"\\/bfnrt", MEANT[] = "\"\\/\b\f\n\r\t";
    size_t length = 0;
    if (value == NULL || value->type != '"')
        return -1;
    for (const char *at = value->text, *end = at + value->length; at < end;) {
        char bytes[4] = {*at++};
        size_t count = 1;
        if (bytes[0] == '\\' && *at == 'u' && end - at >= 5) {
            unsigned long c = hex4(at + 1);
            at += 5;
            if (c >= 0xD800 && c < 0xDC00 && end - at >= 6 && at[0] == '\\' && at[1] == 'u') {
                c = 0x10000 + ((c - 0xD800) << 10) + (hex4(at + 2) - 0xDC00);
                at += 6;
            }
            if (c >= 0xD800 && c < 0xE000)
                return -1;
            count = put_utf8(c, bytes);
        } else if (bytes[0] == '\\') {
            const char *escape = strchr(ESCAPES, *at++);
            if (escape == NULL)
                return -1;
            bytes[0] = MEANT[escape - ESCAPES];
        }
        if (count > size - length)
            return -1;
        memcpy(out + length, bytes, count);
        length += count;
    }
    return (long)length;
}
