/* What a document finds besides faults (LS-50, LS-54). Nothing is remembered: what stands elsewhere is read again. */
#include "fanuc_ls_text.h"

bool fanuc_ls_fits(char letter, enum fanuc_ls_unit unit)
{
    return unit == FANUC_LS_SEC || unit == FANUC_LS_MSEC || (unit == FANUC_LS_PERCENT) == (letter == 'J');
}

bool fanuc_ls_in_range(double speed, enum fanuc_ls_unit unit) { return speed >= 0.001 && speed <= (unit == FANUC_LS_PERCENT ? 100 : 100000); }

static bool is(struct fanuc_ls_text text, const char *word) { return text.length == strlen(word) && memcmp(text.at, word, text.length) == 0; }

/* The number that a text begins with, behind white space. */
static bool leading_number(struct fanuc_ls_text text, uint64_t *value)
{
    const char *begin = fanuc_ls_skip_white(text.at, end_of(text)), *at = begin;
    while (is_digit(byte_at(at, end_of(text))))
        at++;
    return fanuc_ls_to_number(between(begin, at), value);
}

/* Whether an instruction names a position, or chooses any when it runs. */
static bool names(struct fanuc_ls_text text, uint64_t number)
{
    const char *end = end_of(text);
    uint64_t found;
    size_t length;
    bool is_in_word = false;
    for (const char *at = text.at; at < end; at += length) {
        if (!is_in_word && fanuc_ls_begins(at, end, "P[") && (!leading_number(between(at + 2, end), &found) || found == number))
            return true;
        is_in_word = fanuc_ls_is_word(at, end);
        fanuc_ls_character(at, end, &length);
    }
    return false;
}

/* Another reader of the same file; it overwrites copied texts, which its callers do not need. */
static struct fanuc_ls_file again(const struct fanuc_ls_file *file)
{
    struct fanuc_ls_file other = *file;
    fanuc_ls_rewind(&other);
    return other;
}

static bool is_used(const struct fanuc_ls_file *file, uint64_t number)
{
    struct fanuc_ls_file other = again(file);
    struct fanuc_ls_entry entry;
    while (fanuc_ls_next(&other, &entry))
        if (names(entry.statement, number))
            return true;
    return false;
}

/* How often a position is there, up to a place; one that cannot be read counts as the first. */
static size_t count_positions(const struct fanuc_ls_file *file, uint64_t number, const char *end)
{
    struct fanuc_ls_file other = again(file);
    struct fanuc_ls_entry entry;
    size_t count = 0;
    uint64_t found;
    while (fanuc_ls_next(&other, &entry) && (end == NULL || entry.place.at <= end)) {
        if (entry.kind != FANUC_LS_POSITION_ENTRY)
            continue;
        if (entry.fault.kind == FANUC_LS_OK)
            count += entry.position.number == number;
        else if (fanuc_ls_begins(entry.place.at, end_of(entry.place), "P[") &&
                 leading_number(between(entry.place.at + 2, end_of(entry.place)), &found) && found == number && count == 0)
            count = 1;
    }
    return count;
}

static bool goes_to(const struct fanuc_ls_motion *motion, uint64_t number)
{
    const struct fanuc_ls_target *targets[] = {&motion->via, &motion->target};
    for (int i = 0; i < 2; i++)
        if (targets[i]->kind == FANUC_LS_TARGET_POSITION && targets[i]->number == number)
            return true;
    return false;
}

/* Whether no motion before a place goes to a position. */
static bool is_first_motion(const struct fanuc_ls_file *file, uint64_t number, const char *place)
{
    struct fanuc_ls_file other = again(file);
    struct fanuc_ls_entry entry;
    while (fanuc_ls_next(&other, &entry) && entry.place.at < place)
        if (entry.fault.kind == FANUC_LS_OK && goes_to(&entry.instruction.motion, number))
            return false;
    return true;
}

/* A finding, whose numbers its caller adds. */
static struct fanuc_ls_fault *add(struct fanuc_ls_fault *found, size_t *count, enum fanuc_ls_kind kind, const char *at)
{
    struct fanuc_ls_fault *fault = found + (*count)++;
    *fault = (struct fanuc_ls_fault){.kind = kind, .at = at};
    fault->is_warning = kind != FANUC_LS_NAME_LENGTH && kind != FANUC_LS_SPEED_RANGE;
    return fault;
}

static void add_numbers(struct fanuc_ls_fault *fault, uint64_t expected, uint64_t number)
{
    fault->expected = expected;
    fault->found = number;
}

/* The numbers of statements: false, and what was expected, where one does not follow. Two in a row: none is looked at. */
static bool follows(struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, uint64_t *expected)
{
    *expected = file->last_found + 1;
    if (entry->is_nested)
        return true;
    if (!entry->has_number) {
        file->is_counted = false;
        return true;
    }
    bool is_next = entry->number == *expected;
    file->is_counted = file->is_counted && (is_next || !file->is_off);
    file->is_off = !is_next;
    file->last_found = entry->number;
    return is_next || !file->is_counted;
}

static size_t find_in_statement(struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, struct fanuc_ls_fault *found)
{
    const struct fanuc_ls_motion *motion = &entry->instruction.motion;
    size_t count = 0;
    uint64_t expected;
    if (!follows(file, entry, &expected))
        add_numbers(add(found, &count, FANUC_LS_LINE_NUMBER, entry->place.at), expected, entry->number);
    if (entry->fault.kind != FANUC_LS_OK || entry->instruction.kind != FANUC_LS_MOTION)
        return count;
    if (motion->speed_kind != FANUC_LS_SPEED_NAMED && !fanuc_ls_fits(motion->letter, motion->unit))
        add(found, &count, FANUC_LS_SPEED_UNIT, entry->body);
    else if (motion->speed_kind == FANUC_LS_SPEED_FIXED && !fanuc_ls_in_range(motion->speed, motion->unit))
        add(found, &count, FANUC_LS_SPEED_RANGE, entry->body);
    return count;
}

/* Positions that are not there; by their number. */
static size_t find_undefined(struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, struct fanuc_ls_fault *found)
{
    struct fanuc_ls_target one = entry->instruction.motion.via, other = entry->instruction.motion.target;
    bool has_one = one.kind == FANUC_LS_TARGET_POSITION, has_other = other.kind == FANUC_LS_TARGET_POSITION;
    uint32_t numbers[2] = {one.number, other.number};
    bool has[2] = {has_one, has_other && !(has_one && one.number == other.number)};
    size_t count = 0;
    if (has[0] && has[1] && numbers[0] > numbers[1]) {
        numbers[0] = other.number;
        numbers[1] = one.number;
    }
    for (int i = 0; i < 2; i++)
        if (has[i] && count_positions(file, numbers[i], NULL) == 0 && is_first_motion(file, numbers[i], entry->place.at))
            add(found, &count, FANUC_LS_UNDEFINED, entry->body)->found = numbers[i];
    return count;
}

static bool is_line_count(const struct fanuc_ls_entry *entry)
{
    return entry->fault.kind == FANUC_LS_OK && !entry->attribute.is_list &&
           (is(entry->attribute.name, "LINE_COUNT") || is(entry->attribute.name, "ZEILEN"));
}

/* Whether this LINE_COUNT is the last one, and is neither 0 nor the count of statements that have no findings. */
static bool is_miscounted(const struct fanuc_ls_file *file, const struct fanuc_ls_entry *line_count, uint64_t stated, uint64_t *count)
{
    struct fanuc_ls_file other = again(file);
    struct fanuc_ls_entry entry;
    struct fanuc_ls_fault found[FANUC_LS_MAX_FINDINGS];
    *count = 0;
    while (fanuc_ls_next(&other, &entry)) {
        if (is_line_count(&entry) && entry.place.at > line_count->place.at)
            return false;
        if (entry.kind != FANUC_LS_STATEMENT)
            continue;
        *count += !entry.is_nested;
        if (entry.fault.kind != FANUC_LS_OK || find_in_statement(&other, &entry, found) > 0)
            return false;
    }
    return stated != 0 && stated != *count;
}

static bool is_untaught(struct fanuc_ls_cursor groups)
{
    struct fanuc_ls_group group;
    struct fanuc_ls_axis axis;
    while (fanuc_ls_next_group(&groups, &group))
        while (fanuc_ls_next_axis(&groups, &axis, false))
            if (!axis.is_taught)
                return true;
    return false;
}

static size_t find_in_head(const struct fanuc_ls_file *file, const char *at, size_t name_limit, struct fanuc_ls_fault *found)
{
    size_t count = 0;
    if (!fanuc_ls_is_name(file->name))
        add(found, &count, FANUC_LS_NAME, at);
    else if (file->name.length > name_limit)
        add_numbers(add(found, &count, FANUC_LS_NAME_LENGTH, at), name_limit, file->name.length);
    return count;
}

static size_t find_in_attribute(const struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, struct fanuc_ls_fault *found)
{
    uint64_t stated = fanuc_ls_characters(fanuc_ls_comment(&entry->attribute)), lines;
    size_t count = 0;
    if (stated > FANUC_LS_COMMENT_LENGTH)
        add(found, &count, FANUC_LS_COMMENT, entry->place.at)->found = stated;
    if (is_line_count(entry) && fanuc_ls_to_number(entry->attribute.value, &stated) && is_miscounted(file, entry, stated, &lines))
        add_numbers(add(found, &count, FANUC_LS_LINE_COUNT, entry->place.at), stated, lines);
    return count;
}

static size_t find_in_position(const struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, struct fanuc_ls_fault *found)
{
    const char *at = entry->place.at;
    uint64_t number = entry->position.number;
    size_t count = 0, same = count_positions(file, number, at);
    if (same == 1 && !is_used(file, number))
        add(found, &count, FANUC_LS_UNUSED, at)->found = number;
    else if (same == 2)
        add(found, &count, FANUC_LS_REPEATED, at)->found = number;
    if (is_untaught(entry->position.groups))
        add(found, &count, FANUC_LS_UNTAUGHT, at)->found = number;
    return count;
}

size_t fanuc_ls_findings(struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, size_t name_limit,
                         struct fanuc_ls_fault found[FANUC_LS_MAX_FINDINGS])
{
    size_t count = 0;
    if (entry->kind == FANUC_LS_STATEMENT)
        count = find_in_statement(file, entry, found);
    if (entry->fault.kind != FANUC_LS_OK)
        return count;
    switch (entry->kind) {
    case FANUC_LS_HEAD:
        return find_in_head(file, entry->place.at, name_limit, found);
    case FANUC_LS_ATTRIBUTE_ENTRY:
        return find_in_attribute(file, entry, found);
    case FANUC_LS_STATEMENT:
        return count + find_undefined(file, entry, found + count);
    case FANUC_LS_POSITION_ENTRY:
        return find_in_position(file, entry, found);
    default:
        return 0;
    }
}
