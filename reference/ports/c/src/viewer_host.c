#include "cellwire/viewer_host.h"

#include "session.h"

const struct viewer_host_config VIEWER_HOST_DEFAULT = {.interval = 150 * MS, .max_age = 200 * MS, .max_hold = 5 * SECOND};

static struct viewer_host_event *report(struct viewer_host *host, enum viewer_host_kind kind)
{
    struct viewer_host_event *event = ADD_EVENT(host);
    event->kind = kind;
    return event;
}

bool viewer_host_init(struct viewer_host *host, const struct viewer_host_config *config)
{
    memset(host, 0, sizeof *host);
    host->config = *config;
    return config->interval > 0 && config->max_age > 0 && config->max_hold > 0;
}

/* VV-19, VV-22 */
void viewer_host_connected(struct viewer_host *host, uint64_t now)
{
    viewer_host_timeout(host, now);
    host->link = VIEWER_HOST_READY;
    host->from = after(now, host->config.interval);
    host->is_held = false;
    line_echo_init(&host->echo, host->config.echo);
}

void viewer_host_disconnected(struct viewer_host *host, uint64_t now)
{
    viewer_host_timeout(host, now);
    host->link = VIEWER_HOST_DISCONNECTED;
    host->is_held = false;
}

/* VV-23, VV-38 */
void viewer_host_timeout(struct viewer_host *host, uint64_t now)
{
    if (host->is_known && now >= host->until) {
        host->is_known = false;
        report(host, VIEWER_HOST_STALE);
    }
    if (host->is_held && now >= host->hold) {
        host->is_held = false;
        report(host, VIEWER_HOST_HOLD_ENDED);
    }
}

static void take_byte(struct viewer_host *host, uint64_t now, uint8_t byte)
{
    bool is_handshake = byte == VAL2_VIEWER_XON || byte == VAL2_VIEWER_XOFF;
    if (byte != VAL2_VIEWER_REQUEST && !is_handshake) {
        report(host, VIEWER_HOST_UNKNOWN)->byte = byte;
    } else if (host->link == VIEWER_HOST_DISCONNECTED) {
        report(host, VIEWER_HOST_UNEXPECTED);
    } else if (is_handshake) {
        host->is_held = byte == VAL2_VIEWER_XOFF;
        host->hold = after(now, host->config.max_hold);
    } else {
        report(host, host->link == VIEWER_HOST_READY ? VIEWER_HOST_ASKED : VIEWER_HOST_IGNORED); /* VV-20 */
        host->link = VIEWER_HOST_WAS_ASKED;
    }
}

/* VV-42, VV-43: how many of the first bytes are not to be read. */
static size_t remove_echo(struct viewer_host *host, const uint8_t *data, size_t *size)
{
    struct line_echo_error error;
    size_t own = line_echo_begin(&host->echo, host->sent, data, size, &error);
    if (error.kind != LINE_ECHO_NONE)
        report(host, VIEWER_HOST_LINE_ECHO)->echo = error;
    return own;
}

size_t viewer_host_input(struct viewer_host *host, uint64_t now, const uint8_t *data, size_t size)
{
    viewer_host_timeout(host, now);
    size_t taken = remove_echo(host, data, &size);
    for (; taken < size && host->event_count < VIEWER_HOST_EVENTS / 2; taken++)
        take_byte(host, now, data[taken]);
    return line_echo_taken(&host->echo, size, taken);
}

void viewer_host_set_pose(struct viewer_host *host, uint64_t now, const int16_t words[VAL2_VIEWER_WORDS])
{
    viewer_host_timeout(host, now);
    memcpy(host->pose.words, words, sizeof host->pose.words);
    host->is_known = true;
    host->until = after(now, host->config.max_age);
}

bool viewer_host_event(struct viewer_host *host, struct viewer_host_event *event) { return TAKE_EVENT(host, event); }

size_t viewer_host_transmit(struct viewer_host *host, uint64_t now, uint8_t *out, size_t size)
{
    viewer_host_timeout(host, now);
    bool may_send = host->link == VIEWER_HOST_WAS_ASKED && now >= host->from && host->is_known && !host->is_held;
    if (!may_send || host->event_count == VIEWER_HOST_EVENTS)
        return 0;
    size_t length = val2_viewer_encode(&host->pose, out, size);
    if (length == 0)
        return 0;
    line_echo_sent(&host->echo, host->sent, out, length, true);
    report(host, VIEWER_HOST_SENT)->pose = host->pose;
    host->pose.count++;
    host->link = VIEWER_HOST_READY;
    host->from = after(now, host->config.interval);
    return length;
}

/* VV-34 */
bool viewer_host_deadline(const struct viewer_host *host, uint64_t *deadline)
{
    bool waits = host->link == VIEWER_HOST_WAS_ASKED && host->is_known && !host->is_held;
    *deadline = NEVER;
    if (host->is_known)
        *deadline = sooner(*deadline, host->until);
    if (waits)
        *deadline = sooner(*deadline, host->from);
    if (host->is_held)
        *deadline = sooner(*deadline, host->hold);
    return *deadline != NEVER;
}
