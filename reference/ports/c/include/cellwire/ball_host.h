/* The host of isra-ball (section 7 of reference/isra-ball.md): polls a ball, and knows how old its values are. */
#ifndef CELLWIRE_BALL_HOST_H
#define CELLWIRE_BALL_HOST_H

#include "cellwire/isra_ball.h"
#include "cellwire/line_echo.h"

#ifdef __cplusplus
extern "C" {
#endif

#define BALL_HOST_EVENTS 64

/* Section 7.1; times in nanoseconds, UINT64_MAX is never. */
struct ball_host_config {
    uint32_t baud;
    uint64_t period, max_delay, max_age;
    bool echo; /* the line returns what is sent */
};

extern const struct ball_host_config BALL_HOST_DEFAULT;

enum ball_host_kind {
    BALL_HOST_NEW,     /* packet, live_until */
    BALL_HOST_OLD,     /* packet */
    BALL_HOST_UNASKED, /* packet */
    BALL_HOST_MISSED,
    BALL_HOST_STALE,
    BALL_HOST_CORRUPT, /* error, error_offset, expected, found; ISRA_BALL_RAW: a packet of `found` data bytes */
    BALL_HOST_LINE_ECHO, /* echo: something else than the poll has come back */
    BALL_HOST_UNEXPECTED,
};

struct ball_host_event {
    enum ball_host_kind kind;
    struct isra_ball_packet packet;
    uint64_t live_until; /* UINT64_MAX: no limit */
    enum isra_ball_kind error;
    size_t length, error_offset, expected, found;
    struct line_echo_error echo;
};

enum ball_host_link { BALL_HOST_DISCONNECTED, BALL_HOST_IDLE, BALL_HOST_WAITING };

struct ball_host {
    struct ball_host_config config;
    uint64_t exchange, window, spread, quiet;
    struct isra_ball_decoder decoder;
    enum ball_host_link link;
    uint64_t due, from, until, proof; /* of the next poll, and of the reply to the last one */
    uint64_t proven;
    bool is_live;
    uint64_t live_until;
    struct line_echo echo;
    uint8_t sent[1]; /* the last poll, if `echo` compares it */
    struct ball_host_event events[BALL_HOST_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused (IB-21, IB-22). */
bool ball_host_init(struct ball_host *host, const struct ball_host_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void ball_host_connected(struct ball_host *host, uint64_t now);
void ball_host_disconnected(struct ball_host *host, uint64_t now);
void ball_host_timeout(struct ball_host *host, uint64_t now);

/* Takes bytes; returns how many. Take the events, then give the rest. */
size_t ball_host_input(struct ball_host *host, uint64_t now, const uint8_t *data, size_t size);

/* The next event; false: there is none. */
bool ball_host_event(struct ball_host *host, struct ball_host_event *event);

/* The bytes that are to be sent now; 0: nothing. */
size_t ball_host_transmit(struct ball_host *host, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called, or a poll may be sent, at the latest; false: never. */
bool ball_host_deadline(const struct ball_host *host, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
