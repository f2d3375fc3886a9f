/* What the readers of LS programs share: the smallest parts of a text. */
#ifndef CELLWIRE_FANUC_LS_SCAN_H
#define CELLWIRE_FANUC_LS_SCAN_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fanuc_ls_text.h"

#define MAX_DECIMAL 400

static inline bool fail(struct fanuc_ls_cursor *cursor, enum fanuc_ls_kind kind, const char *at)
{
    cursor->fault.kind = kind;
    cursor->fault.at = at;
    return false;
}

static inline char here(const struct fanuc_ls_cursor *cursor) { return cursor->at < cursor->end ? *cursor->at : '\0'; }

static inline bool is_one_of(char c, const char *set) { return c != '\0' && strchr(set, c) != NULL; }

static inline void skip(struct fanuc_ls_cursor *cursor, const char *set)
{
    while (is_one_of(here(cursor), set))
        cursor->at++;
}

static inline void space(struct fanuc_ls_cursor *cursor) { skip(cursor, " \t\r\n"); }

static inline bool take(struct fanuc_ls_cursor *cursor, const char *word)
{
    size_t length = strlen(word);
    if ((size_t)(cursor->end - cursor->at) < length || memcmp(cursor->at, word, length) != 0)
        return false;
    cursor->at += length;
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
    uint64_t number = 0;
    while (here(cursor) >= '0' && here(cursor) <= '9') {
        if (number <= UINT32_MAX)
            number = number * 10 + (uint64_t)(*cursor->at - '0');
        cursor->at++;
    }
    *value = (uint32_t)number;
    if (cursor->at > begin && number <= largest)
        return true;
    cursor->at = begin;
    return fail(cursor, kind, begin);
}

/* LS-31. Digits beyond what fits are zeros: 400 are enough for every number that is finite. */
static inline bool decimal(struct fanuc_ls_cursor *cursor, enum fanuc_ls_kind kind, double *value)
{
    char digits[MAX_DECIMAL];
    const char *at = cursor->at;
    size_t count = 0, length = 0, dropped = 0;
    bool has_point = false;
    if (at < cursor->end && (*at == '+' || *at == '-'))
        digits[length++] = *at++;
    digits[length++] = '0'; /* for all zeros before the number */
    size_t first = length;
    for (; at < cursor->end && ((*at >= '0' && *at <= '9') || (*at == '.' && !has_point)); at++) {
        has_point |= *at == '.';
        count += *at != '.';
        if (*at == '0' && length == first)
            continue;
        if (length < sizeof digits - 1)
            digits[length++] = *at;
        else
            dropped += !has_point;
    }
    digits[length] = '\0';
    if (count == 0)
        return fail(cursor, kind, cursor->at);
    *value = strtod(digits, NULL);
    if (!isfinite(*value) || (dropped > 0 && *value != 0))
        return fail(cursor, kind, cursor->at);
    cursor->at = at;
    return true;
}

#endif
