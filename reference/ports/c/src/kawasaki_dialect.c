#include "bytes.h"
#include "kawasaki.h"

#define TEXT(string) {(const uint8_t *)(string), sizeof(string) - 1}
#define LIST(...)                                                                                                      \
    (const struct kawasaki_place[]){__VA_ARGS__},                                                                      \
        sizeof((const struct kawasaki_place[]){__VA_ARGS__}) / sizeof(struct kawasaki_place)
#define FIELD(of_kind) {.field = KAWASAKI_##of_kind}
#define LINE(of_name) {of_name, KAWASAKI_WHOLE, -9999999, 9999999, 0}

static const struct kawasaki_entry TABLE[] = {
    {KAWASAKI_ORDER_START, 0, TEXT("TilausAlkaa"), NULL, 0, LIST(FIELD(ORDER), FIELD(NUMBER))},
    {KAWASAKI_ORDER_ACK, 0, TEXT("TilausKuittaus"), NULL, 0, LIST(FIELD(ORDER))},
    {KAWASAKI_JOB, 0, TEXT("Tyo"), NULL, 0, LIST(FIELD(ORDER), FIELD(NUMBER), FIELD(WORK))},
    {KAWASAKI_JOB_ACK, 0, TEXT("TyoKuittaus"), NULL, 0, LIST(FIELD(ORDER), FIELD(NUMBER))},
    {KAWASAKI_JOB_REQUEST, 0, TEXT("TyoPyynto"), NULL, 0, LIST(FIELD(ORDER), FIELD(NUMBER))},
    {KAWASAKI_PAUSE, 0, TEXT("TyoTauko"), NULL, 0, LIST(FIELD(ORDER), FIELD(QUEUED))},
    {KAWASAKI_ORDER_END, 0, TEXT("TilausLoppuu"), NULL, 0, LIST(FIELD(ORDER))},
    {KAWASAKI_ORDER_INTERRUPT, 0, TEXT("TilausKeskeytyy"), NULL, 0, LIST(FIELD(ORDER))},
    {KAWASAKI_END_ACK, 0, TEXT("LoppuKuittaus"), NULL, 0, LIST(FIELD(ENDED), FIELD(ORDER), FIELD(EXECUTED))},
    {KAWASAKI_STATUS, 0, TEXT("Tila"), NULL, 0, LIST(FIELD(ORDER), FIELD(PHASE), FIELD(QUEUED), FIELD(EXECUTED), FIELD(ENDED))},
    {KAWASAKI_FILLER, 0, TEXT("Huuhaa"), NULL, 0, NULL, 0},
};
static const struct kawasaki_job_field LINES[] = {
    {"kind", KAWASAKI_WHOLE, 1, 2, 0}, LINE("x1"), LINE("y1"), LINE("x2"), LINE("y2"),
};
const struct kawasaki_dialect KAWASAKI_DIALECT = {false, TABLE, sizeof TABLE / sizeof *TABLE, LINES, sizeof LINES / sizeof *LINES};

#define BIT(of_kind) (1u << KAWASAKI_##of_kind)

/* By role: the fields that a message may have, and those that it must have (KM-27, KM-28). */
static const struct {
    unsigned may, must;
} RULES[KAWASAKI_ROLES] = {
    {BIT(ORDER) | BIT(NUMBER), BIT(ORDER)},
    {BIT(ORDER), BIT(ORDER)},
    {BIT(ORDER) | BIT(NUMBER) | BIT(WORK), BIT(NUMBER) | BIT(WORK)},
    {BIT(ORDER) | BIT(NUMBER), BIT(NUMBER)},
    {BIT(ORDER) | BIT(NUMBER), BIT(NUMBER)},
    {BIT(ORDER) | BIT(QUEUED), 0},
    {BIT(ORDER), 0},
    {BIT(ORDER), 0},
    {BIT(ENDED) | BIT(ORDER) | BIT(EXECUTED), BIT(ENDED) | BIT(EXECUTED)},
    {BIT(ORDER) | BIT(PHASE) | BIT(QUEUED) | BIT(EXECUTED) | BIT(ENDED), BIT(ORDER) | BIT(QUEUED) | BIT(EXECUTED)},
    {0, 0},
    {~0u, 0}, /* a command */
};
/* With datagrams these name their order. */
static const enum kawasaki_role OF_ORDER[] = {KAWASAKI_JOB,   KAWASAKI_JOB_ACK,   KAWASAKI_JOB_REQUEST,
                                              KAWASAKI_PAUSE, KAWASAKI_ORDER_END, KAWASAKI_ORDER_INTERRUPT};

const struct kawasaki_entry *kawasaki_entry(const struct kawasaki_dialect *dialect, enum kawasaki_role role, uint8_t command)
{
    for (size_t i = 0; i < dialect->entry_count; i++)
        if (dialect->entries[i].role == role && dialect->entries[i].command == command)
            return &dialect->entries[i];
    return NULL;
}

bool kawasaki_has(const struct kawasaki_dialect *dialect, enum kawasaki_role role)
{
    return kawasaki_entry(dialect, role, 0) != NULL;
}

bool kawasaki_entry_has(const struct kawasaki_entry *entry, enum kawasaki_field field)
{
    for (size_t i = 0; i < entry->header_count; i++)
        if (entry->header[i].field == field)
            return true;
    for (size_t i = 0; i < entry->field_count; i++)
        if (entry->fields[i].field == field)
            return true;
    return false;
}

size_t kawasaki_place_of(const struct kawasaki_dialect *dialect, enum kawasaki_role role, enum kawasaki_field field)
{
    const struct kawasaki_entry *entry = kawasaki_entry(dialect, role, 0);
    for (size_t i = 0; i < entry->field_count; i++)
        if (entry->fields[i].field == field)
            return i;
    return 0;
}

bool kawasaki_is_forbidden(uint8_t byte, bool is_latin1)
{
    return byte == '<' || byte == '>' || byte == '$' || byte == '#' || (byte > 0x7F && !is_latin1);
}

static bool can_be_written(const struct kawasaki_dialect *dialect, struct kawasaki_msg_text text)
{
    for (size_t i = 0; i < text.length; i++)
        if (kawasaki_is_forbidden(text.bytes[i], dialect->is_latin1))
            return false;
    return true;
}

static bool is_same(struct kawasaki_msg_text a, struct kawasaki_msg_text b)
{
    return a.length == b.length && (a.length == 0 || memcmp(a.bytes, b.bytes, a.length) == 0);
}

/* Adds the fields of a list to those there; false: one is there twice, or cannot be written. */
static bool collect(const struct kawasaki_dialect *dialect, const struct kawasaki_place *list, size_t count, unsigned *there)
{
    if (count > KAWASAKI_MAX_FIELDS)
        return false;
    for (size_t i = 0; i < count; i++) {
        unsigned bit = 1u << list[i].field;
        if (list[i].field == KAWASAKI_CONSTANT && !can_be_written(dialect, list[i].constant))
            return false;
        if (list[i].field <= KAWASAKI_CONSTANT)
            continue;
        if (*there & bit)
            return false;
        *there |= bit;
    }
    return true;
}

static bool check_entry(const struct kawasaki_dialect *dialect, const struct kawasaki_entry *entry)
{
    unsigned there = 0;
    if (!collect(dialect, entry->header, entry->header_count, &there) || there & BIT(WORK))
        return false;
    if (!collect(dialect, entry->fields, entry->field_count, &there))
        return false;
    if (there & ~RULES[entry->role].may || RULES[entry->role].must & ~there)
        return false;
    return entry->name.length > 0 && can_be_written(dialect, entry->name);
}

static bool check_table(const struct kawasaki_dialect *dialect)
{
    for (unsigned role = 0; role < KAWASAKI_COMMAND; role++) {
        bool may_lack = role == KAWASAKI_JOB_ACK || role == KAWASAKI_PAUSE || role == KAWASAKI_ORDER_INTERRUPT;
        if (!may_lack && !kawasaki_has(dialect, (enum kawasaki_role)role))
            return false;
    }
    for (size_t i = 0; i < dialect->entry_count; i++) {
        const struct kawasaki_entry *entry = &dialect->entries[i];
        if (!check_entry(dialect, entry) || kawasaki_entry(dialect, entry->role, entry->command) != entry)
            return false;
        for (size_t other = 0; other < i; other++)
            if (is_same(dialect->entries[other].name, entry->name))
                return false;
    }
    return true;
}

/* KM-24 */
static bool check_layout(const struct kawasaki_dialect *dialect)
{
    for (size_t i = 0; i < dialect->job_count; i++) {
        const struct kawasaki_job_field *field = &dialect->job[i];
        bool is_decimal = field->kind == KAWASAKI_DECIMAL;
        if (field->low > field->high || (field->kind == KAWASAKI_TEXT && field->low < 0))
            return false;
        if (is_decimal ? field->places < 1 || field->places > 9 : field->places != 0)
            return false;
        for (size_t other = 0; other < i; other++)
            if (strcmp(dialect->job[other].name, field->name) == 0)
                return false;
    }
    bool is_count = dialect->job_count >= 1 && dialect->job_count <= KAWASAKI_OWN_FIELDS;
    return is_count && kawasaki_job_longest(dialect) <= KAWASAKI_MAX_OWN;
}

/* The bytes of a list at its longest values, with a `$` between two. */
static size_t longest_list(const struct kawasaki_dialect *dialect, const struct kawasaki_place *list, size_t count)
{
    size_t longest = count > 0 ? count - 1 : 0, own = kawasaki_job_longest(dialect);
    for (size_t i = 0; i < count; i++)
        longest += list[i].field == KAWASAKI_CONSTANT ? list[i].constant.length
                   : list[i].field == KAWASAKI_WORK   ? own - 1
                   : list[i].field == KAWASAKI_UNUSED ? 0
                                                      : 11;
    return longest;
}

/* KM-45 */
static size_t longest(const struct kawasaki_dialect *dialect, const struct kawasaki_entry *entry)
{
    size_t data = longest_list(dialect, entry->fields, entry->field_count);
    char text[MAX_DIGITS];
    size_t digits = put_decimal(text, (uint32_t)data, 1);
    size_t header = entry->header_count > 0 ? 1 + longest_list(dialect, entry->header, entry->header_count) : 0;
    return 1 + entry->name.length + header + 1 + digits + 1 + data + 2;
}

bool kawasaki_check(const struct kawasaki_dialect *dialect, const struct kawasaki_limits *limits, uint16_t largest, bool datagrams)
{
    if (!check_layout(dialect) || !check_table(dialect) || largest < 2 || largest > KAWASAKI_LARGEST)
        return false;
    if (limits->element == 0 || limits->packet > KAWASAKI_MSG_MAX_LEN)
        return false;
    for (size_t i = 0; i < dialect->entry_count; i++)
        if (longest(dialect, &dialect->entries[i]) > limits->packet)
            return false;
    for (size_t i = 0; datagrams && i < sizeof OF_ORDER / sizeof *OF_ORDER; i++) {
        const struct kawasaki_entry *entry = kawasaki_entry(dialect, OF_ORDER[i], 0);
        if (entry != NULL && !kawasaki_entry_has(entry, KAWASAKI_ORDER))
            return false;
    }
    return true;
}
