/* fanuc-ls: TP programs as text, written (section 6). Every function returns false where LS-37 refuses, where `out` has no room, and from
 * there on; then nothing of the whole program is to be used. They are called in the order of a file. */
#ifndef CELLWIRE_FANUC_LS_WRITE_H
#define CELLWIRE_FANUC_LS_WRITE_H

#include "cellwire/fanuc_ls.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fanuc_ls_writer {
    char *out;
    size_t size, length;
    char *scratch; /* for what is read again; as long as the longest part */
    uint64_t last; /* number of the last statement */
    bool in_block, is_wrong;
};

struct fanuc_ls_pair {
    struct fanuc_ls_text name, value;
};

void fanuc_ls_writer_init(struct fanuc_ls_writer *writer, char *out, size_t size, char *scratch);

/* `kind.at` is NULL: there is none. */
bool fanuc_ls_write_head(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, struct fanuc_ls_text kind, size_t name_limit);

/* "/ATTR", "/APPL", "/MN", "/POS" or "/END" */
bool fanuc_ls_write_section(struct fanuc_ls_writer *writer, const char *name);

bool fanuc_ls_write_attribute(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, struct fanuc_ls_text value, bool cut_comment);
bool fanuc_ls_write_list(struct fanuc_ls_writer *writer, struct fanuc_ls_text name, const struct fanuc_ls_pair *items, size_t count);
bool fanuc_ls_write_line(struct fanuc_ls_writer *writer, struct fanuc_ls_text line);
bool fanuc_ls_write_instruction(struct fanuc_ls_writer *writer, const struct fanuc_ls_instruction *instruction);
bool fanuc_ls_write_position(struct fanuc_ls_writer *writer, uint32_t number, struct fanuc_ls_text name);
bool fanuc_ls_write_group(struct fanuc_ls_writer *writer, const struct fanuc_ls_group *group, const struct fanuc_ls_axis *axes, size_t count);
bool fanuc_ls_write_position_end(struct fanuc_ls_writer *writer);

#ifdef __cplusplus
}
#endif

#endif
