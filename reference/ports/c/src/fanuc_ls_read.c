/* Attributes and instructions (sections 3.2 to 3.5). */
#include "fanuc_ls_scan.h"

const char *const FANUC_LS_UNITS[11] = {"%",       "sec", "msec", "mm/sec", "cm/min", "inch/min",
                                        "deg/sec", "sek", "msek", "mm/sek", "deg/sek"};
static const enum fanuc_ls_unit GERMAN[] = {FANUC_LS_SEC, FANUC_LS_MSEC, FANUC_LS_MM_PER_SEC, FANUC_LS_DEG_PER_SEC};

static bool is_alphabetic(char c) { return (c | 0x20) >= 'a' && (c | 0x20) <= 'z'; }

/* Moves over blanks, and over line ends with the `:` that continues an instruction. */
static void joint(struct fanuc_ls_cursor *cursor)
{
    for (;;) {
        skip(cursor, " \t");
        struct fanuc_ls_cursor next = *cursor;
        skip(&next, "\r");
        if (here(&next) != '\n')
            return;
        next.at++;
        skip(&next, " \t");
        cursor->at = next.at + 1; /* behind the `:` */
    }
}

/* Letters with brackets (LS-18): all of it, and what is in the brackets. */
static bool reference(struct fanuc_ls_cursor *cursor, enum fanuc_ls_kind kind, struct fanuc_ls_text *text, struct fanuc_ls_text *inside)
{
    const char *begin = cursor->at;
    while (is_alphabetic(here(cursor)))
        cursor->at++;
    if (cursor->at == begin || !expect(cursor, "[", kind))
        return fail(cursor, kind, cursor->at);
    const char *inner = cursor->at;
    size_t depth = 0;
    for (; seek(cursor, "[]"); cursor->at++) {
        if (*cursor->at == ']' && depth == 0) {
            *inside = between(inner, cursor->at);
            *text = between(begin, ++cursor->at);
            return true;
        }
        depth += *cursor->at == '[';
        depth -= *cursor->at == ']';
    }
    return fail(cursor, FANUC_LS_BRACKET, inner);
}

/* Copies an instruction's text without the marks that continue it (LS-24). */
static struct fanuc_ls_text join_lines(struct fanuc_ls_cursor *cursor, struct fanuc_ls_text text)
{
    const char *at = text.at, *end = text.at + text.length;
    char *out = cursor->scratch;
    while (is_one_of(byte_at(at, end), "\r\n"))
        at++;
    for (bool is_first = true;; is_first = false) {
        const char *stop = memchr(at, '\n', (size_t)(end - at)), *next = stop == NULL ? NULL : stop + 1;
        stop = stop == NULL ? end : stop;
        while (is_one_of(byte_at(at, stop), " \t\r"))
            at++;
        while (stop > at && is_one_of(stop[-1], " \t\r"))
            stop--;
        if (!is_first) {
            *cursor->scratch++ = '\n';
            at++; /* the `:` */
            while (is_one_of(byte_at(at, stop), " \t"))
                at++;
        }
        memcpy(cursor->scratch, at, (size_t)(stop - at));
        cursor->scratch += stop - at;
        if (next == NULL)
            return between(out, cursor->scratch);
        at = next;
    }
}

static bool attribute_name(struct fanuc_ls_cursor *cursor, enum fanuc_ls_kind kind, struct fanuc_ls_text *name)
{
    const char *begin = cursor->at, *at = begin;
    while (at < cursor->end && !is_one_of(*at, "=:;,\r\n"))
        at++;
    *name = fanuc_ls_trim_end(between(begin, at));
    for (size_t i = 0; i < name->length; i++)
        if (is_one_of(name->at[i], " \t\""))
            return fail(cursor, kind, begin);
    if (name->length == 0)
        return fail(cursor, kind, begin);
    cursor->at = at;
    return true;
}

/* Whether a line begins that looks like the next attribute (LS-10). */
static bool begins_another(const char *at, const char *end)
{
    if (!fanuc_ls_is_word(at, end) || *at == '_' || is_digit(*at))
        return false;
    struct fanuc_ls_text line = fanuc_ls_take_line(&at, end);
    return has(line, '=') || has(line, ':');
}

/* Where a line ends a value in whose quotes it stands; NULL: it does not. */
static const char *quoted_end(struct fanuc_ls_text line, const char *ends)
{
    struct fanuc_ls_text text = fanuc_ls_trim_end(line);
    const char *last = text.at + text.length - 1, *quote = last - 1;
    bool closes = is_one_of(*last, ends) && *quote == '"' && memchr(text.at, '"', (size_t)(quote - text.at)) != NULL;
    return closes ? last : NULL;
}

/* Where a value ends (LS-10); NULL: nowhere. */
static const char *value_end(const struct fanuc_ls_cursor *cursor, const char *ends)
{
    bool quoted = false;
    const char *line = cursor->at;
    for (const char *at = cursor->at; at < cursor->end; at++) {
        if (*at == '"') {
            quoted = !quoted;
        } else if (quoted && (*at == '\r' || *at == '\n')) {
            return quoted_end(between(line, at), ends);
        } else if (!quoted && is_one_of(*at, ends)) {
            return at;
        } else if (*at == '\n') {
            if (begins_another(at + 1, cursor->end))
                return NULL;
            line = at + 1;
        }
    }
    return NULL;
}

/* Copies a value; a line end in it becomes a blank. */
static struct fanuc_ls_text join_words(struct fanuc_ls_cursor *cursor, const char *at, const char *end)
{
    char *out = cursor->scratch;
    while (at < end) {
        struct fanuc_ls_text line = fanuc_ls_trim(fanuc_ls_take_line(&at, end));
        if (line.length > 0 && cursor->scratch > out)
            *cursor->scratch++ = ' ';
        memcpy(cursor->scratch, line.at, line.length);
        cursor->scratch += line.length;
    }
    return between(out, cursor->scratch);
}

static bool attribute_value(struct fanuc_ls_cursor *cursor, const char *ends, struct fanuc_ls_text *value)
{
    const char *end = value_end(cursor, ends);
    if (end == NULL)
        return fail(cursor, FANUC_LS_ATTRIBUTE_END, cursor->at);
    *value = join_words(cursor, cursor->at, end);
    cursor->at = end;
    return true;
}

bool fanuc_ls_item(struct fanuc_ls_cursor *items, struct fanuc_ls_text *name, struct fanuc_ls_text *value)
{
    items->at = fanuc_ls_trim(between(items->at, items->end)).at;
    if (!attribute_name(items, FANUC_LS_ATTRIBUTE_VALUE, name) || !expect(items, "=", FANUC_LS_ATTRIBUTE_VALUE))
        return false;
    return attribute_value(items, ";,", value);
}

/* LS-44; the cursor is behind its `;` then. */
bool fanuc_ls_read_attribute(struct fanuc_ls_cursor *cursor, struct fanuc_ls_attribute *attribute)
{
    struct fanuc_ls_text name, value;
    if (!attribute_name(cursor, FANUC_LS_ATTRIBUTE, &attribute->name))
        return false;
    attribute->is_list = take(cursor, ":");
    if (!attribute->is_list)
        return expect(cursor, "=", FANUC_LS_ATTRIBUTE_VALUE) && attribute_value(cursor, ";", &attribute->value) &&
               expect(cursor, ";", FANUC_LS_ATTRIBUTE_END);
    const char *begin = cursor->at;
    do
        if (!fanuc_ls_item(cursor, &name, &value))
            return false;
    while (take(cursor, ","));
    /* With its line end, which may have ended the last item. */
    const char *behind = cursor->at;
    fanuc_ls_take_line(&behind, cursor->end);
    attribute->value = between(begin, behind);
    return expect(cursor, ";", FANUC_LS_ATTRIBUTE_END);
}

struct fanuc_ls_text fanuc_ls_comment(const struct fanuc_ls_attribute *attribute)
{
    struct fanuc_ls_text none = {NULL, 0}, text = attribute->value;
    static const struct fanuc_ls_text NAMES[] = {{"COMMENT", 7}, {"KOMMENTAR", 9}};
    if (attribute->is_list || (!fanuc_ls_same(attribute->name, NAMES[0]) && !fanuc_ls_same(attribute->name, NAMES[1])))
        return none;
    if (text.length > 1 && text.at[0] == '"' && text.at[text.length - 1] == '"')
        text = between(text.at + 1, text.at + text.length - 1);
    return fanuc_ls_trim_end(text);
}

/* LS-18 */
static bool read_target(struct fanuc_ls_cursor *cursor, struct fanuc_ls_target *target)
{
    struct fanuc_ls_text all, inside;
    if (!reference(cursor, FANUC_LS_TARGET, &all, &inside))
        return false;
    const char *colon = memchr(inside.at, ':', inside.length), *end = inside.at + inside.length;
    struct fanuc_ls_text digits = fanuc_ls_trim(between(inside.at, colon == NULL ? end : colon));
    struct fanuc_ls_cursor number = {.at = digits.at, .end = digits.at + digits.length};
    size_t letters = (size_t)(inside.at - all.at) - 1;
    bool is_number = whole(&number, UINT32_MAX, FANUC_LS_TARGET, &target->number) && number.at == number.end;
    target->name = all;
    target->kind = FANUC_LS_TARGET_OTHER;
    if (!is_number || all.at[0] != 'P' || letters > 2 || (letters == 2 && all.at[1] != 'R'))
        return true;
    target->kind = letters == 1 ? FANUC_LS_TARGET_POSITION : FANUC_LS_TARGET_REGISTER;
    target->name = between(NULL, NULL);
    if (colon != NULL)
        target->name = fanuc_ls_trim(between(colon + 1, end));
    return true;
}

static bool read_unit(struct fanuc_ls_cursor *cursor, enum fanuc_ls_unit *unit)
{
    for (size_t i = 0; i < 11; i++) {
        const char *begin = cursor->at;
        if (!take(cursor, FANUC_LS_UNITS[i]))
            continue;
        *unit = i < 7 ? (enum fanuc_ls_unit)i : GERMAN[i - 7];
        if (*unit == FANUC_LS_PERCENT || here(cursor) == '_' || (!fanuc_ls_is_word(cursor->at, cursor->end) && here(cursor) != '/'))
            return true;
        cursor->at = begin;
    }
    return fail(cursor, FANUC_LS_SPEED_UNIT, cursor->at);
}

/* LS-22 */
static bool read_termination(struct fanuc_ls_cursor *cursor, struct fanuc_ls_motion *motion)
{
    struct fanuc_ls_text inside;
    const char *begin = cursor->at;
    uint32_t value;
    motion->termination = FANUC_LS_NO_TERMINATION;
    if (take(cursor, "FINE")) {
        if (!fanuc_ls_is_word(cursor->at, cursor->end)) {
            motion->termination = FANUC_LS_FINE;
            return true;
        }
        cursor->at = begin;
    }
    if (!take(cursor, "CNT"))
        return true;
    joint(cursor);
    if (is_alphabetic(here(cursor))) {
        motion->termination = FANUC_LS_CNT_REGISTER;
        return reference(cursor, FANUC_LS_CONTINUOUS, &motion->cnt_register, &inside);
    }
    begin = cursor->at;
    if (!whole(cursor, 100, FANUC_LS_CONTINUOUS, &value))
        return false;
    motion->termination = FANUC_LS_CNT;
    motion->cnt = value;
    return (here(cursor) != '.' && here(cursor) != '_') || fail(cursor, FANUC_LS_CONTINUOUS, begin);
}

/* LS-19 */
static bool read_speed(struct fanuc_ls_cursor *cursor, struct fanuc_ls_motion *motion)
{
    struct fanuc_ls_text inside;
    struct fanuc_ls_cursor open = *cursor;
    if (take(&open, "...") && read_unit(&open, &motion->unit)) {
        motion->speed_kind = FANUC_LS_SPEED_REGISTER;
        motion->speed_text = between(cursor->at, cursor->at + 3);
        cursor->at = open.at;
        return true;
    }
    const char *end = cursor->at;
    while (is_alphabetic(byte_at(end, cursor->end)) || is_one_of(byte_at(end, cursor->end), "_."))
        end++;
    char behind = end < cursor->end ? *end : ' ';
    if (behind == '[') {
        motion->speed_kind = FANUC_LS_SPEED_REGISTER;
        if (!reference(cursor, FANUC_LS_SPEED, &motion->speed_text, &inside))
            return false;
        joint(cursor);
        return read_unit(cursor, &motion->unit);
    }
    struct fanuc_ls_cursor ahead = *cursor;
    struct fanuc_ls_motion found;
    if (end > cursor->at && is_one_of(behind, " \t\r\n") && read_termination(&ahead, &found) && found.termination == FANUC_LS_NO_TERMINATION) {
        motion->speed_kind = FANUC_LS_SPEED_NAMED;
        motion->speed_text = between(cursor->at, end);
        cursor->at = end;
        return true;
    }
    if (!decimal(cursor, FANUC_LS_SPEED, &motion->speed))
        return false;
    joint(cursor);
    return read_unit(cursor, &motion->unit);
}

/* LS-46, in the order of LS-35. */
static bool read_motion(struct fanuc_ls_cursor *cursor, struct fanuc_ls_motion *motion)
{
    motion->letter = *cursor->at++;
    joint(cursor);
    if (!read_target(cursor, &motion->target))
        return false;
    if (motion->letter == 'C') {
        const char *end = memchr(cursor->at, '\n', (size_t)(cursor->end - cursor->at));
        motion->via = motion->target;
        if (end != NULL) { /* LS-17 */
            motion->via_options = fanuc_ls_trim(between(cursor->at, end));
            cursor->at = end;
        }
        joint(cursor);
        if (!read_target(cursor, &motion->target))
            return false;
    }
    joint(cursor);
    if (!read_speed(cursor, motion))
        return false;
    joint(cursor);
    if (!read_termination(cursor, motion))
        return false;
    joint(cursor);
    motion->options = join_lines(cursor, between(cursor->at, cursor->end));
    return true;
}

/* What stands between the `:` and the `;` of a statement (LS-45). */
bool fanuc_ls_read_instruction(struct fanuc_ls_cursor *cursor, struct fanuc_ls_instruction *instruction)
{
    static const char *const FRAMES[] = {"UFRAME_NUM=", "UTOOL_NUM="};
    space(cursor);
    while (cursor->end > cursor->at && is_one_of(cursor->end[-1], " \t\r\n"))
        cursor->end--;
    memset(instruction, 0, sizeof *instruction);
    if (cursor->at == cursor->end)
        return true;
    if (take(cursor, "!")) {
        char *begin = cursor->scratch;
        instruction->kind = FANUC_LS_COMMENT_LINE;
        while (here(cursor) == ' ' || here(cursor) == '\t')
            *cursor->scratch++ = *cursor->at++;
        join_lines(cursor, between(cursor->at, cursor->end));
        instruction->text = between(begin, cursor->scratch);
        return true;
    }
    if (is_one_of(*cursor->at, "JLCAS") && is_one_of(byte_at(cursor->at + 1, cursor->end), " \t")) { /* LS-16 */
        instruction->kind = FANUC_LS_MOTION;
        return read_motion(cursor, &instruction->motion);
    }
    for (int i = 0; i < 2; i++) {
        struct fanuc_ls_cursor ahead = *cursor;
        uint32_t value;
        if (!take(&ahead, FRAMES[i]))
            continue;
        skip(&ahead, " \t");
        if (whole(&ahead, UINT16_MAX, FANUC_LS_NUMBER, &value) && ahead.at == ahead.end) {
            instruction->kind = i == 0 ? FANUC_LS_USER_FRAME : FANUC_LS_USER_TOOL;
            instruction->number = (uint16_t)value;
            return true;
        }
    }
    instruction->kind = FANUC_LS_OTHER;
    instruction->text = join_lines(cursor, between(cursor->at, cursor->end));
    return true;
}
