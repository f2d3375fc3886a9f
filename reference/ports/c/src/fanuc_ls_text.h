/* What the files of fanuc-ls share: characters, words and lines of a text in UTF-8. */
#ifndef CELLWIRE_FANUC_LS_TEXT_H
#define CELLWIRE_FANUC_LS_TEXT_H

#include <string.h>

#include "cellwire/fanuc_ls.h"

static inline struct fanuc_ls_text between(const char *at, const char *end)
{
    struct fanuc_ls_text text = {at, (size_t)(end - at)};
    return text;
}

static inline const char *end_of(struct fanuc_ls_text text) { return text.at + text.length; }

/* The byte here; 0 at the end. */
static inline char byte_at(const char *at, const char *end) { return at < end ? *at : '\0'; }

static inline bool is_digit(char c) { return c >= '0' && c <= '9'; }

static inline bool is_one_of(char c, const char *set) { return c != '\0' && strchr(set, c) != NULL; }

static inline bool has(struct fanuc_ls_text text, char c)
{
    for (size_t i = 0; i < text.length; i++)
        if (text.at[i] == c)
            return true;
    return false;
}

/* The line that begins here, without its line feed; `*at` moves to the next one. */
struct fanuc_ls_text fanuc_ls_take_line(const char **at, const char *end);

/* The character here, and its length. */
uint32_t fanuc_ls_character(const char *at, const char *end, size_t *length);
bool fanuc_ls_is_white(uint32_t c); /* LS-55 */
const char *fanuc_ls_skip_white(const char *at, const char *end);
struct fanuc_ls_text fanuc_ls_trim(struct fanuc_ls_text text);
struct fanuc_ls_text fanuc_ls_trim_end(struct fanuc_ls_text text);
bool fanuc_ls_begins(const char *at, const char *end, const char *word);
bool fanuc_ls_to_number(struct fanuc_ls_text digits, uint64_t *value); /* false: none, or above 32 bits */
bool fanuc_ls_is_word(const char *at, const char *end); /* a letter, a digit or `_` is here */
bool fanuc_ls_is_control(uint32_t c);
const char *fanuc_ls_skip_word(const char *at, const char *end); /* what follows letters, digits and `_` */
bool fanuc_ls_is_name(struct fanuc_ls_text name);                /* of a program */
bool fanuc_ls_is_closed(struct fanuc_ls_text line);              /* it ends with `;`, white space not counted */
bool fanuc_ls_is_nested(struct fanuc_ls_text line, uint64_t last, bool in_block);
int fanuc_ls_section(struct fanuc_ls_text line); /* -1: it begins none */
bool fanuc_ls_fits(char letter, enum fanuc_ls_unit unit);
bool fanuc_ls_in_range(double speed, enum fanuc_ls_unit unit);
bool fanuc_ls_same(struct fanuc_ls_text one, struct fanuc_ls_text other);
extern const char *const FANUC_LS_UNITS[11]; /* as they are written; the last four are German */

#endif
