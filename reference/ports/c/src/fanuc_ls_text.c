#include "fanuc_ls_text.h"

struct fanuc_ls_text fanuc_ls_take_line(const char **at, const char *end)
{
    const char *begin = *at, *stop = memchr(begin, '\n', (size_t)(end - begin));
    *at = stop == NULL ? end : stop + 1;
    return between(begin, stop == NULL ? end : stop);
}

/* The character here, and its length; the text is UTF-8. */
uint32_t fanuc_ls_character(const char *at, const char *end, size_t *length)
{
    unsigned char first = (unsigned char)*at;
    size_t count = first < 0x80 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    uint32_t value = count == 1 ? first : first & (0x7Fu >> count);
    if (count > (size_t)(end - at))
        count = (size_t)(end - at);
    for (size_t i = 1; i < count; i++)
        value = value << 6 | ((unsigned char)at[i] & 0x3F);
    *length = count;
    return value;
}

/* LS-55 */
bool fanuc_ls_is_white(uint32_t c)
{
    return (c >= 9 && c <= 13) || c == ' ' || c == 0x85 || c == 0xA0 || c == 0x1680 || (c >= 0x2000 && c <= 0x200A) || c == 0x2028 ||
           c == 0x2029 || c == 0x202F || c == 0x205F || c == 0x3000;
}

static bool is_letter(uint32_t c) { return c < 0x80 ? (c | 0x20) >= 'a' && (c | 0x20) <= 'z' : !fanuc_ls_is_white(c); }

bool fanuc_ls_is_word(const char *at, const char *end)
{
    size_t length;
    return at < end && (*at == '_' || is_digit(*at) || is_letter(fanuc_ls_character(at, end, &length)));
}

const char *fanuc_ls_skip_word(const char *at, const char *end)
{
    size_t length;
    for (; fanuc_ls_is_word(at, end); at += length)
        fanuc_ls_character(at, end, &length);
    return at;
}

bool fanuc_ls_is_name(struct fanuc_ls_text name)
{
    bool is_word = fanuc_ls_skip_word(name.at, end_of(name)) == end_of(name), is_ascii = fanuc_ls_characters(name) == name.length;
    return is_word && is_ascii && byte_at(name.at, end_of(name)) > '9'; /* no digit: what else is a word is behind them */
}

bool fanuc_ls_is_control(uint32_t c) { return c < 0x20 || (c >= 0x7F && c < 0xA0); }

size_t fanuc_ls_characters(struct fanuc_ls_text text)
{
    size_t count = 0;
    for (size_t i = 0; i < text.length; i++)
        count += ((unsigned char)text.at[i] & 0xC0) != 0x80;
    return count;
}

bool fanuc_ls_begins(const char *at, const char *end, const char *word)
{
    return (size_t)(end - at) >= strlen(word) && memcmp(at, word, strlen(word)) == 0;
}

bool fanuc_ls_to_number(struct fanuc_ls_text digits, uint64_t *value)
{
    *value = 0;
    for (const char *at = digits.at; at < end_of(digits); at++) {
        if (!is_digit(*at) || *value > (UINT32_MAX - (uint64_t)(*at - '0')) / 10)
            return false;
        *value = *value * 10 + (uint64_t)(*at - '0');
    }
    return digits.length > 0;
}

/* What follows white space. */
const char *fanuc_ls_skip_white(const char *at, const char *end)
{
    size_t length;
    while (at < end && fanuc_ls_is_white(fanuc_ls_character(at, end, &length)))
        at += length;
    return at;
}

struct fanuc_ls_text fanuc_ls_trim_end(struct fanuc_ls_text text)
{
    const char *kept = text.at;
    size_t length;
    for (const char *at = text.at, *end = end_of(text); at < end; at += length)
        if (!fanuc_ls_is_white(fanuc_ls_character(at, end, &length)))
            kept = at + length;
    return between(text.at, kept);
}

bool fanuc_ls_is_closed(struct fanuc_ls_text line)
{
    uint32_t last = 0;
    size_t length;
    for (const char *at = line.at; at < end_of(line); at += length) {
        uint32_t c = fanuc_ls_character(at, end_of(line), &length);
        last = fanuc_ls_is_white(c) ? last : c;
    }
    return last == ';';
}

struct fanuc_ls_text fanuc_ls_trim(struct fanuc_ls_text text)
{
    const char *end = end_of(text);
    return fanuc_ls_trim_end(between(fanuc_ls_skip_white(text.at, end), end));
}

bool fanuc_ls_same(struct fanuc_ls_text one, struct fanuc_ls_text other)
{
    for (size_t i = 0; i < one.length && i < other.length; i++)
        if (one.at[i] != other.at[i])
            return false;
    return one.length == other.length;
}
