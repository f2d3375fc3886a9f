/* The ball of isra-ball (section 8 of reference/isra-ball.md): answers polls with what its sensor has measured. */
#ifndef CELLWIRE_BALL_H
#define CELLWIRE_BALL_H

#include "cellwire/isra_ball.h"
#include "cellwire/line_echo.h"

#ifdef __cplusplus
extern "C" {
#endif

#define BALL_EVENTS 16

enum ball_kind {
    BALL_REPLY, /* packet */
    BALL_IGNORED,
    BALL_UNKNOWN, /* byte */
    BALL_LINE_ECHO, /* echo: the line returns what is sent, or something else */
    BALL_UNEXPECTED,
};

struct ball_event {
    enum ball_kind kind;
    struct isra_ball_packet packet;
    uint8_t byte;
    struct line_echo_error echo;
};

struct ball {
    struct isra_ball_packet values; /* the newest ones; `status` says whether they were sent */
    bool is_connected, is_replying;
    bool returns; /* the line returns what is sent: the setting `echo` */
    struct line_echo echo;
    uint8_t sent[ISRA_BALL_PACKET_LEN]; /* the last packet, if `echo` looks for it */
    struct ball_event events[BALL_EVENTS];
    size_t event_count;
};

/* `echo`: the line returns what is sent. false: a type or number above 7 (IB-32). */
bool ball_init(struct ball *ball, uint8_t sensor_type, uint8_t sensor, bool echo);

/* After each of these: take the events, then what is to be transmitted. A ball has no deadlines. */
void ball_connected(struct ball *ball);
void ball_disconnected(struct ball *ball);

/* Takes bytes; returns how many. Take the events, then give the rest. */
size_t ball_input(struct ball *ball, const uint8_t *data, size_t size);

/* The sensor has measured. */
void ball_measure(struct ball *ball, const int8_t force[3], const int8_t moment[3], uint8_t keys);

/* The next event; false: there is none. */
bool ball_event(struct ball *ball, struct ball_event *event);

/* The bytes that are to be sent now, at most ISRA_BALL_PACKET_LEN; 0: nothing. */
size_t ball_transmit(struct ball *ball, uint8_t *out, size_t size);

#ifdef __cplusplus
}
#endif

#endif
