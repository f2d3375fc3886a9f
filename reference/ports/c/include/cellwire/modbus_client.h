/* The client of fanuc-hmi-modbus (section 7 of reference/fanuc-hmi-modbus.md). */
#ifndef CELLWIRE_MODBUS_CLIENT_H
#define CELLWIRE_MODBUS_CLIENT_H

#include "cellwire/fanuc_hmi_modbus.h"
#include "cellwire/line_echo.h"
#include "cellwire/modbus_line.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MODBUS_CLIENT_PLACES 8
#define MODBUS_CLIENT_EVENTS 32 /* the outcomes of all places always fit */

/* FM-77; times in nanoseconds. */
struct modbus_client_config {
    enum modbus_line framing;
    unsigned places; /* N, up to MODBUS_CLIENT_PLACES */
    uint64_t silence; /* or stall */
    uint64_t timeout;
    unsigned in_flight;
    bool any_unit, broadcast;
    uint64_t turnaround, settle, pause;
    bool echo; /* the line returns what is sent; not over TCP */
};

/* The defaults of a framing; `baud` is that of a serial line. */
struct modbus_client_config modbus_client_default(enum modbus_line framing, uint32_t baud);

enum modbus_client_stage {
    MODBUS_CLIENT_FREE,
    MODBUS_CLIENT_QUEUED, /* a broadcast, too */
    MODBUS_CLIENT_PROBING, /* queued, and the probe before it is in flight (FM-93) */
    MODBUS_CLIENT_IN_FLIGHT,
    MODBUS_CLIENT_ENDED,
    MODBUS_CLIENT_TIMED_OUT,
    MODBUS_CLIENT_EXPIRED,
};

enum modbus_client_misfit {
    MODBUS_CLIENT_FITS,
    MODBUS_CLIENT_UNIT,     /* expected, found */
    MODBUS_CLIENT_FUNCTION, /* expected, found */
    MODBUS_CLIENT_QUANTITY, /* expected, found: bytes */
    MODBUS_CLIENT_ECHO,
    MODBUS_CLIENT_MALFORMED, /* error */
    MODBUS_CLIENT_DOUBTFUL,  /* FM-84 */
};

enum modbus_client_kind {
    MODBUS_CLIENT_REPLIED,   /* ticket; modbus_client_reply has the reply until another request takes its place */
    MODBUS_CLIENT_ANNOUNCED, /* ticket */
    MODBUS_CLIENT_FAILED,    /* ticket, reason: timed_out, disconnected, not_sent; or NULL: misfit */
    MODBUS_CLIENT_STRAY,     /* unit, function, transaction, late: a ticket or 0; misfit */
    MODBUS_CLIENT_CORRUPT,   /* error */
    MODBUS_CLIENT_OUT_OF_STEP, /* error */
    MODBUS_CLIENT_LINE_ECHO, /* echo: the line returns what is sent, or something else */
    MODBUS_CLIENT_UNEXPECTED,
};

struct modbus_client_event {
    enum modbus_client_kind kind;
    uint64_t ticket, late;
    const char *reason;
    enum modbus_client_misfit misfit;
    uint16_t expected, found;
    struct modbus_fault error;
    struct line_echo_error echo;
    uint16_t transaction;
    uint8_t unit, function;
    size_t place;
};

/* A request, and later its reply. */
struct modbus_client_place {
    enum modbus_client_stage stage;
    bool is_probed;   /* the probe before it has ended (FM-93) */
    bool is_returned; /* a frame that equals it has come while the line was not proven (FM-95) */
    uint64_t ticket, deadline, expired; /* the number of the expiry */
    struct modbus_message message;
};

struct modbus_client {
    struct modbus_client_config config;
    struct modbus_decoder decoder;
    bool is_up, is_busy, is_quiet;
    bool is_partial; /* until `silent_at` the rest of a reply is waited for (FM-86) */
    bool is_cut; /* the last end of the input was that of such a wait */
    bool is_proven; /* FM-93 */
    uint64_t silent_at, quiet_until;
    struct line_echo echo;
    uint8_t sent[MODBUS_MAX_LEN]; /* the last frame, if `echo` looks for it */
    struct modbus_client_place places[MODBUS_CLIENT_PLACES];
    uint64_t tickets, expiries;
    uint16_t transaction; /* the last one */
    bool is_doubtful;     /* corrupt bytes since the last request (FM-84) */
    bool holds;           /* an exception in doubt, after which nothing has come yet */
    struct modbus_item held;
    struct modbus_step step;
    struct modbus_client_event events[MODBUS_CLIENT_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused (FM-56). */
bool modbus_client_init(struct modbus_client *client, const struct modbus_client_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void modbus_client_connected(struct modbus_client *client, uint64_t now);
void modbus_client_disconnected(struct modbus_client *client, uint64_t now);
void modbus_client_timeout(struct modbus_client *client, uint64_t now);

/* Takes bytes, all of them; returns how many. */
size_t modbus_client_input(struct modbus_client *client, uint64_t now, const uint8_t *data, size_t size);

/* Queues a request, whose transaction is not looked at; its ticket, or 0: refused (FM-39). */
uint64_t modbus_client_request(struct modbus_client *client, const struct modbus_message *request);

/* The reply of an event MODBUS_CLIENT_REPLIED. */
const struct modbus_message *modbus_client_reply(const struct modbus_client *client, const struct modbus_client_event *event);

/* The next event; false: there is none. */
bool modbus_client_event(struct modbus_client *client, struct modbus_client_event *event);

/* The bytes that are to be sent now, at most MODBUS_MAX_LEN; 0: nothing. */
size_t modbus_client_transmit(struct modbus_client *client, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called at the latest; false: never. */
bool modbus_client_deadline(const struct modbus_client *client, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
