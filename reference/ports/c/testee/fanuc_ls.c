/* fanuc-ls: texts in the place of frames; see reference/ports/README.md. */
#include "fanuc_ls.h"

#include <math.h>
#include <string.h>

static char text[MAX_TEXT], scratch[MAX_TEXT + 1];
static const char *const KINDS[] = {"",
                                    "program",
                                    "main",
                                    "end",
                                    "trailing",
                                    "attribute",
                                    "attribute_value",
                                    "attribute_end",
                                    "line_number",
                                    "instruction_end",
                                    "after_instruction",
                                    "target",
                                    "bracket",
                                    "speed",
                                    "speed_unit",
                                    "continuous",
                                    "position",
                                    "group",
                                    "frames",
                                    "configuration",
                                    "axis",
                                    "number",
                                    "axis_unit",
                                    "speed_range",
                                    "name_length",
                                    "name",
                                    "comment_length",
                                    "line_count",
                                    "undefined_position",
                                    "unused_position",
                                    "repeated_position",
                                    "untaught_position"};

const char *const LS_UNITS[7] = {"percent", "sec", "msec", "mm_per_sec", "cm_per_min", "inch_per_min", "deg_per_sec"};
const char *const LS_MOTIONS[5] = {"joint", "linear", "circular", "arc", "spline"};

/* Bytes of a file as UTF-8 (LS-4); returns the length. */
static size_t to_utf8(size_t length)
{
    static char latin1[MAX_TEXT];
    bool is_utf8 = true;
    for (size_t i = 0; i < length && is_utf8;) {
        unsigned char first = (unsigned char)text[i++];
        size_t more = first < 0x80 ? 0 : first >= 0xC2 && first < 0xE0 ? 1 : first >= 0xE0 && first < 0xF0 ? 2 : first >= 0xF0 && first < 0xF5 ? 3 : 4;
        unsigned char second = more > 0 && more < 4 && i < length ? (unsigned char)text[i] : 0;
        is_utf8 = more < 4 && !(first == 0xE0 && second < 0xA0) && !(first == 0xED && second > 0x9F) && !(first == 0xF0 && second < 0x90) &&
                  !(first == 0xF4 && second > 0x8F);
        for (; is_utf8 && more > 0; more--, i++)
            is_utf8 = i < length && ((unsigned char)text[i] & 0xC0) == 0x80;
    }
    if (is_utf8)
        return length;
    memcpy(latin1, text, length);
    size_t out = 0;
    for (size_t i = 0; i < length && out + 2 < MAX_TEXT; i++) {
        unsigned char byte = (unsigned char)latin1[i];
        if (byte >= 0x80)
            text[out++] = (char)(0xC0 | byte >> 6);
        text[out++] = (char)(byte < 0x80 ? byte : 0x80 | (byte & 0x3F));
    }
    return out;
}

static void print_text(struct fanuc_ls_text value)
{
    if (value.at == NULL) {
        print("null");
        return;
    }
    print("\"");
    for (size_t i = 0; i < value.length; i++) {
        unsigned char byte = (unsigned char)value.at[i];
        uint32_t c = byte;
        if (byte >= 0xC0) {
            int more = byte < 0xE0 ? 1 : byte < 0xF0 ? 2 : 3;
            for (c = byte & (0x3Fu >> more); more > 0; more--)
                c = c << 6 | ((unsigned char)value.at[++i] & 0x3F);
        }
        if (c >= 0x10000)
            print("\\u%04x\\u%04x", (unsigned)(0xD800 + ((c - 0x10000) >> 10)), (unsigned)(0xDC00 + ((c - 0x10000) & 0x3FF)));
        else if (c < 0x20 || c > 0x7E || c == '"' || c == '\\')
            print("\\u%04x", (unsigned)c);
        else
            print("%c", (int)c);
    }
    print("\"");
}

/* A fault by its place (LS-34). */
static void print_fault(const struct fanuc_ls_file *file, const struct fanuc_ls_fault *fault)
{
    struct fanuc_ls_text line = {file->text.at, 0};
    size_t lines = 1;
    for (const char *at = file->text.at; at < fault->at; at++)
        if (*at == '\n') {
            line.at = at + 1;
            lines++;
        }
    line.length = (size_t)(fault->at - line.at);
    print("\"%s\":{\"kind\":\"%s\",", fault->is_warning ? "warning" : "error", KINDS[fault->kind]);
    if (fault->kind == FANUC_LS_NAME_LENGTH)
        print("\"limit\":%llu,", (unsigned long long)fault->expected);
    if (fault->is_warning && (fault->kind == FANUC_LS_LINE_NUMBER || fault->kind == FANUC_LS_LINE_COUNT))
        print("\"expected\":%llu,", (unsigned long long)fault->expected);
    if (fault->kind >= FANUC_LS_UNDEFINED)
        print("\"number\":%llu,", (unsigned long long)fault->found);
    else if (fault->kind == FANUC_LS_NAME_LENGTH || (fault->is_warning && fault->kind != FANUC_LS_NAME && fault->kind != FANUC_LS_SPEED_UNIT))
        print("\"found\":%llu,", (unsigned long long)fault->found);
    print("\"line\":%zu,\"column\":%zu,\"offset\":%zu}", lines, fanuc_ls_characters(line) + 1, (size_t)(fault->at - file->text.at));
}

static void print_attribute(const struct fanuc_ls_attribute *attribute)
{
    struct fanuc_ls_text end = attribute->value;
    print("{\"name\":");
    print_text(attribute->name);
    print(",\"value\":{\"%s\":", attribute->is_list ? "list" : "text");
    if (!attribute->is_list) {
        print_text(attribute->value);
    } else {
        struct fanuc_ls_cursor items = {end.at, end.at + end.length, scratch, {FANUC_LS_OK, NULL, false, 0, 0}};
        struct fanuc_ls_text name, value;
        for (bool is_first_item = true; items.at < items.end && fanuc_ls_item(&items, &name, &value); items.at++, is_first_item = false) {
            print(is_first_item ? "[[" : ",[");
            print_text(name);
            print(",");
            print_text(value);
            print("]");
            items.scratch = scratch;
        }
        print("]");
    }
    print("}}");
}

static void print_target(const struct fanuc_ls_target *target)
{
    if (target->kind == FANUC_LS_TARGET_NONE) {
        print("null");
        return;
    }
    if (target->kind == FANUC_LS_TARGET_OTHER) {
        print("{\"other\":");
        print_text(target->name);
    } else {
        print("{\"%s\":{\"number\":%lu,\"name\":", target->kind == FANUC_LS_TARGET_POSITION ? "position" : "register", (unsigned long)target->number);
        print_text(target->name);
        print("}");
    }
    print("}");
}

static void print_there(struct fanuc_ls_text value)
{
    struct fanuc_ls_text empty = {"", 0};
    print_text(value.at == NULL ? empty : value);
}

static void print_motion(const struct fanuc_ls_motion *motion)
{
    print("{\"kind\":\"%s\",\"via\":", LS_MOTIONS[strchr(LS_LETTERS, motion->letter) - LS_LETTERS]);
    print_target(&motion->via);
    print(",\"via_options\":");
    print_there(motion->via_options);
    print(",\"target\":");
    print_target(&motion->target);
    print(",\"speed\":{");
    if (motion->speed_kind == FANUC_LS_SPEED_FIXED) {
        print("\"fixed\":{\"value\":%.17g,\"unit\":\"%s\"}", motion->speed, LS_UNITS[motion->unit]);
    } else {
        print(motion->speed_kind == FANUC_LS_SPEED_NAMED ? "\"named\":" : "\"register\":{\"register\":");
        print_text(motion->speed_text);
        if (motion->speed_kind == FANUC_LS_SPEED_REGISTER)
            print(",\"unit\":\"%s\"}", LS_UNITS[motion->unit]);
    }
    print("},\"termination\":");
    switch (motion->termination) {
    case FANUC_LS_NO_TERMINATION:
        print("null");
        break;
    case FANUC_LS_FINE:
        print("\"fine\"");
        break;
    case FANUC_LS_CNT:
        print("{\"continuous\":%u}", motion->cnt);
        break;
    case FANUC_LS_CNT_REGISTER:
        print("{\"continuous_register\":");
        print_text(motion->cnt_register);
        print("}");
    }
    print(",\"options\":");
    print_there(motion->options);
    print("}");
}

static void print_instruction(const struct fanuc_ls_instruction *instruction)
{
    static const char *const NAMES[] = {"empty", "comment", "user_frame", "user_tool", "motion", "other", "nested"};
    if (instruction->kind == FANUC_LS_EMPTY) {
        print("\"empty\"");
        return;
    }
    print("{\"%s\":", NAMES[instruction->kind]);
    if (instruction->kind == FANUC_LS_MOTION)
        print_motion(&instruction->motion);
    else if (instruction->kind == FANUC_LS_USER_FRAME || instruction->kind == FANUC_LS_USER_TOOL)
        print("%u", (unsigned)instruction->number);
    else
        print_text(instruction->text);
    print("}");
}

static void print_frame(const char *name, bool is_there, uint16_t number)
{
    if (is_there)
        print("\"%s\":%u,", name, (unsigned)number);
    else
        print("\"%s\":null,", name);
}

static void print_position(const struct fanuc_ls_position *position)
{
    struct fanuc_ls_cursor groups = position->groups;
    struct fanuc_ls_group group;
    struct fanuc_ls_axis axis;
    print("{\"number\":%lu,\"name\":", (unsigned long)position->number);
    print_text(position->name);
    print(",\"groups\":[");
    for (bool is_first_group = true; fanuc_ls_next_group(&groups, &group); is_first_group = false) {
        print("%s{\"number\":%u,", is_first_group ? "" : ",", (unsigned)group.number);
        print_frame("user_frame", group.has_frame, group.user_frame);
        print_frame("user_tool", group.has_tool, group.user_tool);
        print("\"configuration\":");
        if (group.keyword.at != NULL) {
            print("{\"keyword\":");
            print_text(group.keyword);
            print(",\"text\":");
            print_text(group.configuration);
            print("}");
        } else {
            print("null");
        }
        print(",\"axes\":[");
        for (bool is_first_axis = true; fanuc_ls_next_axis(&groups, &axis, is_first_axis); is_first_axis = false) {
            print("%s{\"name\":\"%s\",\"value\":", is_first_axis ? "" : ",", axis.name);
            print(axis.is_taught ? "%.17g" : "null", axis.value);
            print(",\"unit\":\"%s\"}", axis.is_mm ? "mm" : "deg");
        }
        print("]}");
    }
    print("]}");
}

static void print_entry(const struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry)
{
    struct fanuc_ls_text none = {NULL, 0};
    print("\"message\":{");
    switch (entry->kind) {
    case FANUC_LS_HEAD:
        print("\"program\":{\"name\":");
        print_text(file->name);
        print(",\"kind\":");
        print_text(file->kind.length > 0 ? file->kind : none);
        print("}");
        break;
    case FANUC_LS_ATTRIBUTE_ENTRY:
        print("\"attribute\":");
        print_attribute(&entry->attribute);
        break;
    case FANUC_LS_LINE:
        print("\"application\":");
        print_text(entry->line);
        break;
    case FANUC_LS_STATEMENT:
        print(entry->has_number ? "\"statement\":{\"number\":%llu" : "\"statement\":{\"number\":null", (unsigned long long)entry->number);
        print(",\"instruction\":");
        print_instruction(&entry->instruction);
        print("}");
        break;
    case FANUC_LS_POSITION_ENTRY:
        print("\"position\":");
        print_position(&entry->position);
    }
    print("}");
}

/* Everything that a document finds. */
static void print_document(struct fanuc_ls_file *file, size_t name_limit)
{
    struct fanuc_ls_entry entry;
    struct fanuc_ls_fault found[FANUC_LS_MAX_FINDINGS];
    size_t first = 0, second = 0;
    while (fanuc_ls_next(file, &entry)) {
        size_t offset = (size_t)(entry.place.at - file->text.at);
        if (entry.kind == FANUC_LS_LINE && entry.place.length == 0)
            continue;
        print_item(offset, entry.place.length, false);
        if (entry.fault.kind != FANUC_LS_OK)
            print_fault(file, &entry.fault);
        else
            print_entry(file, &entry);
        print("}");
        size_t count = fanuc_ls_findings(file, &entry, name_limit, found);
        first += 1 + count;
        for (size_t i = 0; i < count; i++) {
            print_item(offset, entry.place.length, false);
            print_fault(file, &found[i]);
            print("}");
        }
    }
    fanuc_ls_rewind(file);
    while (fanuc_ls_next(file, &entry))
        if (entry.kind != FANUC_LS_LINE || entry.place.length > 0)
            second += 1 + fanuc_ls_findings(file, &entry, name_limit, found);
    if (first != second) {
        print_item(0, 0, false);
        print("\"again\":%zu}", second);
    }
}

/* One list of a program; `null` where its section is not there. */
static void print_list(struct fanuc_ls_file *file, const char *name, enum fanuc_ls_entry_kind kind, bool is_there)
{
    struct fanuc_ls_entry entry;
    bool is_first_entry = true;
    print(is_there ? ",\"%s\":[" : ",\"%s\":null", name);
    fanuc_ls_rewind(file);
    while (is_there && fanuc_ls_next(file, &entry)) {
        if (entry.kind != kind)
            continue;
        print(is_first_entry ? "" : ",");
        is_first_entry = false;
        if (kind == FANUC_LS_ATTRIBUTE_ENTRY)
            print_attribute(&entry.attribute);
        else if (kind == FANUC_LS_LINE)
            print_text(entry.line);
        else if (kind == FANUC_LS_STATEMENT)
            print_instruction(&entry.instruction);
        else
            print_position(&entry.position);
    }
    print(is_there ? "]" : "");
}

/* A program, or its first fault (LS-33). */
static void print_program(struct fanuc_ls_file *file)
{
    struct fanuc_ls_entry entry;
    struct fanuc_ls_text none = {NULL, 0};
    print_item(0, file->text.length, false);
    while (fanuc_ls_next(file, &entry))
        if (entry.fault.kind != FANUC_LS_OK) {
            print_fault(file, &entry.fault);
            print("}");
            return;
        }
    print("\"message\":{\"name\":");
    print_text(file->name);
    print(",\"kind\":");
    print_text(file->kind.length > 0 ? file->kind : none);
    print_list(file, "attributes", FANUC_LS_ATTRIBUTE_ENTRY, file->sections[1].at != NULL);
    print_list(file, "application", FANUC_LS_LINE, file->sections[2].at != NULL);
    print_list(file, "instructions", FANUC_LS_STATEMENT, true);
    print_list(file, "positions", FANUC_LS_POSITION_ENTRY, true);
    print("}}");
}

int64_t name_limit_of(const struct json *request)
{
    int64_t limit = FANUC_LS_NAME_LIMIT;
    json_integer(json_get(json_get(request, "options"), "name_limit"), 0, INT64_MAX, &limit);
    return limit;
}

void answer_program(const struct json *request, size_t length, bool is_document)
{
    struct fanuc_ls_file file;
    struct fanuc_ls_fault fault;
    struct fanuc_ls_text whole = {text, to_utf8(length)};
    if (!fanuc_ls_open(&file, whole, scratch, &fault)) {
        print_item(0, whole.length, false);
        print_fault(&file, &fault);
        print("}");
    } else if (is_document) {
        print_document(&file, (size_t)name_limit_of(request));
    } else {
        print_program(&file);
    }
}

char *program_text(size_t *size)
{
    *size = sizeof text / 2;
    return text;
}
