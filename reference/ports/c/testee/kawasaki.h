/* What the ends of kawasaki-msg share: the dialect of a configuration, jobs, and events. */
#ifndef CELLWIRE_TESTEE_KAWASAKI_H
#define CELLWIRE_TESTEE_KAWASAKI_H

#include "cellwire/kawasaki_end.h"
#include "end.h"

/* false: it is not one of the words of reference/README.md. The arrays stay until the next one is read. */
bool read_kawasaki_dialect(const struct json *config, struct kawasaki_dialect *dialect);
void read_kawasaki_limits(const struct json *config, struct kawasaki_limits *limits);

/* A job, as values of the layout; its texts are kept until the next dialect is read. */
bool read_kawasaki_job(const struct kawasaki_dialect *dialect, const struct json *job, struct kawasaki_value *values);
void print_kawasaki_job(const struct kawasaki_dialect *dialect, const struct kawasaki_value *values);

/* An event of a robot or of a PC. */
void print_kawasaki_event(bool is_first, const struct kawasaki_event *event, bool is_robot);

#endif
