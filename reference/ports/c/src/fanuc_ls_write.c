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

static struct fanuc_ls_text text_of(const char *word)
{
    struct fanuc_ls_text text = {word, strlen(word)};
    return text;
}

static void put(struct fanuc_ls_writer *writer, struct fanuc_ls_text text)
{
    if (text.length > writer->size - writer->length) {
        writer->is_full = true;
        return;
    }
    if (text.length > 0)
        memcpy(writer->out + writer->length, text.at, text.length);
    writer->length += text.length;
}

static void put_word(struct fanuc_ls_writer *writer, const char *word) { put(writer, text_of(word)); }

static void put_number(struct fanuc_ls_writer *writer, const char *format, unsigned long long number)
{
    char digits[32];
    snprintf(digits, sizeof digits, format, number);
    put_word(writer, digits);
}

/* A text with a line feed for each line that continues. */
static void put_lines(struct fanuc_ls_writer *writer, struct fanuc_ls_text text)
{
    for (size_t i = 0; i < text.length; i++) {
        struct fanuc_ls_text one = {text.at + i, 1};
        if (text.at[i] == '\n')
            put_word(writer, "\r\n    :  ");
        else
            put(writer, one);
    }
}

/* No control character but tab, and LF where lines are allowed. */
static bool is_line(struct fanuc_ls_text text, bool lines)
{
    const char *end = text.at + text.length;
    for (const char *at = text.at; at < end; at++)
        if (((unsigned char)*at & 0xC0) != 0x80 && *at != '\t' && !(lines && *at == '\n') && fanuc_ls_is_control(at, end))
            return false;
    return true;
}

/* Such a text, of which no line but the last ends with a semicolon. */
static bool is_plain(struct fanuc_ls_text text)
{
    const char *begin = text.at, *end = text.at + text.length, *stop;
    for (; begin < end && (stop = memchr(begin, '\n', (size_t)(end - begin))) != NULL; begin = stop + 1) {
        struct fanuc_ls_text line = {begin, (size_t)(stop - begin)};
        line = fanuc_ls_trim_end(line);
        if (line.length > 0 && line.at[line.length - 1] == ';')
            return false;
    }
    return is_line(text, true);
}

static bool has(struct fanuc_ls_text text, char c) { return text.length > 0 && memchr(text.at, c, text.length) != NULL; }

/* What was written since `begin`, to be read again. */
static struct fanuc_ls_cursor written(const struct fanuc_ls_writer *writer, size_t begin)
{
    struct fanuc_ls_cursor cursor = {writer->out + begin, writer->out + writer->length, writer->scratch, {FANUC_LS_OK, NULL, false, 0, 0}};
    return cursor;
}

bool fanuc_ls_write_head(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, struct fanuc_ls_text kind, size_t name_limit)
{
    for (size_t i = 0; i < name.length; i++)
        if ((unsigned char)name.at[i] > 0x7F || !fanuc_ls_is_word(name.at + i, name.at + name.length))
            return false;
    if (name.length == 0 || (name.at[0] >= '0' && name.at[0] <= '9') || name.length > name_limit)
        return false;
    if (kind.at != NULL && (kind.length == 0 || !fanuc_ls_same(fanuc_ls_trim(kind), kind) || !is_line(kind, false)))
        return false;
    put_word(writer, "/PROG  ");
    put(writer, name);
    if (kind.at != NULL) {
        put_word(writer, "\t  ");
        put(writer, kind);
    }
    put_word(writer, "\r\n");
    return !writer->is_full;
}

bool fanuc_ls_write_section(struct fanuc_ls_writer *writer, const char *name)
{
    put_word(writer, name);
    put_word(writer, "\r\n");
    return !writer->is_full;
}

bool fanuc_ls_write_attribute(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, struct fanuc_ls_text value, bool cut_comment)
{
    struct fanuc_ls_attribute given = {name, value, false}, again;
    struct fanuc_ls_text comment = fanuc_ls_comment(&given);
    bool is_cut = fanuc_ls_characters(comment) > FANUC_LS_COMMENT_LENGTH;
    if (is_cut && !cut_comment)
        return false;
    size_t begin = writer->length, inside;
    put(writer, name);
    put_word(writer, fanuc_ls_characters(name) >= 8 ? "\t= " : "\t\t= ");
    inside = writer->length;
    if (is_cut) {
        while (fanuc_ls_characters(comment) > FANUC_LS_COMMENT_LENGTH)
            comment.length--;
        while (comment.at[comment.length] != '\0' && ((unsigned char)comment.at[comment.length] & 0xC0) == 0x80)
            comment.length++;
        put_word(writer, "\"");
        put(writer, fanuc_ls_trim_end(comment));
        put_word(writer, "\"");
        value.at = writer->out + inside;
        value.length = writer->length - inside;
    } else {
        put(writer, value);
    }
    put_word(writer, ";");
    struct fanuc_ls_cursor cursor = written(writer, begin);
    bool same = !writer->is_full && fanuc_ls_read_attribute(&cursor, &again) && cursor.at == cursor.end && !again.is_list &&
                fanuc_ls_same(again.name, name) && fanuc_ls_same(again.value, value);
    put_word(writer, "\r\n");
    return same && !writer->is_full;
}

bool fanuc_ls_write_list(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, const struct fanuc_ls_pair *items, size_t count)
{
    struct fanuc_ls_attribute again;
    size_t begin = writer->length;
    put(writer, name);
    put_word(writer, ":  ");
    for (size_t i = 0; i < count; i++) {
        put_word(writer, i > 0 ? ",\r\n      " : "");
        put(writer, items[i].name);
        put_word(writer, "\t= ");
        put(writer, items[i].value);
    }
    put_word(writer, ";");
    struct fanuc_ls_cursor cursor = written(writer, begin);
    if (writer->is_full || !fanuc_ls_read_attribute(&cursor, &again) || cursor.at != cursor.end || !again.is_list || !fanuc_ls_same(again.name, name))
        return false;
    struct fanuc_ls_cursor list = {again.value.at, again.value.at + again.value.length, writer->scratch, {FANUC_LS_OK, NULL, false, 0, 0}};
    for (size_t i = 0; i < count; i++, list.at++) {
        struct fanuc_ls_pair pair;
        list.scratch = writer->scratch;
        if (!fanuc_ls_item(&list, &pair.name, &pair.value) || !fanuc_ls_same(pair.name, items[i].name) ||
            !fanuc_ls_same(pair.value, items[i].value) || list.at >= list.end)
            return false;
    }
    put_word(writer, "\r\n");
    return list.at == list.end && !writer->is_full;
}

bool fanuc_ls_write_line(struct fanuc_ls_writer *writer, struct fanuc_ls_text line)
{
    int section = fanuc_ls_section(line);
    if (!is_line(line, false) || !(section < 0 || section == 0 || section == 2))
        return false;
    put(writer, fanuc_ls_trim_end(line));
    put_word(writer, "\r\n");
    return !writer->is_full;
}

/* A number with all its digits, and without an exponent: the fewest that give the same number again. */
static void plain(double value, char out[MAX_NUMBER])
{
    char text[40], digits[40];
    int precision = 0, exponent, count = 0;
    do
        snprintf(text, sizeof text, "%.*e", precision, fabs(value));
    while (strtod(text, NULL) != fabs(value) && ++precision < 17);
    exponent = atoi(strchr(text, 'e') + 1);
    for (const char *at = text; *at != 'e'; at++)
        if (*at != '.')
            digits[count++] = *at;
    char *to = out;
    if (signbit(value))
        *to++ = '-';
    if (exponent < 0)
        *to++ = '0';
    for (int i = exponent < 0 ? exponent : 0; i < count || i <= exponent; i++) {
        if (i == exponent + 1 || (exponent < 0 && i == exponent)) {
            *to++ = '.';
            if (exponent < 0 && i == exponent)
                i++;
        }
        *to++ = i >= 0 && i < count ? digits[i] : '0';
    }
    *to = '\0';
}

/* Takes the zero before the point out. */
static void without_zero(char *text)
{
    text += *text == '-';
    if (text[0] == '0' && text[1] == '.')
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

static bool same_target(const struct fanuc_ls_target *one, const struct fanuc_ls_target *other)
{
    bool same_number = one->number == other->number || one->kind == FANUC_LS_TARGET_OTHER;
    return one->kind == other->kind && (one->kind == FANUC_LS_TARGET_NONE || (same_number && fanuc_ls_same(one->name, other->name)));
}

static bool same_characters(struct fanuc_ls_text one, struct fanuc_ls_text other)
{
    return one.length == other.length && (one.length == 0 || memcmp(one.at, other.at, one.length) == 0);
}

bool fanuc_ls_same_motion(const struct fanuc_ls_motion *one, const struct fanuc_ls_motion *other)
{
    bool same = one->letter == other->letter && same_target(&one->via, &other->via) && same_target(&one->target, &other->target) &&
                same_characters(one->via_options, other->via_options) && same_characters(one->options, other->options) &&
                one->speed_kind == other->speed_kind && one->termination == other->termination;
    if (one->speed_kind == FANUC_LS_SPEED_FIXED)
        same = same && one->speed == other->speed;
    else
        same = same && same_characters(one->speed_text, other->speed_text);
    same = same && (one->speed_kind == FANUC_LS_SPEED_NAMED || one->unit == other->unit);
    same = same && (one->termination != FANUC_LS_CNT || one->cnt == other->cnt);
    return same && (one->termination != FANUC_LS_CNT_REGISTER || same_characters(one->cnt_register, other->cnt_register));
}

static bool write_motion(struct fanuc_ls_writer *writer, const struct fanuc_ls_motion *motion)
{
    char letter[2] = {motion->letter, '\0'}, speed[MAX_NUMBER];
    bool has_via = motion->via.kind != FANUC_LS_TARGET_NONE;
    if (has_via != (motion->letter == 'C') || (!has_via && motion->via_options.length > 0))
        return false;
    if (motion->speed_kind != FANUC_LS_SPEED_NAMED && !fanuc_ls_fits(motion->letter, motion->unit))
        return false;
    if (motion->speed_kind == FANUC_LS_SPEED_FIXED && !fanuc_ls_in_range(motion->speed, motion->unit))
        return false;
    if (!is_plain(motion->options) || !is_line(motion->via_options, false) || !is_line(motion->target.name, false) ||
        !is_line(motion->via.name, false) || !is_line(motion->speed_text, false) || !is_line(motion->cnt_register, false))
        return false;
    size_t begin = writer->length;
    put_word(writer, letter);
    if (has_via) {
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
        plain(motion->speed, speed);
        if (motion->unit != FANUC_LS_SEC)
            without_zero(speed);
        else if (strchr(speed, '.') == NULL)
            strcat(speed, ".0");
        put_word(writer, speed);
    } else {
        put(writer, motion->speed_text);
    }
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
    struct fanuc_ls_instruction again;
    struct fanuc_ls_cursor cursor = written(writer, begin);
    return !writer->is_full && fanuc_ls_read_instruction(&cursor, &again) && again.kind == FANUC_LS_MOTION &&
           fanuc_ls_same_motion(&again.motion, motion);
}

static bool write_text(struct fanuc_ls_writer *writer, const struct fanuc_ls_instruction *instruction)
{
    struct fanuc_ls_text text = fanuc_ls_trim_end(instruction->text);
    struct fanuc_ls_instruction again;
    size_t begin = writer->length;
    bool is_case = text.length > 0 && text.at[0] == '=';
    put_word(writer, instruction->kind == FANUC_LS_COMMENT_LINE ? "  !" : is_case ? "         " : "  ");
    put_lines(writer, text);
    struct fanuc_ls_cursor cursor = written(writer, begin);
    return !writer->is_full && is_plain(instruction->text) && fanuc_ls_read_instruction(&cursor, &again) && again.kind == instruction->kind &&
           same_characters(again.text, text);
}

bool fanuc_ls_write_instruction(struct fanuc_ls_writer *writer, const struct fanuc_ls_instruction *instruction)
{
    struct fanuc_ls_text text = instruction->text;
    bool is_written = true;
    if (instruction->kind == FANUC_LS_NESTED) {
        bool is_read = fanuc_ls_same(fanuc_ls_trim_end(text), text) && is_line(text, false) && !has(text, '\t') &&
                       fanuc_ls_is_nested(text, writer->last, writer->in_block);
        writer->in_block = true;
        put(writer, text);
        put_word(writer, "\r\n");
        return is_read && !writer->is_full;
    }
    writer->in_block = false;
    put_number(writer, "%4llu:", ++writer->last);
    switch (instruction->kind) {
    case FANUC_LS_USER_FRAME:
        put_number(writer, "  UFRAME_NUM=%llu", instruction->number);
        break;
    case FANUC_LS_USER_TOOL:
        put_number(writer, "  UTOOL_NUM=%llu", instruction->number);
        break;
    case FANUC_LS_MOTION:
        is_written = write_motion(writer, &instruction->motion);
        break;
    case FANUC_LS_COMMENT_LINE:
    case FANUC_LS_OTHER:
        is_written = write_text(writer, instruction);
        break;
    default:
        put_word(writer, "  ");
    }
    put_word(writer, " ;\r\n");
    return is_written && !writer->is_full;
}

bool fanuc_ls_write_position(struct fanuc_ls_writer *writer, uint32_t number, struct fanuc_ls_text name)
{
    if (name.at != NULL && (!is_line(name, false) || has(name, '\t') || has(name, '"') || !fanuc_ls_same(fanuc_ls_trim(name), name)))
        return false;
    put_number(writer, "P[%llu", number);
    if (name.at != NULL) {
        put_word(writer, ":\"");
        put(writer, name);
        put_word(writer, "\"");
    }
    put_word(writer, "]{\r\n");
    return !writer->is_full;
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
    char text[MAX_NUMBER], column[16];
    snprintf(text, sizeof text, "%.3f", value);
    if (strtod(text, NULL) != value)
        plain(value, text);
    if (strcmp(text, "0.000") != 0)
        without_zero(text);
    size_t length = strlen(text);
    snprintf(column, sizeof column, "%*s", length < 10 ? (int)(10 - length) : 0, "");
    put_word(writer, column);
    put_word(writer, text);
}

bool fanuc_ls_write_group(struct fanuc_ls_writer *writer, const struct fanuc_ls_group *group, const struct fanuc_ls_axis *axes, size_t count)
{
    struct fanuc_ls_text keyword = group->keyword;
    put_number(writer, "   GP%llu:\r\n\tUF : ", group->number);
    put_frame(writer, group->has_frame, group->user_frame);
    put_word(writer, ", UT : ");
    put_frame(writer, group->has_tool, group->user_tool);
    put_word(writer, ",\t");
    if (keyword.at != NULL) {
        for (size_t i = 0; i < keyword.length; i++)
            if (((unsigned char)keyword.at[i] & 0xC0) != 0x80 && !fanuc_ls_is_word(keyword.at + i, keyword.at + keyword.length))
                return false;
        struct fanuc_ls_text inner = group->configuration;
        if (fanuc_ls_characters(keyword) < 3 || !is_line(inner, false) || has(inner, '\t') || has(inner, '\''))
            return false;
        put_word(writer, "\t");
        put(writer, keyword);
        put_word(writer, " : '");
        put(writer, inner);
        put_word(writer, "',");
    }
    put_word(writer, "\r\n");
    for (size_t i = 0; i < count; i++) {
        const struct fanuc_ls_axis *axis = &axes[i];
        if (axis->is_taught && !isfinite(axis->value))
            return false;
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
    return count > 0 && !writer->is_full;
}

bool fanuc_ls_write_position_end(struct fanuc_ls_writer *writer) { return fanuc_ls_write_section(writer, "};"); }
