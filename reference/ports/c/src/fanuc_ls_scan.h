/* What the readers of LS programs share: the smallest parts of a text. */
#ifndef CELLWIRE_FANUC_LS_SCAN_H
#define CELLWIRE_FANUC_LS_SCAN_H

#include <math.h>
#include <stdlib.h>

#include "fanuc_ls_text.h"

static inline bool fail(struct fanuc_ls_cursor *cursor, enum fanuc_ls_kind kind, const char *at)
{
    cursor->fault.kind = kind;
    cursor->fault.at = at;
    return false;
}

static inline char here(const struct fanuc_ls_cursor *cursor) { return byte_at(cursor->at, cursor->end); }

static inline void skip(struct fanuc_ls_cursor *cursor, const char *set)
{
    while (is_one_of(here(cursor), set))
        cursor->at++;
}

/* Moves to the first of these characters that is on the same line; false: there is none. */
static inline bool seek(struct fanuc_ls_cursor *cursor, const char *set)
{
    while (cursor->at < cursor->end && !is_one_of(*cursor->at, set) && !is_one_of(*cursor->at, "\r\n"))
        cursor->at++;
    return is_one_of(here(cursor), set);
}

static inline void space(struct fanuc_ls_cursor *cursor) { skip(cursor, " \t\r\n"); }

static inline bool take(struct fanuc_ls_cursor *cursor, const char *word)
{
    if (!fanuc_ls_begins(cursor->at, cursor->end, word))
        return false;
    cursor->at += strlen(word);
    return true;
}

static inline bool expect(struct fanuc_ls_cursor *cursor, const char *word, enum fanuc_ls_kind kind)
{
    return take(cursor, word) || fail(cursor, kind, cursor->at);
}

static inline bool spaced(struct fanuc_ls_cursor *cursor, const char *word, enum fanuc_ls_kind kind)
{
    space(cursor);
    return expect(cursor, word, kind);
}

static inline bool whole(struct fanuc_ls_cursor *cursor, uint32_t largest, enum fanuc_ls_kind kind, uint32_t *value)
{
    const char *begin = cursor->at;
    uint64_t number;
    while (is_digit(here(cursor)))
        cursor->at++;
    if (!fanuc_ls_to_number(between(begin, cursor->at), &number) || number > largest)
        return fail(cursor, kind, begin);
    *value = (uint32_t)number;
    return true;
}

/* LS-31. The characters go to the buffer for copied texts: strtod wants an end. */
static inline bool decimal(struct fanuc_ls_cursor *cursor, enum fanuc_ls_kind kind, double *value)
{
    const char *at = cursor->at;
    char *to = cursor->scratch;
    bool has_digit = false, has_point = false;
    if (is_one_of(byte_at(at, cursor->end), "+-"))
        *to++ = *at++;
    for (; is_digit(byte_at(at, cursor->end)) || (byte_at(at, cursor->end) == '.' && !has_point); at++) {
        has_digit |= *at != '.';
        has_point |= *at == '.';
        *to++ = *at;
    }
    *to = '\0';
    *value = strtod(cursor->scratch, NULL);
    if (!has_digit || !isfinite(*value))
        return fail(cursor, kind, cursor->at);
    cursor->at = at;
    return true;
}

#endif
