#include "cellwire/fanuc_ls_write.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fanuc_ls_text.h"

#define MAX_NUMBER 400 /* digits of the greatest and the least double, without an exponent */

void fanuc_ls_writer_init(struct fanuc_ls_writer *writer, char *out, size_t size, char *scratch)
{
    memset(writer, 0, sizeof *writer);
    writer->out = out;
    writer->size = size;
    writer->scratch = scratch;
}

/* Whether all is written and right, this part too. */
static bool check(struct fanuc_ls_writer *writer, bool is_right)
{
    writer->is_wrong |= !is_right;
    return !writer->is_wrong;
}

static void put_byte(struct fanuc_ls_writer *writer, char c)
{
    if (check(writer, writer->length < writer->size))
        writer->out[writer->length++] = c;
}

static void put(struct fanuc_ls_writer *writer, struct fanuc_ls_text text)
{
    for (size_t i = 0; i < text.length; i++)
        put_byte(writer, text.at[i]);
}

static void put_word(struct fanuc_ls_writer *writer, const char *word) { put(writer, between(word, word + strlen(word))); }

static void put_number(struct fanuc_ls_writer *writer, const char *format, unsigned long long number)
{
    char digits[32];
    snprintf(digits, sizeof digits, format, number);
    put_word(writer, digits);
}

/* A text with a line feed for each line that continues. */
static void put_lines(struct fanuc_ls_writer *writer, struct fanuc_ls_text text)
{
    for (size_t i = 0; i < text.length; i++)
        if (text.at[i] == '\n')
            put_word(writer, "\r\n    :  ");
        else
            put_byte(writer, text.at[i]);
}

/* No control character but these. */
static bool is_plain(struct fanuc_ls_text text, const char *allowed)
{
    size_t length;
    for (const char *at = text.at; at < end_of(text); at += length)
        if (fanuc_ls_is_control(fanuc_ls_character(at, end_of(text), &length)) && !is_one_of(*at, allowed))
            return false;
    return true;
}

/* A text of an instruction, of which no line but the last ends with a semicolon. */
static bool is_text(struct fanuc_ls_text text)
{
    for (const char *at = text.at; at < end_of(text); at++)
        if (*at == '\n' && fanuc_ls_is_closed(between(text.at, at)))
            return false;
    return is_plain(text, "\t\n");
}

/* What was written since `begin`, to be read again. */
static struct fanuc_ls_cursor written(const struct fanuc_ls_writer *writer, size_t begin)
{
    struct fanuc_ls_cursor cursor = {.at = writer->out + begin, .end = writer->out + writer->length, .scratch = writer->scratch};
    return cursor;
}

bool fanuc_ls_write_head(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, struct fanuc_ls_text kind, size_t name_limit)
{
    bool is_kind = kind.at == NULL || (kind.length > 0 && fanuc_ls_same(fanuc_ls_trim(kind), kind) && is_plain(kind, "\t"));
    put_word(writer, "/PROG  ");
    put(writer, name);
    if (kind.at != NULL) {
        put_word(writer, "\t  ");
        put(writer, kind);
    }
    put_word(writer, "\r\n");
    return check(writer, is_kind && name.length <= name_limit && fanuc_ls_is_name(name));
}

bool fanuc_ls_write_section(struct fanuc_ls_writer *writer, const char *name)
{
    put_word(writer, name);
    put_word(writer, "\r\n");
    return check(writer, true);
}

/* A comment of more characters. */
static struct fanuc_ls_text cut(struct fanuc_ls_text comment)
{
    const char *at = comment.at;
    size_t length;
    for (int i = 0; i < FANUC_LS_COMMENT_LENGTH; i++, at += length)
        fanuc_ls_character(at, end_of(comment), &length);
    return fanuc_ls_trim_end(between(comment.at, at));
}

bool fanuc_ls_write_attribute(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, struct fanuc_ls_text value, bool cut_comment)
{
    struct fanuc_ls_attribute given = {name, value, false}, again;
    struct fanuc_ls_text comment = fanuc_ls_comment(&given);
    bool is_cut = fanuc_ls_characters(comment) > FANUC_LS_COMMENT_LENGTH;
    size_t begin = writer->length, inside;
    put(writer, name);
    put_word(writer, fanuc_ls_characters(name) >= 8 ? "\t= " : "\t\t= ");
    inside = writer->length;
    if (is_cut) {
        put_word(writer, "\"");
        put(writer, cut(comment));
        put_word(writer, "\"");
        value = between(writer->out + inside, writer->out + writer->length);
    } else {
        put(writer, value);
    }
    put_word(writer, ";");
    /* The same name and value are no list, and nothing follows them. */
    struct fanuc_ls_cursor cursor = written(writer, begin);
    bool is_same = fanuc_ls_read_attribute(&cursor, &again) && fanuc_ls_same(again.name, name) && fanuc_ls_same(again.value, value);
    put_word(writer, "\r\n");
    return check(writer, is_same && (cut_comment || !is_cut));
}

bool fanuc_ls_write_list(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, const struct fanuc_ls_pair *items, size_t count)
{
    struct fanuc_ls_attribute again;
    size_t begin = writer->length, inside;
    put(writer, name);
    put_word(writer, ":  ");
    inside = writer->length;
    for (size_t i = 0; i < count; i++) {
        put_word(writer, i > 0 ? ",\r\n      " : "");
        put(writer, items[i].name);
        put_word(writer, "\t= ");
        put(writer, items[i].value);
    }
    put_word(writer, ";");
    /* The same name is a list; the same items are all of them. */
    struct fanuc_ls_cursor cursor = written(writer, begin);
    bool is_same = fanuc_ls_read_attribute(&cursor, &again) && fanuc_ls_same(again.name, name);
    cursor = written(writer, inside);
    for (size_t i = 0; is_same && i < count; i++, cursor.at++) {
        struct fanuc_ls_pair pair;
        is_same = fanuc_ls_item(&cursor, &pair.name, &pair.value) && fanuc_ls_same(pair.name, items[i].name) &&
                  fanuc_ls_same(pair.value, items[i].value);
    }
    put_word(writer, "\r\n");
    return check(writer, is_same);
}

bool fanuc_ls_write_line(struct fanuc_ls_writer *writer, struct fanuc_ls_text line)
{
    int section = fanuc_ls_section(line);
    put(writer, fanuc_ls_trim_end(line));
    put_word(writer, "\r\n");
    return check(writer, is_plain(line, "\t") && (section <= 0 || section == 2));
}

/* A number with all its digits, and without an exponent: the fewest decimals that give the same number again, and so many at least. */
static void spell(double value, int decimals, char out[MAX_NUMBER])
{
    do
        snprintf(out, MAX_NUMBER, "%.*f", decimals++, value);
    while (fabs(strtod(out, NULL) - value) > 0); /* of none that is not finite */
}

/* Takes the zero before the point out. */
static void without_zero(char *text)
{
    text += *text == '-';
    if (*text == '0')
        memmove(text, text + 1, strlen(text));
}

static void put_target(struct fanuc_ls_writer *writer, const struct fanuc_ls_target *target)
{
    if (target->kind == FANUC_LS_TARGET_OTHER) {
        put(writer, target->name);
        return;
    }
    put_number(writer, target->kind == FANUC_LS_TARGET_POSITION ? "P[%llu" : "PR[%llu", target->number);
    put_word(writer, target->name.at != NULL ? ":" : "");
    put(writer, target->name);
    put_word(writer, "]");
}

/* Whether a motion that was written is read as itself. Its letter and its numbers are: where a target is missing, or another kind of target,
 * speed or termination is read, a text is another one as well. */
static bool is_same_motion(const struct fanuc_ls_motion *one, const struct fanuc_ls_motion *other)
{
    return fanuc_ls_same(one->via.name, other->via.name) && fanuc_ls_same(one->via_options, other->via_options) &&
           fanuc_ls_same(one->target.name, other->target.name) && fanuc_ls_same(one->speed_text, other->speed_text) &&
           fanuc_ls_same(one->cnt_register, other->cnt_register) && fanuc_ls_same(one->options, other->options);
}

/* What can be said of a motion before it is written. */
static bool is_motion(const struct fanuc_ls_motion *motion)
{
    bool fits = motion->speed_kind == FANUC_LS_SPEED_NAMED || fanuc_ls_fits(motion->letter, motion->unit);
    bool is_in_range = motion->speed_kind != FANUC_LS_SPEED_FIXED || fanuc_ls_in_range(motion->speed, motion->unit);
    return fits && is_in_range && is_text(motion->via.name) && is_text(motion->via_options) && is_text(motion->target.name) &&
           is_text(motion->speed_text) && is_text(motion->cnt_register) && is_text(motion->options);
}

static void put_motion(struct fanuc_ls_writer *writer, const struct fanuc_ls_motion *motion)
{
    char letter[2] = {motion->letter, '\0'}, speed[MAX_NUMBER];
    put_word(writer, letter);
    if (motion->via.kind != FANUC_LS_TARGET_NONE) {
        put_word(writer, " ");
        put_target(writer, &motion->via);
        put_word(writer, motion->via_options.length > 0 ? " " : "");
        put(writer, motion->via_options);
        put_word(writer, "    \r\n    : ");
    }
    put_word(writer, " ");
    put_target(writer, &motion->target);
    put_word(writer, " ");
    if (motion->speed_kind == FANUC_LS_SPEED_FIXED) {
        spell(motion->speed, motion->unit == FANUC_LS_SEC ? 1 : 0, speed);
        if (motion->unit != FANUC_LS_SEC)
            without_zero(speed);
        put_word(writer, speed);
    }
    put(writer, motion->speed_text);
    if (motion->speed_kind != FANUC_LS_SPEED_NAMED)
        put_word(writer, FANUC_LS_UNITS[motion->unit]);
    if (motion->termination == FANUC_LS_FINE)
        put_word(writer, " FINE");
    else if (motion->termination == FANUC_LS_CNT)
        put_number(writer, " CNT%llu", motion->cnt);
    else if (motion->termination == FANUC_LS_CNT_REGISTER) {
        put_word(writer, " CNT ");
        put(writer, motion->cnt_register);
    }
    put_word(writer, motion->options.length > 0 ? " " : "");
    put_lines(writer, motion->options);
    put_word(writer, "   ");
}

static bool write_nested(struct fanuc_ls_writer *writer, struct fanuc_ls_text text)
{
    bool is_nested = fanuc_ls_is_nested(text, writer->last, writer->in_block);
    writer->in_block = true;
    put(writer, text);
    put_word(writer, "\r\n");
    return check(writer, is_nested && fanuc_ls_same(fanuc_ls_trim_end(text), text) && is_plain(text, ""));
}

bool fanuc_ls_write_instruction(struct fanuc_ls_writer *writer, const struct fanuc_ls_instruction *instruction)
{
    struct fanuc_ls_instruction again;
    struct fanuc_ls_text text = fanuc_ls_trim_end(instruction->text);
    bool is_right = is_text(instruction->text);
    if (instruction->kind == FANUC_LS_NESTED)
        return write_nested(writer, instruction->text);
    writer->in_block = false;
    put_number(writer, "%4llu:", ++writer->last);
    size_t begin = writer->length;
    switch (instruction->kind) {
    case FANUC_LS_MOTION:
        is_right = is_motion(&instruction->motion);
        put_motion(writer, &instruction->motion);
        break;
    case FANUC_LS_USER_FRAME:
        put_number(writer, "  UFRAME_NUM=%llu", instruction->number);
        break;
    case FANUC_LS_USER_TOOL:
        put_number(writer, "  UTOOL_NUM=%llu", instruction->number);
        break;
    case FANUC_LS_COMMENT_LINE:
        put_word(writer, "  !");
        put_lines(writer, text);
        break;
    default: /* an empty one has no text */
        put_word(writer, fanuc_ls_begins(text.at, end_of(text), "=") ? "         " : "  ");
        put_lines(writer, text);
    }
    struct fanuc_ls_cursor cursor = written(writer, begin);
    bool is_same = fanuc_ls_read_instruction(&cursor, &again) && again.kind == instruction->kind && fanuc_ls_same(again.text, text) &&
                   is_same_motion(&again.motion, &instruction->motion);
    put_word(writer, " ;\r\n");
    return check(writer, is_right && is_same);
}

bool fanuc_ls_write_position(struct fanuc_ls_writer *writer, uint32_t number, struct fanuc_ls_text name)
{
    put_number(writer, "P[%llu", number);
    if (name.at != NULL) {
        put_word(writer, ":\"");
        put(writer, name);
        put_word(writer, "\"");
    }
    put_word(writer, "]{\r\n");
    return check(writer, fanuc_ls_same(fanuc_ls_trim(name), name) && is_plain(name, "") && !has(name, '"'));
}

static void put_frame(struct fanuc_ls_writer *writer, bool is_there, uint16_t number)
{
    if (is_there)
        put_number(writer, "%llu", number);
    else
        put_word(writer, "F");
}

/* LS-39 */
static void put_coordinate(struct fanuc_ls_writer *writer, double value)
{
    char text[MAX_NUMBER];
    spell(value, 3, text);
    if (strcmp(text, "0.000") != 0)
        without_zero(text);
    for (size_t length = strlen(text); length < 10; length++)
        put_byte(writer, ' ');
    put_word(writer, text);
}

static bool put_configuration(struct fanuc_ls_writer *writer, struct fanuc_ls_text keyword, struct fanuc_ls_text text)
{
    put_word(writer, "\t");
    put(writer, keyword);
    put_word(writer, " : '");
    put(writer, text);
    put_word(writer, "',");
    return fanuc_ls_characters(keyword) >= 3 && fanuc_ls_skip_word(keyword.at, end_of(keyword)) == end_of(keyword) && is_plain(text, "") &&
           !has(text, '\'');
}

bool fanuc_ls_write_group(struct fanuc_ls_writer *writer, const struct fanuc_ls_group *group, const struct fanuc_ls_axis *axes, size_t count)
{
    bool is_right = count > 0;
    put_number(writer, "   GP%llu:\r\n\tUF : ", group->number);
    put_frame(writer, group->has_frame, group->user_frame);
    put_word(writer, ", UT : ");
    put_frame(writer, group->has_tool, group->user_tool);
    put_word(writer, ",\t");
    if (group->keyword.at != NULL)
        is_right &= put_configuration(writer, group->keyword, group->configuration);
    put_word(writer, "\r\n");
    for (size_t i = 0; i < count; i++) {
        const struct fanuc_ls_axis *axis = &axes[i];
        is_right &= !axis->is_taught || isfinite(axis->value);
        put_word(writer, i == 0 ? "\t" : i % 3 == 0 ? ",\r\n\t" : ",\t");
        put_word(writer, axis->name);
        put_word(writer, axis->name[0] == 'J' || axis->name[0] == 'E' ? "=" : " =");
        if (axis->is_taught)
            put_coordinate(writer, axis->value);
        else
            put_word(writer, "  ********");
        put_word(writer, axis->is_mm ? "  mm" : " deg");
    }
    put_word(writer, "\r\n");
    return check(writer, is_right);
}

bool fanuc_ls_write_position_end(struct fanuc_ls_writer *writer) { return fanuc_ls_write_section(writer, "};"); }
