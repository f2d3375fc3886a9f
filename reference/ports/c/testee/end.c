#include "end.h"

bool is_out_of_range;

void read_time(const struct json *config, const char *name, uint64_t *time)
{
    const struct json *value = json_get(config, name);
    int64_t number;
    if (json_integer(value, 0, INT64_MAX - 1, &number))
        *time = (uint64_t)number;
    else if (value != NULL && (value->type == '0' || value->type == 'n'))
        *time = UINT64_MAX; /* longer than 63 bits: never */
}

void read_unsigned(const struct json *config, const char *name, int64_t most, unsigned *number)
{
    const struct json *value = json_get(config, name);
    int64_t found;
    if (json_integer(value, 0, most, &found))
        *number = (unsigned)found;
    else if (value != NULL && value->type == '0')
        is_out_of_range = true;
}

void begin_event(bool is_first, const char *name) { print("%s{\"event\":\"%s\"", is_first ? "" : ",", name); }

void print_line_echo(const struct line_echo_error *error)
{
    if (error->kind == LINE_ECHO_NOT_SET)
        print(",\"error\":{\"kind\":\"not_set\",\"length\":%u}", (unsigned)error->length);
    else
        print(",\"error\":{\"kind\":\"collision\",\"offset\":%u,\"expected\":%u,\"found\":%u}", (unsigned)error->offset,
              error->expected, error->found);
}

enum modbus_line read_modbus_line(const struct json *config)
{
    const struct json *framing = json_get(config, "framing");
    return json_is(framing, "rtu")            ? MODBUS_LINE_RTU
           : json_is(framing, "rtu_over_tcp") ? MODBUS_LINE_RTU_OVER_TCP
                                              : MODBUS_LINE_TCP;
}
