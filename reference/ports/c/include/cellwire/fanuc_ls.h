/* fanuc-ls: TP programs as text. Clauses LS-… are those of reference/fanuc-ls.md.
 * Texts are UTF-8. Nothing is copied but texts in which line ends become blanks or line feeds: these go to a buffer of the caller's
 * that is as long as the text. */
#ifndef CELLWIRE_FANUC_LS_H
#define CELLWIRE_FANUC_LS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FANUC_LS_NAME_LIMIT 36   /* LS-51 */
#define FANUC_LS_COMMENT_LENGTH 16 /* LS-11 */

/* Characters; not terminated. `at` is NULL: there is none. */
struct fanuc_ls_text {
    const char *at;
    size_t length;
};

/* LS-49; what a document finds besides them: LS-50. */
enum fanuc_ls_kind {
    FANUC_LS_OK,
    FANUC_LS_PROGRAM,
    FANUC_LS_MAIN,
    FANUC_LS_END,
    FANUC_LS_TRAILING,
    FANUC_LS_ATTRIBUTE,
    FANUC_LS_ATTRIBUTE_VALUE,
    FANUC_LS_ATTRIBUTE_END,
    FANUC_LS_LINE_NUMBER, /* as a warning: expected, found */
    FANUC_LS_INSTRUCTION_END,
    FANUC_LS_AFTER_INSTRUCTION,
    FANUC_LS_TARGET,
    FANUC_LS_BRACKET,
    FANUC_LS_SPEED,
    FANUC_LS_SPEED_UNIT, /* an error or a warning */
    FANUC_LS_CONTINUOUS,
    FANUC_LS_POSITION,
    FANUC_LS_GROUP,
    FANUC_LS_FRAMES,
    FANUC_LS_CONFIGURATION,
    FANUC_LS_AXIS,
    FANUC_LS_NUMBER,
    FANUC_LS_AXIS_UNIT,
    FANUC_LS_SPEED_RANGE,
    FANUC_LS_NAME_LENGTH, /* found, expected: the limit */
    FANUC_LS_NAME,
    FANUC_LS_COMMENT,    /* found */
    FANUC_LS_LINE_COUNT, /* expected, found */
    FANUC_LS_UNDEFINED,  /* found: the position's number, here and below */
    FANUC_LS_UNUSED,
    FANUC_LS_REPEATED,
    FANUC_LS_UNTAUGHT,
};

struct fanuc_ls_fault {
    enum fanuc_ls_kind kind;
    const char *at;
    bool is_warning;
    uint64_t expected, found;
};

/* A part of a text that is being read. */
struct fanuc_ls_cursor {
    const char *at, *end;
    char *scratch; /* where the next copied text goes */
    struct fanuc_ls_fault fault;
};

struct fanuc_ls_attribute {
    struct fanuc_ls_text name, value; /* of a list, the value is its items: fanuc_ls_item */
    bool is_list;
};

enum fanuc_ls_target_kind { FANUC_LS_TARGET_NONE, FANUC_LS_TARGET_POSITION, FANUC_LS_TARGET_REGISTER, FANUC_LS_TARGET_OTHER };

struct fanuc_ls_target {
    enum fanuc_ls_target_kind kind;
    uint32_t number;
    struct fanuc_ls_text name; /* of OTHER, all of it */
};

enum fanuc_ls_speed_kind { FANUC_LS_SPEED_FIXED, FANUC_LS_SPEED_REGISTER, FANUC_LS_SPEED_NAMED };

enum fanuc_ls_unit { FANUC_LS_PERCENT, FANUC_LS_SEC, FANUC_LS_MSEC, FANUC_LS_MM_PER_SEC, FANUC_LS_CM_PER_MIN, FANUC_LS_INCH_PER_MIN, FANUC_LS_DEG_PER_SEC };

enum fanuc_ls_termination_kind { FANUC_LS_NO_TERMINATION, FANUC_LS_FINE, FANUC_LS_CNT, FANUC_LS_CNT_REGISTER };

/* LS-46; what a motion does not have is zeros. */
struct fanuc_ls_motion {
    char letter; /* LS-47 */
    struct fanuc_ls_target via, target;
    struct fanuc_ls_text via_options, options;
    enum fanuc_ls_speed_kind speed_kind;
    double speed;
    struct fanuc_ls_text speed_text; /* of REGISTER and NAMED */
    enum fanuc_ls_unit unit;
    enum fanuc_ls_termination_kind termination;
    unsigned cnt;
    struct fanuc_ls_text cnt_register;
};

enum fanuc_ls_instruction_kind {
    FANUC_LS_EMPTY,
    FANUC_LS_COMMENT_LINE,
    FANUC_LS_USER_FRAME,
    FANUC_LS_USER_TOOL,
    FANUC_LS_MOTION,
    FANUC_LS_OTHER,
    FANUC_LS_NESTED,
};

/* LS-53; what an instruction does not have is zeros. */
struct fanuc_ls_instruction {
    enum fanuc_ls_instruction_kind kind;
    uint16_t number;           /* of a frame or a tool */
    struct fanuc_ls_text text; /* of a comment, another one, a nested one */
    struct fanuc_ls_motion motion;
};

/* LS-48: its groups are read by fanuc_ls_next_group, their axes by fanuc_ls_next_axis. */
struct fanuc_ls_position {
    uint32_t number;
    struct fanuc_ls_text name;
    struct fanuc_ls_cursor groups;
};

struct fanuc_ls_group {
    uint8_t number;
    bool has_frame, has_tool; /* not F */
    uint16_t user_frame, user_tool;
    struct fanuc_ls_text keyword, configuration; /* of joints: none */
};

struct fanuc_ls_axis {
    char name[3]; /* J1, X, RX */
    bool is_taught, is_mm;
    double value;
};

enum fanuc_ls_entry_kind { FANUC_LS_HEAD, FANUC_LS_ATTRIBUTE_ENTRY, FANUC_LS_LINE, FANUC_LS_STATEMENT, FANUC_LS_POSITION_ENTRY };

/* What a file has in one piece. */
struct fanuc_ls_entry {
    enum fanuc_ls_entry_kind kind;
    struct fanuc_ls_text place; /* without white space around it */
    struct fanuc_ls_fault fault; /* its kind is FANUC_LS_OK, or the rest is not there */
    struct fanuc_ls_attribute attribute;
    struct fanuc_ls_text line; /* of /APPL */
    struct fanuc_ls_text statement;
    bool is_nested, has_number;
    uint64_t number;
    const char *body; /* where the instruction begins */
    struct fanuc_ls_instruction instruction;
    struct fanuc_ls_position position;
};

/* A file, and how far its entries were read. */
struct fanuc_ls_file {
    struct fanuc_ls_text text, name, kind;
    struct fanuc_ls_text sections[6]; /* /PROG to /END, without their first lines; `at` is NULL: there is none */
    char *scratch;
    enum fanuc_ls_entry_kind next;
    const char *at;
    bool in_block, is_begun;
    uint64_t last;                              /* number of the last statement in no block */
    uint64_t last_found;                        /* LS-50, line_number */
    bool is_counted, is_off;
};

/* Finds the parts of a text; false: it is no LS file, and `fault` says why. `scratch` has the length of the text. */
bool fanuc_ls_open(struct fanuc_ls_file *file, struct fanuc_ls_text text, char *scratch, struct fanuc_ls_fault *fault);

/* Begins again with the first entry. */
void fanuc_ls_rewind(struct fanuc_ls_file *file);

/* The next entry; false: there is none. Its copied texts are there until the next one is read. */
bool fanuc_ls_next(struct fanuc_ls_file *file, struct fanuc_ls_entry *entry);

#define FANUC_LS_MAX_FINDINGS 4

/* The other findings of an entry that was just read, in their order (LS-54); returns how many. */
size_t fanuc_ls_findings(struct fanuc_ls_file *file, const struct fanuc_ls_entry *entry, size_t name_limit,
                         struct fanuc_ls_fault found[FANUC_LS_MAX_FINDINGS]);

/* The next item of a list; false: there is none, or it is none. */
bool fanuc_ls_item(struct fanuc_ls_cursor *items, struct fanuc_ls_text *name, struct fanuc_ls_text *value);

bool fanuc_ls_read_attribute(struct fanuc_ls_cursor *cursor, struct fanuc_ls_attribute *attribute);
bool fanuc_ls_read_instruction(struct fanuc_ls_cursor *cursor, struct fanuc_ls_instruction *instruction);
bool fanuc_ls_read_position(struct fanuc_ls_cursor *cursor, struct fanuc_ls_position *position);
bool fanuc_ls_next_group(struct fanuc_ls_cursor *groups, struct fanuc_ls_group *group);
bool fanuc_ls_next_axis(struct fanuc_ls_cursor *groups, struct fanuc_ls_axis *axis, bool is_first);

/* COMMENT without its quotes (LS-11). */
struct fanuc_ls_text fanuc_ls_comment(const struct fanuc_ls_attribute *attribute);

/* How many characters a text has: columns are counted in them. */
size_t fanuc_ls_characters(struct fanuc_ls_text text);

#ifdef __cplusplus
}
#endif

#endif
