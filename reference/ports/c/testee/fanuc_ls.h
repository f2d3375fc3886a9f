/* fanuc-ls: what printing programs and reading them from JSON share. */
#ifndef CELLWIRE_TESTEE_FANUC_LS_H
#define CELLWIRE_TESTEE_FANUC_LS_H

#include "cellwire/fanuc_ls.h"
#include "link.h"

#define MAX_TEXT (1 << 20)

/* The words of JSON, in the order of fanuc_ls_unit; and of motions, in the order of their letters. */
extern const char *const LS_UNITS[7], *const LS_MOTIONS[5];
#define LS_LETTERS "JLCAS"

int64_t name_limit_of(const struct json *request);

#endif
