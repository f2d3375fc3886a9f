#include "fanuc_ls_text.h"

static const char *const SECTIONS[] = {"/PROG", "/ATTR", "/APPL", "/MN", "/POS", "/END"};
enum { PROG, ATTR, APPL, MN, POS, END };

static const char *skip_blanks(const char *at, const char *end)
{
    while (is_one_of(byte_at(at, end), " \t"))
        at++;
    return at;
}

int fanuc_ls_section(struct fanuc_ls_text line)
{
    const char *end = end_of(line), *at = fanuc_ls_skip_white(line.at, end);
    for (int index = PROG; index <= END; index++) {
        const char *behind = at + strlen(SECTIONS[index]);
        if (fanuc_ls_begins(at, end, SECTIONS[index]) && (!fanuc_ls_is_word(behind, end) || *behind == '_'))
            return index;
    }
    return -1;
}

bool fanuc_ls_is_nested(struct fanuc_ls_text line, uint64_t last, bool in_block)
{
    const char *end = end_of(line), *body = line.at, *digits;
    while (byte_at(body, end) == ' ')
        body++;
    for (digits = body; is_digit(byte_at(digits, end));)
        digits++;
    uint64_t own;
    bool follows = fanuc_ls_to_number(between(body, digits), &own) && own == last + 1;
    return body - line.at >= 5 && last > 0 && (in_block || (!follows && !fanuc_ls_begins(body, end, ":")));
}

static bool fail(struct fanuc_ls_fault *fault, enum fanuc_ls_kind kind, const char *at)
{
    memset(fault, 0, sizeof *fault);
    fault->kind = kind;
    fault->at = at;
    return false;
}

/* The pseudocode of section 5. */
bool fanuc_ls_open(struct fanuc_ls_file *file, struct fanuc_ls_text text, char *scratch, struct fanuc_ls_fault *fault)
{
    const char *end = end_of(text), *start = text.at;
    memset(file, 0, sizeof *file);
    file->text = text;
    file->scratch = scratch;
    while (fanuc_ls_begins(start = fanuc_ls_skip_white(start, end), end, "\xEF\xBB\xBF"))
        start += 3;
    int last = PROG;
    const char *begin = start, *at = start;
    while (at < end && last != END) {
        struct fanuc_ls_text line = fanuc_ls_take_line(&at, end);
        int found = fanuc_ls_section(line);
        if ((found == PROG && line.at != start) || (found == APPL && last == APPL))
            found = -1;
        const char *words = fanuc_ls_skip_white(line.at, end_of(line));
        if (found < 0) {
            if (line.at == start)
                return fail(fault, FANUC_LS_PROGRAM, start);
            if (last == PROG && words < end_of(line))
                return fail(fault, FANUC_LS_MAIN, line.at);
            continue;
        }
        if (found == PROG) {
            const char *name = fanuc_ls_skip_white(line.at + 5, end_of(line)), *stop = name;
            size_t length;
            while (stop < end_of(line) && !fanuc_ls_is_white(fanuc_ls_character(stop, end_of(line), &length)))
                stop += length;
            if (stop == name)
                return fail(fault, FANUC_LS_PROGRAM, end_of(fanuc_ls_trim_end(line)));
            file->name = between(name, stop);
            file->kind = fanuc_ls_trim(between(stop, end_of(line)));
            continue;
        }
        if (line.at == start)
            return fail(fault, FANUC_LS_PROGRAM, start);
        if (found <= last || (found > MN && last < MN))
            return fail(fault, last < MN ? FANUC_LS_MAIN : FANUC_LS_END, line.at);
        const char *behind = words + strlen(SECTIONS[found]);
        if (found == MN && fanuc_ls_skip_white(behind, end_of(line)) < end_of(line))
            return fail(fault, FANUC_LS_MAIN, behind);
        file->sections[last] = between(begin, line.at);
        last = found;
        begin = at;
    }
    if (last != END)
        return fail(fault, start == end ? FANUC_LS_PROGRAM : last < MN ? FANUC_LS_MAIN : FANUC_LS_END, end);
    const char *rest = begin;
    while (fanuc_ls_begins(rest = fanuc_ls_skip_white(rest, end), end, "\x1A"))
        rest++;
    if (rest < end)
        return fail(fault, FANUC_LS_TRAILING, rest);
    fanuc_ls_rewind(file);
    return true;
}

void fanuc_ls_rewind(struct fanuc_ls_file *file)
{
    file->next = FANUC_LS_HEAD;
    file->is_begun = file->in_block = file->is_off = false;
    file->is_counted = true;
    file->last = file->last_found = 0;
}

/* Takes an attribute; one with a fault ends where the next line behind it begins at the left edge (LS-57). */
static bool next_attribute(struct fanuc_ls_file *file, struct fanuc_ls_entry *entry)
{
    const char *end = end_of(file->sections[ATTR]), *at = fanuc_ls_skip_white(file->at, end);
    struct fanuc_ls_cursor cursor = {.at = at, .end = end, .scratch = file->scratch};
    if (at == end)
        return false;
    if (!fanuc_ls_read_attribute(&cursor, &entry->attribute)) {
        entry->fault = cursor.fault;
        do
            fanuc_ls_take_line(&cursor.at, end);
        while (fanuc_ls_skip_white(cursor.at, end) != cursor.at);
    }
    entry->place = fanuc_ls_trim_end(between(at, cursor.at));
    file->at = cursor.at;
    return true;
}

/* The digits before the `:` and what follows it; false: there is no `:`. */
static bool split_head(struct fanuc_ls_text statement, struct fanuc_ls_text *digits, const char **body)
{
    const char *end = end_of(statement), *at = fanuc_ls_skip_white(statement.at, end), *stop = at;
    while (is_digit(byte_at(stop, end)))
        stop++;
    *digits = between(at, stop);
    stop = skip_blanks(stop, end);
    *body = stop + 1;
    return fanuc_ls_begins(stop, end, ":");
}

/* LS-14 */
static void read_statement(struct fanuc_ls_file *file, struct fanuc_ls_entry *entry)
{
    struct fanuc_ls_text digits, statement = entry->statement;
    const char *body, *trimmed = end_of(fanuc_ls_trim_end(statement));
    if (entry->is_nested) {
        entry->instruction.kind = FANUC_LS_NESTED;
        entry->instruction.text = fanuc_ls_trim_end(statement);
        return;
    }
    if (!split_head(statement, &digits, &body) || (digits.length > 0 && !entry->has_number)) {
        fail(&entry->fault, FANUC_LS_LINE_NUMBER, digits.at);
        return;
    }
    entry->body = fanuc_ls_skip_white(body, trimmed);
    if (trimmed[-1] == ';') {
        struct fanuc_ls_cursor cursor = {.at = body, .end = trimmed - 1, .scratch = file->scratch};
        if (!fanuc_ls_read_instruction(&cursor, &entry->instruction))
            entry->fault = cursor.fault;
        return;
    }
    /* The last `;` of its last line; a line end is before each. */
    const char *closed = trimmed;
    while (closed[-1] != ';' && closed[-1] != '\n')
        closed--;
    if (closed[-1] != ';' || *entry->body == '!')
        fail(&entry->fault, FANUC_LS_INSTRUCTION_END, trimmed);
    else
        fail(&entry->fault, FANUC_LS_AFTER_INSTRUCTION, fanuc_ls_skip_white(closed, trimmed));
}

/* LS-14, LS-15 */
static bool next_statement(struct fanuc_ls_file *file, struct fanuc_ls_entry *entry)
{
    const char *end = end_of(file->sections[MN]), *at = file->at, *body;
    struct fanuc_ls_text line, digits;
    line.at = NULL;
    while (at < end && fanuc_ls_trim(line = fanuc_ls_take_line(&at, end)).length == 0)
        line.at = NULL;
    file->at = at;
    if (line.at == NULL)
        return false;
    entry->statement = line;
    entry->is_nested = file->in_block = fanuc_ls_is_nested(line, file->last, file->in_block);
    if (!entry->is_nested) {
        entry->has_number = split_head(line, &digits, &body) && fanuc_ls_to_number(digits, &entry->number);
        file->last = entry->has_number ? entry->number : file->last + 1;
        while (!fanuc_ls_is_closed(line)) {
            line = fanuc_ls_take_line(&at, end);
            const char *mark = skip_blanks(line.at, end_of(line));
            if (!fanuc_ls_begins(mark, end_of(line), ":"))
                break;
            entry->statement = between(entry->statement.at, end_of(line));
            file->at = at;
        }
    }
    entry->place = fanuc_ls_trim(entry->statement);
    read_statement(file, entry);
    return true;
}

/* A position from the line that begins with P[ to the next one (LS-27); what is before the first one is a position as well. */
static bool next_position(struct fanuc_ls_file *file, struct fanuc_ls_entry *entry)
{
    const char *end = end_of(file->sections[POS]), *at = fanuc_ls_skip_white(file->at, end), *stop = at;
    if (at == end)
        return false;
    fanuc_ls_take_line(&stop, end);
    while (stop < end) {
        const char *next = stop, *words;
        struct fanuc_ls_text line = fanuc_ls_take_line(&next, end);
        words = fanuc_ls_skip_white(line.at, end_of(line));
        if (fanuc_ls_begins(words, end_of(line), "P["))
            break;
        stop = next;
    }
    file->at = stop;
    entry->place = fanuc_ls_trim_end(between(at, stop));
    struct fanuc_ls_cursor cursor = {.at = at, .end = stop, .scratch = file->scratch};
    if (!fanuc_ls_read_position(&cursor, &entry->position))
        entry->fault = cursor.fault;
    return true;
}

bool fanuc_ls_next(struct fanuc_ls_file *file, struct fanuc_ls_entry *entry)
{
    static const int OF[] = {PROG, ATTR, APPL, MN, POS};
    for (; file->next <= FANUC_LS_POSITION_ENTRY; file->next++, file->is_begun = false) {
        struct fanuc_ls_text section = file->sections[OF[file->next]];
        memset(entry, 0, sizeof *entry);
        entry->kind = file->next;
        if (section.at == NULL)
            continue;
        if (!file->is_begun)
            file->at = section.at;
        bool is_first = !file->is_begun, found;
        file->is_begun = true;
        switch (file->next) {
        case FANUC_LS_HEAD:
            found = is_first;
            entry->place = between(file->name.at, file->kind.length > 0 ? end_of(file->kind) : end_of(file->name));
            break;
        case FANUC_LS_ATTRIBUTE_ENTRY:
            found = next_attribute(file, entry);
            break;
        case FANUC_LS_LINE:
            found = file->at < end_of(section);
            entry->line = fanuc_ls_trim_end(fanuc_ls_take_line(&file->at, end_of(section)));
            entry->place = fanuc_ls_trim(entry->line);
            break;
        case FANUC_LS_STATEMENT:
            found = next_statement(file, entry);
            break;
        default:
            found = next_position(file, entry);
        }
        if (found)
            return true;
    }
    return false;
}
