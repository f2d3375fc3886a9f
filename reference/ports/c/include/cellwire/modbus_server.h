/* The server of fanuc-hmi-modbus (section 8 of reference/fanuc-hmi-modbus.md). Its tables are its owner's. */
#ifndef CELLWIRE_MODBUS_SERVER_H
#define CELLWIRE_MODBUS_SERVER_H

#include "cellwire/fanuc_hmi_modbus.h"
#include "cellwire/line_echo.h"
#include "cellwire/modbus_line.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MODBUS_SERVER_PLACES 8
#define MODBUS_SERVER_EVENTS 32
#define MODBUS_SERVER_HELD 1024 /* FM-63 */
#define MODBUS_SERVER_SILENCES 32 /* the places of silences that are kept within them (FM-87) */

/* The owner carries out a request, whose addresses are below 65536, and writes the reply: its shape and what the shape has. Returns an
 * exception (1: no such function, 2: no such place, …), which MUST leave everything as it was, or 0. */
struct modbus_server_owner {
    void *context;
    uint8_t (*serve)(void *context, const struct modbus_message *request, struct modbus_message *reply);
};

/* FM-79; times in nanoseconds. */
struct modbus_server_config {
    enum modbus_line framing;
    unsigned places; /* N, up to MODBUS_SERVER_PLACES */
    bool has_unit;   /* else every unit is answered */
    uint8_t unit;
    bool broadcast;
    uint64_t silence; /* or stall */
    uint64_t frame_timeout;
    bool echo; /* the line returns what is sent; not over TCP */
    struct modbus_server_owner owner;
};

/* The defaults of a framing, with unit 1 on serial lines; `baud` is the rate of one. All but the owner. */
struct modbus_server_config modbus_server_default(enum modbus_line framing, uint32_t baud);

enum modbus_server_kind {
    MODBUS_SERVER_SERVED,  /* transaction, unit, function, exception or 0 */
    MODBUS_SERVER_REFUSED, /* unit, function */
    MODBUS_SERVER_CORRUPT, /* error */
    MODBUS_SERVER_OUT_OF_STEP, /* error */
    MODBUS_SERVER_LINE_ECHO, /* echo: the line returns what is sent, or something else */
    MODBUS_SERVER_UNEXPECTED,
};

struct modbus_server_event {
    enum modbus_server_kind kind;
    uint16_t transaction;
    uint8_t unit, function, exception;
    struct modbus_fault error;
    struct line_echo_error echo;
};

struct modbus_server_reply {
    uint8_t bytes[MODBUS_MAX_LEN];
    size_t length;
};

struct modbus_server {
    struct modbus_server_config config;
    bool is_up, is_busy;
    bool is_partial; /* until `silent_at` the rest of a request is waited for (FM-87) */
    uint64_t silent_at;
    struct modbus_decoder decoder; /* TCP */
    struct modbus_step step;
    uint8_t held[MODBUS_SERVER_HELD]; /* RTU */
    size_t length;
    size_t silences[MODBUS_SERVER_SILENCES]; /* within them */
    size_t silence_count;
    bool is_spoiled; /* what comes before the next silence is no frame */
    struct modbus_fault fault; /* of these bytes */
    struct line_echo echo;
    uint8_t sent[MODBUS_MAX_LEN]; /* the last frame, if `echo` looks for it */
    struct modbus_server_reply replies[MODBUS_SERVER_PLACES];
    size_t reply_count;
    struct modbus_server_event events[MODBUS_SERVER_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused (FM-67, FM-79). */
bool modbus_server_init(struct modbus_server *server, const struct modbus_server_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void modbus_server_connected(struct modbus_server *server, uint64_t now);
void modbus_server_disconnected(struct modbus_server *server, uint64_t now);
void modbus_server_timeout(struct modbus_server *server, uint64_t now);

/* Takes bytes, as many as fit; returns how many. Take the events and what is to be transmitted, then give the rest. */
size_t modbus_server_input(struct modbus_server *server, uint64_t now, const uint8_t *data, size_t size);

/* The next event; false: there is none. */
bool modbus_server_event(struct modbus_server *server, struct modbus_server_event *event);

/* The bytes that are to be sent now, at most MODBUS_MAX_LEN; 0: nothing. */
size_t modbus_server_transmit(struct modbus_server *server, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called at the latest; false: never. */
bool modbus_server_deadline(const struct modbus_server *server, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
