#include "cellwire/ball.h"

#include "session.h"

static struct ball_event *report(struct ball *ball, enum ball_kind kind)
{
    struct ball_event *event = ADD_EVENT(ball);
    event->kind = kind;
    return event;
}

bool ball_init(struct ball *ball, uint8_t sensor_type, uint8_t sensor, bool echo)
{
    memset(ball, 0, sizeof *ball);
    ball->values.sensor_type = sensor_type;
    ball->values.sensor = sensor;
    ball->values.status = ISRA_BALL_OLD;
    ball->returns = echo;
    return sensor_type <= 7 && sensor <= 7;
}

/* IB-34 */
void ball_connected(struct ball *ball)
{
    ball->is_connected = true;
    line_echo_init(&ball->echo, ball->returns);
    ball->is_replying = false;
}

void ball_disconnected(struct ball *ball) { ball->is_connected = ball->is_replying = false; }

/* IB-41, IB-42: how many of the first bytes are not to be read. */
static size_t remove_echo(struct ball *ball, const uint8_t *data, size_t *size)
{
    struct line_echo_error error;
    size_t own = line_echo_begin(&ball->echo, ball->sent, data, size, &error);
    if (error.kind != LINE_ECHO_NONE)
        report(ball, BALL_LINE_ECHO)->echo = error;
    return own;
}

size_t ball_input(struct ball *ball, const uint8_t *data, size_t size)
{
    size_t taken = remove_echo(ball, data, &size);
    for (; taken < size && ball->event_count < BALL_EVENTS - 1; taken++) {
        if (data[taken] != ISRA_BALL_POLL)
            report(ball, BALL_UNKNOWN)->byte = data[taken];
        else if (!ball->is_connected)
            report(ball, BALL_UNEXPECTED);
        else if (ball->is_replying)
            report(ball, BALL_IGNORED); /* IB-35 */
        else
            ball->is_replying = true;
    }
    return line_echo_taken(&ball->echo, size, taken);
}

void ball_measure(struct ball *ball, const int8_t force[3], const int8_t moment[3], uint8_t keys)
{
    memcpy(ball->values.force, force, sizeof ball->values.force);
    memcpy(ball->values.moment, moment, sizeof ball->values.moment);
    ball->values.keys = keys;
    ball->values.status = ISRA_BALL_FRESH;
}

bool ball_event(struct ball *ball, struct ball_event *event) { return TAKE_EVENT(ball, event); }

/* IB-33 */
size_t ball_transmit(struct ball *ball, uint8_t *out, size_t size)
{
    if (!ball->is_replying)
        return 0;
    size_t length = isra_ball_encode(&ball->values, out, size);
    if (length == 0)
        return 0;
    line_echo_sent(&ball->echo, ball->sent, out, length, true);
    report(ball, BALL_REPLY)->packet = ball->values;
    ball->values.status = ISRA_BALL_OLD;
    ball->is_replying = false;
    return length;
}
