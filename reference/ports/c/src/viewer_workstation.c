#include "cellwire/viewer_workstation.h"

#include "session.h"

#define DISPLAY_CYCLE (200 * MS)
#define PLACES 8
#define NEEDED 3 /* VV-28 */

const struct viewer_workstation_config VIEWER_WORKSTATION_DEFAULT = {
    .pause = 2 * SECOND, .stale_after = 1500 * MS, .max_hold = 5 * SECOND};

static struct viewer_workstation_event *report(struct viewer_workstation *station, enum viewer_workstation_kind kind)
{
    struct viewer_workstation_event *event = ADD_EVENT(station);
    event->kind = kind;
    return event;
}

bool viewer_workstation_init(struct viewer_workstation *station, const struct viewer_workstation_config *config)
{
    memset(station, 0, sizeof *station);
    station->config = *config;
    return config->pause > DISPLAY_CYCLE && config->stale_after > DISPLAY_CYCLE && config->max_hold > 0;
}

/* VV-29 */
static void lose_picture(struct viewer_workstation *station)
{
    if (station->is_live)
        report(station, VIEWER_WORKSTATION_STALE);
    station->is_live = false;
}

static void restart(struct viewer_workstation *station, enum viewer_workstation_request request)
{
    if (station->request == VIEWER_WORKSTATION_WAITING)
        report(station, VIEWER_WORKSTATION_MISSED);
    lose_picture(station);
    station->request = request;
    station->is_held = false;
    val2_viewer_init(&station->decoder); /* VV-30 */
}

void viewer_workstation_connected(struct viewer_workstation *station, uint64_t now)
{
    viewer_workstation_timeout(station, now);
    restart(station, VIEWER_WORKSTATION_ALLOWED);
    line_echo_init(&station->echo, station->config.echo);
}

void viewer_workstation_disconnected(struct viewer_workstation *station, uint64_t now)
{
    viewer_workstation_timeout(station, now);
    restart(station, VIEWER_WORKSTATION_DISCONNECTED);
}

void viewer_workstation_timeout(struct viewer_workstation *station, uint64_t now)
{
    if (now >= station->live_until)
        lose_picture(station);
    if (station->request == VIEWER_WORKSTATION_WAITING && now >= station->missed_from) { /* VV-40 */
        station->request = VIEWER_WORKSTATION_OVERDUE;
        report(station, VIEWER_WORKSTATION_MISSED);
    }
    if (station->is_held && now >= station->hold) {
        station->is_held = false;
        report(station, VIEWER_WORKSTATION_HOLD_ENDED);
    }
}

/* VV-25, VV-27 */
void viewer_workstation_draw(struct viewer_workstation *station, uint64_t now)
{
    viewer_workstation_timeout(station, now);
    bool is_waiting = station->request == VIEWER_WORKSTATION_WAITING;
    bool is_asked = is_waiting || station->request == VIEWER_WORKSTATION_OVERDUE;
    bool is_paused = is_asked && now >= station->again_from;
    if (is_waiting && is_paused)
        report(station, VIEWER_WORKSTATION_MISSED);
    if (is_paused || station->request == VIEWER_WORKSTATION_ALLOWED)
        station->request = VIEWER_WORKSTATION_DUE;
    else
        station->again_from = after(now, station->config.pause);
}

/* VV-41 */
static void take_pose(struct viewer_workstation *station, uint64_t now, const struct val2_viewer_item *item)
{
    bool is_answer = station->request == VIEWER_WORKSTATION_WAITING;
    if (station->request == VIEWER_WORKSTATION_DISCONNECTED) {
        report(station, VIEWER_WORKSTATION_UNEXPECTED);
        return;
    }
    struct viewer_workstation_event *event =
        report(station, is_answer ? VIEWER_WORKSTATION_POSE : VIEWER_WORKSTATION_UNASKED);
    event->item = *item;
    if (is_answer) {
        station->is_live = true;
        station->live_until = event->live_until = after(now, station->config.stale_after);
    }
    if (station->request != VIEWER_WORKSTATION_DUE)
        station->request = VIEWER_WORKSTATION_ALLOWED;
}

/* VV-26 */
static void take_corrupt(struct viewer_workstation *station, const struct val2_viewer_item *item)
{
    bool is_whole = item->kind <= VAL2_VIEWER_TOO_LONG;
    report(station, VIEWER_WORKSTATION_CORRUPT)->item = *item;
    if (station->request == VIEWER_WORKSTATION_DISCONNECTED) {
        report(station, VIEWER_WORKSTATION_UNEXPECTED);
    } else if (is_whole && station->request != VIEWER_WORKSTATION_DUE) {
        if (station->request == VIEWER_WORKSTATION_WAITING)
            report(station, VIEWER_WORKSTATION_MISSED);
        station->request = VIEWER_WORKSTATION_ALLOWED;
    }
}

static void take_byte(struct viewer_workstation *station, uint64_t now, uint8_t byte)
{
    struct val2_viewer_item item;
    if (byte == VAL2_VIEWER_XON || byte == VAL2_VIEWER_XOFF) { /* VV-37 */
        if (station->request == VIEWER_WORKSTATION_DISCONNECTED)
            report(station, VIEWER_WORKSTATION_UNEXPECTED);
        else
            station->is_held = byte == VAL2_VIEWER_XOFF;
        station->hold = after(now, station->config.max_hold);
        return;
    }
    val2_viewer_push(&station->decoder, &byte, 1);
    while (val2_viewer_next(&station->decoder, &item)) {
        if (item.kind == VAL2_VIEWER_POSE)
            take_pose(station, now, &item);
        else
            take_corrupt(station, &item);
    }
}

/* VV-42, VV-43: how many of the first bytes are not to be read. */
static size_t remove_echo(struct viewer_workstation *station, const uint8_t *data, size_t *size)
{
    struct line_echo_error error;
    size_t own = line_echo_begin(&station->echo, station->sent, data, size, &error);
    if (error.kind == LINE_ECHO_NOT_SET)
        val2_viewer_init(&station->decoder);
    if (error.kind != LINE_ECHO_NONE)
        report(station, VIEWER_WORKSTATION_LINE_ECHO)->echo = error;
    return own;
}

size_t viewer_workstation_input(struct viewer_workstation *station, uint64_t now, const uint8_t *data, size_t size)
{
    viewer_workstation_timeout(station, now);
    size_t taken = remove_echo(station, data, &size);
    for (; taken < size && station->event_count < VIEWER_WORKSTATION_EVENTS / 2; taken++)
        take_byte(station, now, data[taken]);
    return line_echo_taken(&station->echo, size, taken);
}

bool viewer_workstation_event(struct viewer_workstation *station, struct viewer_workstation_event *event)
{
    return TAKE_EVENT(station, event);
}

/* Events that wait, but for notices. */
static size_t outcomes(const struct viewer_workstation *station)
{
    size_t count = 0;
    for (size_t i = 0; i < station->event_count; i++) {
        enum viewer_workstation_kind kind = station->events[i].kind;
        count += kind == VIEWER_WORKSTATION_POSE || kind == VIEWER_WORKSTATION_MISSED || kind == VIEWER_WORKSTATION_STALE;
    }
    return count;
}

size_t viewer_workstation_transmit(struct viewer_workstation *station, uint64_t now, uint8_t *out, size_t size)
{
    viewer_workstation_timeout(station, now);
    bool may_ask = station->request == VIEWER_WORKSTATION_DUE && !station->is_held;
    if (!may_ask || size < 1 || outcomes(station) + NEEDED > PLACES)
        return 0;
    station->request = VIEWER_WORKSTATION_WAITING;
    station->again_from = after(now, station->config.pause);
    station->missed_from = after(now, station->config.stale_after);
    out[0] = VAL2_VIEWER_REQUEST;
    line_echo_sent(&station->echo, station->sent, out, 1, false);
    return 1;
}

/* VV-35 */
bool viewer_workstation_deadline(const struct viewer_workstation *station, uint64_t *deadline)
{
    bool is_waiting = station->request == VIEWER_WORKSTATION_WAITING;
    *deadline = NEVER;
    if (station->is_live)
        *deadline = sooner(*deadline, station->live_until);
    if (is_waiting)
        *deadline = sooner(*deadline, station->missed_from);
    if (station->is_held)
        *deadline = sooner(*deadline, station->hold);
    return *deadline != NEVER;
}
