/* Positions (section 3.6). */
#include "fanuc_ls_scan.h"

/* The text before a character that is on the same line. */
static bool read_until(struct fanuc_ls_cursor *cursor, const char *stop, struct fanuc_ls_text *text)
{
    const char *begin = cursor->at;
    bool is_found = seek(cursor, stop);
    *text = between(begin, cursor->at);
    return is_found;
}

/* LS-48: one position and nothing else. */
bool fanuc_ls_read_position(struct fanuc_ls_cursor *cursor, struct fanuc_ls_position *position)
{
    struct fanuc_ls_group group;
    struct fanuc_ls_axis axis;
    if (!expect(cursor, "P[", FANUC_LS_POSITION))
        return false;
    space(cursor);
    if (!whole(cursor, UINT32_MAX, FANUC_LS_POSITION, &position->number))
        return false;
    space(cursor);
    if (take(cursor, ":")) { /* LS-27 */
        space(cursor);
        const char *begin = cursor->at;
        bool quoted = take(cursor, "\"");
        if (!read_until(cursor, quoted ? "\"" : "]", &position->name))
            return fail(cursor, FANUC_LS_POSITION, begin);
        cursor->at += quoted;
        position->name = fanuc_ls_trim(position->name);
    }
    if (!spaced(cursor, "]", FANUC_LS_POSITION) || !spaced(cursor, "{", FANUC_LS_POSITION))
        return false;
    position->groups = *cursor;
    while (fanuc_ls_next_group(cursor, &group))
        for (bool is_first = true; fanuc_ls_next_axis(cursor, &axis, is_first);)
            is_first = false;
    if (cursor->fault.kind != FANUC_LS_OK || !spaced(cursor, "}", FANUC_LS_GROUP) || !spaced(cursor, ";", FANUC_LS_GROUP))
        return false;
    space(cursor);
    return fanuc_ls_trim(between(cursor->at, cursor->end)).length == 0 || fail(cursor, FANUC_LS_POSITION, cursor->at);
}

static bool read_frame(struct fanuc_ls_cursor *cursor, const char *name, bool *is_there, uint16_t *number)
{
    uint32_t value;
    if (!spaced(cursor, name, FANUC_LS_FRAMES) || !spaced(cursor, ":", FANUC_LS_FRAMES))
        return false;
    space(cursor);
    *is_there = !take(cursor, "F");
    if (*is_there) {
        if (!whole(cursor, UINT16_MAX, FANUC_LS_FRAMES, &value))
            return false;
        *number = (uint16_t)value;
    }
    return spaced(cursor, ",", FANUC_LS_FRAMES);
}

bool fanuc_ls_next_group(struct fanuc_ls_cursor *cursor, struct fanuc_ls_group *group)
{
    uint32_t value;
    if (cursor->fault.kind != FANUC_LS_OK)
        return false;
    space(cursor);
    if (!take(cursor, "GP"))
        return false;
    if (!whole(cursor, UINT8_MAX, FANUC_LS_GROUP, &value) || !spaced(cursor, ":", FANUC_LS_GROUP))
        return false;
    group->number = (uint8_t)value;
    if (!read_frame(cursor, "UF", &group->has_frame, &group->user_frame) || !read_frame(cursor, "UT", &group->has_tool, &group->user_tool))
        return false;
    space(cursor);
    const char *end = fanuc_ls_skip_word(cursor->at, cursor->end);
    group->keyword = between(cursor->at, end);
    if (fanuc_ls_characters(group->keyword) < 3) {
        group->keyword = between(NULL, NULL);
        return true;
    }
    cursor->at = end;
    if (!spaced(cursor, ":", FANUC_LS_CONFIGURATION))
        return false;
    space(cursor);
    const char *quote = cursor->at;
    if (!expect(cursor, "'", FANUC_LS_CONFIGURATION))
        return false;
    if (!read_until(cursor, "'", &group->configuration))
        return fail(cursor, FANUC_LS_CONFIGURATION, quote);
    cursor->at++;
    return spaced(cursor, ",", FANUC_LS_CONFIGURATION);
}

static bool read_axis_name(struct fanuc_ls_cursor *cursor, char name[3])
{
    char first = here(cursor), second = byte_at(cursor->at + 1, cursor->end);
    bool is_numbered = is_one_of(first, "JE") && second >= '1' && second <= '9';
    if (!is_numbered && !is_one_of(first, "XYZWPR"))
        return false;
    bool has_second = is_numbered || (first == 'R' && is_one_of(second, "XYZWPR"));
    name[0] = first;
    name[1] = has_second ? second : '\0';
    name[2] = '\0';
    cursor->at += strlen(name);
    return true;
}

bool fanuc_ls_next_axis(struct fanuc_ls_cursor *cursor, struct fanuc_ls_axis *axis, bool is_first)
{
    space(cursor);
    if (!is_first) {
        struct fanuc_ls_cursor ahead = *cursor;
        if (!take(cursor, ",") && !read_axis_name(&ahead, axis->name))
            return false;
        space(cursor);
    }
    if (!read_axis_name(cursor, axis->name))
        return fail(cursor, FANUC_LS_AXIS, cursor->at);
    if (!spaced(cursor, "=", FANUC_LS_AXIS))
        return false;
    space(cursor);
    axis->is_taught = here(cursor) != '*';
    skip(cursor, "*");
    if (axis->is_taught && !decimal(cursor, FANUC_LS_NUMBER, &axis->value))
        return false;
    space(cursor);
    axis->is_mm = !take(cursor, "deg");
    return !axis->is_mm || expect(cursor, "mm", FANUC_LS_AXIS_UNIT);
}
