/* What the testee needs of an end's session. */
#ifndef CELLWIRE_END_H
#define CELLWIRE_END_H

#include "cellwire/line_echo.h"
#include "link.h"

struct end {
    const char *link, *name;
    /* Begins with the `config` of a request; false: it is refused. */
    bool (*begin)(const struct json *config);
    void (*connected)(uint64_t now);
    void (*disconnected)(uint64_t now);
    size_t (*input)(uint64_t now, const uint8_t *data, size_t size);
    void (*timeout)(uint64_t now);
    void (*transmitted)(uint64_t now); /* NULL: it changes nothing */
    /* A call of the owner; false: refused. */
    bool (*call)(uint64_t now, const char *name, const struct json *argument);
    /* Prints the next event; false: there is none. */
    bool (*event)(bool is_first);
    size_t (*transmit)(uint64_t now, uint8_t *out, size_t size);
    bool (*deadline)(uint64_t *deadline);
};

/* The session of a file, and what calls its functions of the usual names. */
#define ADAPT(prefix)                                                                                                  \
    static struct prefix session;                                                                                      \
    static void connected(uint64_t now) { prefix##_connected(&session, now); }                                         \
    static void disconnected(uint64_t now) { prefix##_disconnected(&session, now); }                                   \
    static size_t input(uint64_t now, const uint8_t *data, size_t size)                                                \
    {                                                                                                                  \
        return prefix##_input(&session, now, data, size);                                                              \
    }                                                                                                                  \
    static void timeout(uint64_t now) { prefix##_timeout(&session, now); }                                             \
    static size_t transmit(uint64_t now, uint8_t *out, size_t size)                                                    \
    {                                                                                                                  \
        return prefix##_transmit(&session, now, out, size);                                                            \
    }                                                                                                                  \
    static bool deadline(uint64_t *at) { return prefix##_deadline(&session, at); }

/* These, and `begin`, `call` and `event` of the file. */
#define END(of_link, of_name)                                                                                          \
    .link = of_link, .name = of_name, .begin = begin, .connected = connected, .disconnected = disconnected,            \
    .input = input, .timeout = timeout, .call = call, .event = event, .transmit = transmit, .deadline = deadline

/* Whether a number of the configuration did not fit its field. */
extern bool is_out_of_range;

/* A time of a configuration that is not there keeps its default; `null` is never. */
void read_time(const struct json *config, const char *name, uint64_t *time);
void read_unsigned(const struct json *config, const char *name, int64_t most, unsigned *number);

enum modbus_line read_modbus_line(const struct json *config);

void begin_event(bool is_first, const char *name);

/* The error of an event `echo`. */
void print_line_echo(const struct line_echo_error *error);

extern const struct end ALTER_CONTROLLER, ALTER_HOST, BALL, BALL_HOST, KAWASAKI_PC, KAWASAKI_ROBOT, LASER_CONTROLLER,
    LASER_HOST, MMACELL_CENTRAL, MMACELL_DEVICE, MODBUS_CLIENT_END, MODBUS_SERVER_END, VIEWER_HOST, VIEWER_WORKSTATION;

#endif
