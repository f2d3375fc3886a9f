/* fanuc-ls: programs from JSON, written. */
#include <stdlib.h>
#include <string.h>

#include "cellwire/fanuc_ls_write.h"
#include "fanuc_ls.h"

#define MAX_AXES 64
#define MAX_ITEMS 256

static char out[MAX_TEXT], scratch[MAX_TEXT + 1], characters[MAX_TEXT];
static size_t characters_used;

/* A string as UTF-8; false: it is none. */
static bool read_text(const struct json *value, struct fanuc_ls_text *out)
{
    long length = json_utf8(value, characters + characters_used, sizeof characters - characters_used);
    if (length < 0)
        return false;
    out->at = characters + characters_used;
    out->length = (size_t)length;
    characters_used += out->length;
    return true;
}

static bool is_null(const struct json *value) { return value == NULL || value->type == 'n'; }

static bool is_list(const struct json *value) { return value != NULL && value->type == '['; }

static bool read_optional(const struct json *value, struct fanuc_ls_text *out)
{
    out->at = NULL;
    out->length = 0;
    return is_null(value) || read_text(value, out);
}

static bool read_number(const struct json *value, int64_t largest, int64_t *number) { return json_integer(value, 0, largest, number); }

/* Which of some names a string is; -1: none. */
static int one_of(const struct json *value, const char *const *names, int count)
{
    for (int i = 0; i < count; i++)
        if (json_is(value, names[i]))
            return i;
    return -1;
}

static bool read_target(const struct json *object, struct fanuc_ls_target *target)
{
    const struct json *position = json_get(object, "position"), *named = json_get(object, "register"), *value = position != NULL ? position : named;
    int64_t number = 0;
    if (object == NULL || object->count != 1)
        return false;
    if (value == NULL) {
        target->kind = FANUC_LS_TARGET_OTHER;
        return read_text(json_get(object, "other"), &target->name);
    }
    target->kind = position != NULL ? FANUC_LS_TARGET_POSITION : FANUC_LS_TARGET_REGISTER;
    if (!read_number(json_get(value, "number"), UINT32_MAX, &number) || !read_optional(json_get(value, "name"), &target->name))
        return false;
    target->number = (uint32_t)number;
    return true;
}

static bool read_speed(const struct json *object, struct fanuc_ls_motion *motion)
{
    const struct json *fixed = json_get(object, "fixed"), *named = json_get(object, "named"), *listed = json_get(object, "register");
    int unit = one_of(json_get(fixed != NULL ? fixed : listed, "unit"), LS_UNITS, 7);
    motion->unit = unit < 0 ? FANUC_LS_PERCENT : (enum fanuc_ls_unit)unit;
    motion->speed_kind = fixed != NULL ? FANUC_LS_SPEED_FIXED : named != NULL ? FANUC_LS_SPEED_NAMED : FANUC_LS_SPEED_REGISTER;
    if (named != NULL)
        return read_text(named, &motion->speed_text);
    if (fixed != NULL)
        return unit >= 0 && json_number(json_get(fixed, "value"), &motion->speed);
    return unit >= 0 && read_text(json_get(listed, "register"), &motion->speed_text);
}

static bool read_motion(const struct json *object, struct fanuc_ls_motion *motion)
{
    const struct json *via = json_get(object, "via"), *termination = json_get(object, "termination");
    int kind = one_of(json_get(object, "kind"), LS_MOTIONS, 5);
    int64_t cnt = 0;
    memset(motion, 0, sizeof *motion);
    if (kind < 0 || (!is_null(via) && !read_target(via, &motion->via)) || !read_target(json_get(object, "target"), &motion->target))
        return false;
    motion->letter = LS_LETTERS[kind];
    motion->termination = FANUC_LS_NO_TERMINATION;
    if (json_is(termination, "fine")) {
        motion->termination = FANUC_LS_FINE;
    } else if (json_get(termination, "continuous") != NULL) {
        motion->termination = FANUC_LS_CNT;
        if (!read_number(json_get(termination, "continuous"), 100, &cnt))
            return false;
    } else if (!is_null(termination)) {
        motion->termination = FANUC_LS_CNT_REGISTER;
        if (!read_text(json_get(termination, "continuous_register"), &motion->cnt_register))
            return false;
    }
    motion->cnt = (unsigned)cnt;
    return read_speed(json_get(object, "speed"), motion) && read_text(json_get(object, "via_options"), &motion->via_options) &&
           read_text(json_get(object, "options"), &motion->options);
}

static bool read_instruction(const struct json *value, struct fanuc_ls_instruction *instruction)
{
    static const char *const NAMES[] = {"comment", "user_frame", "user_tool", "motion", "other", "nested"};
    int64_t number = 0;
    memset(instruction, 0, sizeof *instruction);
    if (json_is(value, "empty"))
        return true;
    if (value->type != '{' || value->count != 1)
        return false;
    for (int i = 0; i < 6; i++) {
        const struct json *inner = json_get(value, NAMES[i]);
        if (inner == NULL)
            continue;
        instruction->kind = (enum fanuc_ls_instruction_kind)(i + 1);
        if (instruction->kind == FANUC_LS_MOTION)
            return read_motion(inner, &instruction->motion);
        if (instruction->kind != FANUC_LS_USER_FRAME && instruction->kind != FANUC_LS_USER_TOOL)
            return read_text(inner, &instruction->text);
        bool is_number = read_number(inner, UINT16_MAX, &number);
        instruction->number = (uint16_t)number;
        return is_number;
    }
    return false;
}

static bool encode_attribute(struct fanuc_ls_writer *writer, const struct json *object, bool cut)
{
    const struct json *value = json_get(object, "value"), *list = json_get(value, "list");
    static struct fanuc_ls_pair items[MAX_ITEMS];
    struct fanuc_ls_text name, inner;
    size_t count = 0;
    if (!read_text(json_get(object, "name"), &name))
        return false;
    if (list == NULL)
        return read_text(json_get(value, "text"), &inner) && fanuc_ls_write_attribute(writer, name, inner, cut);
    for (const struct json *item = list->child; item != NULL; item = item->next) {
        if (count == MAX_ITEMS || item->count != 2 || !read_text(item->child, &items[count].name) || !read_text(item->child->next, &items[count].value))
            return false;
        count++;
    }
    return fanuc_ls_write_list(writer, name, items, count);
}

static bool read_frame(const struct json *value, bool *is_there, uint16_t *number)
{
    int64_t found = 0;
    *is_there = !is_null(value);
    if (*is_there && !read_number(value, UINT16_MAX, &found))
        return false;
    *number = (uint16_t)found;
    return true;
}

static bool read_axis(const struct json *object, struct fanuc_ls_axis *axis)
{
    const struct json *name = json_get(object, "name"), *value = json_get(object, "value"), *unit = json_get(object, "unit");
    memset(axis, 0, sizeof *axis);
    if (name == NULL || name->type != '"' || name->length == 0 || name->length > 2)
        return false;
    memcpy(axis->name, name->text, name->length);
    bool is_numbered = strchr("JE", axis->name[0]) != NULL && axis->name[1] >= '1' && axis->name[1] <= '9';
    bool is_rail = axis->name[0] == 'R' && axis->name[1] != '\0' && strchr("XYZWPR", axis->name[1]) != NULL;
    if (!is_numbered && !is_rail && !(axis->name[1] == '\0' && strchr("XYZWPR", axis->name[0]) != NULL))
        return false;
    axis->is_mm = json_is(unit, "mm");
    axis->is_taught = !is_null(value);
    return (axis->is_mm || json_is(unit, "deg")) && (!axis->is_taught || json_number(value, &axis->value));
}

static bool encode_group(struct fanuc_ls_writer *writer, const struct json *object)
{
    static struct fanuc_ls_axis axes[MAX_AXES];
    const struct json *configuration = json_get(object, "configuration"), *list = json_get(object, "axes");
    struct fanuc_ls_group group;
    int64_t number = 0;
    size_t count = 0;
    memset(&group, 0, sizeof group);
    if (!read_number(json_get(object, "number"), UINT8_MAX, &number) || !read_frame(json_get(object, "user_frame"), &group.has_frame, &group.user_frame) ||
        !read_frame(json_get(object, "user_tool"), &group.has_tool, &group.user_tool) || list == NULL)
        return false;
    group.number = (uint8_t)number;
    if (!is_null(configuration) &&
        (!read_text(json_get(configuration, "keyword"), &group.keyword) || !read_text(json_get(configuration, "text"), &group.configuration)))
        return false;
    for (const struct json *axis = list->child; axis != NULL; axis = axis->next)
        if (count == MAX_AXES || !read_axis(axis, &axes[count++]))
            return false;
    return fanuc_ls_write_group(writer, &group, axes, count);
}

static bool encode_position(struct fanuc_ls_writer *writer, const struct json *object)
{
    const struct json *groups = json_get(object, "groups");
    struct fanuc_ls_text name;
    int64_t number = 0;
    if (!read_number(json_get(object, "number"), UINT32_MAX, &number) || !read_optional(json_get(object, "name"), &name) || groups == NULL ||
        groups->child == NULL || !fanuc_ls_write_position(writer, (uint32_t)number, name))
        return false;
    for (const struct json *group = groups->child; group != NULL; group = group->next)
        if (!encode_group(writer, group))
            return false;
    return fanuc_ls_write_position_end(writer);
}

/* Writes a program into a place of this size. */
static bool encode(struct fanuc_ls_writer *writer, const struct json *request, size_t size)
{
    const struct json *message = json_get(request, "message"), *attributes = json_get(message, "attributes");
    const struct json *application = json_get(message, "application"), *instructions = json_get(message, "instructions");
    const struct json *positions = json_get(message, "positions"), *one;
    bool cut = json_is(json_get(json_get(request, "options"), "comment"), "truncate");
    struct fanuc_ls_instruction instruction;
    struct fanuc_ls_text name, kind, line;
    characters_used = 0;
    fanuc_ls_writer_init(writer, out, size, scratch);
    if (!read_text(json_get(message, "name"), &name) || !read_optional(json_get(message, "kind"), &kind) || !is_list(instructions) ||
        !is_list(positions) || !(is_null(attributes) || is_list(attributes)) || !(is_null(application) || is_list(application)) ||
        !fanuc_ls_write_head(writer, name, kind, (size_t)name_limit_of(request)))
        return false;
    if (!is_null(attributes) && !fanuc_ls_write_section(writer, "/ATTR"))
        return false;
    for (one = is_null(attributes) ? NULL : attributes->child; one != NULL; one = one->next)
        if (!encode_attribute(writer, one, cut))
            return false;
    if (!is_null(application) && !fanuc_ls_write_section(writer, "/APPL"))
        return false;
    for (one = is_null(application) ? NULL : application->child; one != NULL; one = one->next)
        if (!read_text(one, &line) || !fanuc_ls_write_line(writer, line))
            return false;
    if (!fanuc_ls_write_section(writer, "/MN"))
        return false;
    for (one = instructions->child; one != NULL; one = one->next)
        if (!read_instruction(one, &instruction) || !fanuc_ls_write_instruction(writer, &instruction))
            return false;
    if (!fanuc_ls_write_section(writer, "/POS"))
        return false;
    for (one = positions->child; one != NULL; one = one->next)
        if (!encode_position(writer, one))
            return false;
    return fanuc_ls_write_section(writer, "/END");
}

void answer_written(const struct json *request)
{
    struct fanuc_ls_writer writer;
    bool is_written = encode(&writer, request, sizeof out);
    size_t length = writer.length;
    if (is_written && (encode(&writer, request, length - 1) || !encode(&writer, request, length))) {
        print("{\"wrong\":\"a program has another size than it needs\"}\n");
        return;
    }
    if (!is_written) {
        print("{\"refused\":\"no program that can be written\"}\n");
        return;
    }
    print("{\"hex\":\"");
    for (size_t i = 0; i < writer.length; i++)
        print("%02X", (unsigned char)out[i]);
    print("\"}\n");
}
