#include "cellwire/modbus_server.h"

#include "bytes.h"
#include "session.h"

#define KEPT 504 /* FM-62 */
#define MAX_RTU 256
#define ADDRESSES 65536u
#define EXCEPTION 0x80
#define READ_REQUEST 8 /* bytes */

enum { ILLEGAL_FUNCTION = 1, ILLEGAL_ADDRESS, ILLEGAL_VALUE, DEVICE_FAILURE };

static bool is_tcp(const struct modbus_server *server) { return server->config.framing == MODBUS_LINE_TCP; }

static bool is_serial(const struct modbus_server *server) { return server->config.framing == MODBUS_LINE_RTU; }

static bool is_full(const struct modbus_server *server) { return server->reply_count >= server->config.places; }

struct modbus_server_config modbus_server_default(enum modbus_line framing, uint32_t baud)
{
    return (struct modbus_server_config){
        .framing = framing,
        .places = MODBUS_SERVER_PLACES,
        .has_unit = framing != MODBUS_LINE_TCP,
        .unit = 1,
        .broadcast = framing != MODBUS_LINE_TCP,
        .silence = modbus_line_silence(framing, baud),
        .frame_timeout = modbus_line_piece(framing, baud),
    };
}

static struct modbus_server_event *report(struct modbus_server *server, enum modbus_server_kind kind)
{
    struct modbus_server_event *event = ADD_EVENT(server);
    event->kind = kind;
    return event;
}

/* Of what has come of RTU frames. */
static void forget_held(struct modbus_server *server)
{
    server->is_spoiled = false;
    server->length = server->silence_count = 0;
}

/* FM-65 */
static void restart(struct modbus_server *server)
{
    server->is_busy = server->is_partial = false;
    server->reply_count = 0;
    forget_held(server);
    line_echo_init(&server->echo, server->config.echo);
    memset(&server->step, 0, sizeof server->step);
    modbus_init(&server->decoder, MODBUS_CLIENT, MODBUS_TCP); /* not used for RTU, but by `spoil` */
}

bool modbus_server_init(struct modbus_server *server, const struct modbus_server_config *config)
{
    memset(server, 0, sizeof *server);
    server->config = *config;
    bool is_unit = !config->has_unit || config->unit != 0 || !config->broadcast; // FM-67
    bool is_line = config->framing == MODBUS_LINE_TCP ? !config->echo : config->silence > 0;
    return is_line && config->places >= 1 && config->places <= MODBUS_SERVER_PLACES && is_unit;
}

void modbus_server_connected(struct modbus_server *server, uint64_t now)
{
    (void)now;
    restart(server);
    server->is_up = true;
}

void modbus_server_disconnected(struct modbus_server *server, uint64_t now)
{
    (void)now;
    restart(server);
    server->is_up = false;
}

static bool is_broadcast(const struct modbus_server *server, uint8_t unit) { return server->config.broadcast && unit == 0; }

static bool is_own(const struct modbus_server *server, uint8_t unit)
{
    return !server->config.has_unit || unit == server->config.unit;
}

/* Whether a request reaches beyond the last address. */
static bool is_beyond(const struct modbus_message *request)
{
    uint32_t quantity = request->quantity;
    uint32_t first = request->shape == MODBUS_READ_WRITE ? request->read_quantity : quantity;
    return request->address + first > ADDRESSES || request->write_address + quantity > ADDRESSES;
}

/* An exception, also to a function that no encoder writes one to. */
static size_t put_exception(const struct modbus_server *server, const struct modbus_message *request, uint8_t exception, uint8_t *out)
{
    size_t at = 0;
    if (is_tcp(server)) {
        put_u16_be(out, request->transaction);
        put_u16_be(out + 2, 0);
        put_u16_be(out + 4, 3);
        at = 6;
    }
    out[at++] = request->unit;
    out[at++] = (uint8_t)(request->function | EXCEPTION);
    out[at++] = exception;
    if (!is_tcp(server)) {
        put_u16_le(out + at, modbus_crc(out, at));
        at += 2;
    }
    return at;
}

/* FM-64 */
static void serve(struct modbus_server *server, const struct modbus_item *item)
{
    const struct modbus_message *request = &item->message;
    const struct modbus_server_owner *owner = &server->config.owner;
    enum modbus_framing framing = is_tcp(server) ? MODBUS_TCP : MODBUS_RTU;
    struct modbus_message reply = {.transaction = request->transaction, .unit = request->unit, .function = request->function};
    struct modbus_server_reply bytes;
    uint8_t exception = item->error == MODBUS_FUNCTION      ? ILLEGAL_FUNCTION
                        : item->error == MODBUS_REFERENCE_TYPE ? ILLEGAL_ADDRESS
                        : item->error != MODBUS_NO_ERROR    ? ILLEGAL_VALUE
                        : is_beyond(request)                ? ILLEGAL_ADDRESS
                                                            : owner->serve(owner->context, request, &reply);
    if (exception == 0) {
        bytes.length = modbus_encode(&reply, framing, bytes.bytes, sizeof bytes.bytes);
        exception = bytes.length == 0 ? DEVICE_FAILURE : 0;
    }
    struct modbus_server_event *event = report(server, MODBUS_SERVER_SERVED);
    event->transaction = request->transaction;
    event->unit = request->unit;
    event->function = request->function;
    event->exception = exception;
    if (exception != 0)
        bytes.length = put_exception(server, request, exception, bytes.bytes);
    if (!is_broadcast(server, request->unit))
        server->replies[server->reply_count++] = bytes;
}

/* FM-61 */
static void take_request(struct modbus_server *server, const struct modbus_item *item)
{
    if (is_own(server, item->message.unit) || is_broadcast(server, item->message.unit))
        serve(server, item);
}

static void read_tcp(struct modbus_server *server)
{
    struct modbus_item item;
    while (!is_full(server) && modbus_next(&server->decoder, &item)) {
        if (item.error == MODBUS_NO_ERROR || item.error > MODBUS_NOISE) {
            take_request(server, &item);
        } else if (item.error != MODBUS_NOISE) {
            server->step.last = modbus_fault_of(&item);
            report(server, MODBUS_SERVER_CORRUPT)->error = server->step.last;
        }
    }
}

enum found { RTU_FRAME, NO_FRAME, WAIT };

/* FM-82: what is at the beginning of `d`; `*needs` says whether one of its lengths needs more bytes. What only a reply is as long as is
 * another unit's, and so is no request that is taken. */
static enum found find_frame(const struct modbus_server *server, const uint8_t *d, size_t length, bool ended, size_t *size, bool *needs)
{
    size_t longest = 0;
    bool is_asked = is_own(server, d[0]) || d[0] == 0;
    *needs = false;
    for (int side = MODBUS_CLIENT; side <= (is_asked ? MODBUS_CLIENT : MODBUS_SERVER); side++) {
        size_t n;
        modbus_rtu_length(d, length, (enum modbus_side)side, &n);
        if (n > MAX_RTU || n == 0)
            continue;
        if (n > length)
            *needs = true;
        else if (n > longest && modbus_is_right(d, n))
            longest = n;
    }
    if (ended && (is_serial(server) || !*needs) && modbus_is_right(d, length)) {
        *size = length;
        return RTU_FRAME;
    }
    *size = longest;
    if (!ended && *needs)
        return WAIT;
    if (longest != 0)
        return RTU_FRAME;
    return ended ? NO_FRAME : WAIT;
}

/* The error of bytes that are no frames: that of a request. */
static struct modbus_fault fault_of(struct modbus_server *server, const uint8_t *d, size_t length)
{
    struct modbus_item item;
    modbus_init(&server->decoder, MODBUS_CLIENT, MODBUS_RTU);
    modbus_push(&server->decoder, d, length);
    modbus_end(&server->decoder);
    modbus_is_corrupt(&server->decoder, &item);
    return modbus_fault_of(&item);
}

static void drop(struct modbus_server *server, size_t count)
{
    size_t kept = 0;
    bytes_remove(server->held, &server->length, count);
    for (size_t i = 0; i < server->silence_count; i++)
        if (server->silences[i] > count)
            server->silences[kept++] = server->silences[i] - count;
    server->silence_count = kept;
}

/* One error for all bytes up to the next silence, where it is reported. */
static void spoil(struct modbus_server *server)
{
    server->fault = fault_of(server, server->held, server->length);
    if (!server->is_busy)
        report(server, MODBUS_SERVER_CORRUPT)->error = server->fault;
    drop(server, server->length);
    server->is_spoiled = true;
}

/* A request of a serial line that another frame has followed, or that has no place (FM-62). */
static void take_followed(struct modbus_server *server, const struct modbus_item *item)
{
    uint8_t unit = item->message.unit;
    if (is_broadcast(server, unit)) {
        serve(server, item);
    } else if (is_own(server, unit)) {
        struct modbus_server_event *event = report(server, MODBUS_SERVER_REFUSED);
        event->unit = unit;
        event->function = item->message.function;
    }
}

/* How many of the bytes are behind the frames at their beginning, where they have ended. */
static size_t behind_frames(const struct modbus_server *server, const uint8_t *d, size_t length)
{
    size_t size;
    bool needs;
    while (length != 0 && find_frame(server, d, length, true, &size, &needs) == RTU_FRAME) {
        d += size;
        length -= size;
    }
    return length;
}

/* Whether the silence shows the length of a frame that begins so. */
static bool is_ended_by_silence(const struct modbus_server *server, const uint8_t *d, size_t length)
{
    size_t n;
    bool is_asked = is_own(server, d[0]) || d[0] == 0;
    modbus_rtu_length(d, length, MODBUS_CLIENT, &n);
    if (n != 0 && !is_asked)
        modbus_rtu_length(d, length, MODBUS_SERVER, &n);
    return n == 0;
}

/* FM-87 */
static bool may_go_on(const struct modbus_server *server)
{
    const uint8_t *d = server->held;
    size_t length = server->length, size;
    bool needs = true;
    while (length != 0 && find_frame(server, d, length, false, &size, &needs) == RTU_FRAME) {
        d += size;
        length -= size;
    }
    if (length == 0 || needs)
        return true;
    if (length > MAX_RTU || !is_ended_by_silence(server, d, length))
        return false;
    for (size_t i = 0; i < server->silence_count; i++) {
        size_t at = server->silences[i];
        if (at < server->length && behind_frames(server, server->held + at, server->length - at) == 0)
            return false;
    }
    return true;
}

/* What is held up to the first silence within it is no frames (FM-87). */
static void give_up_piece(struct modbus_server *server)
{
    size_t end = server->silence_count != 0 && server->silences[0] < server->length ? server->silences[0] : server->length;
    size_t left = behind_frames(server, server->held, end);
    size_t length = left != 0 ? end : server->length;
    if (left == 0)
        left = behind_frames(server, server->held, length);
    report(server, MODBUS_SERVER_CORRUPT)->error = fault_of(server, server->held + length - left, left);
    drop(server, end);
}

/* A serial line was silent, or the rest of a request has not come: what is held is frames to its end, or nothing is carried out. */
static void judge_serial(struct modbus_server *server, uint64_t now, bool is_pause)
{
    struct modbus_item item;
    size_t size;
    bool needs;
    while (behind_frames(server, server->held, server->length) != 0) {
        if (!is_pause || !may_go_on(server)) {
            give_up_piece(server);
            continue;
        }
        if (server->silence_count < MODBUS_SERVER_SILENCES)
            server->silences[server->silence_count++] = server->length;
        while (server->length != 0 && find_frame(server, server->held, server->length, false, &size, &needs) == RTU_FRAME) {
            modbus_decode_rtu(server->held, size, MODBUS_CLIENT, &item);
            take_followed(server, &item);
            drop(server, size);
        }
        server->is_busy = server->is_partial = true;
        server->silent_at = after(now, server->config.frame_timeout);
        return;
    }
    while (server->length != 0) {
        find_frame(server, server->held, server->length, true, &size, &needs);
        modbus_decode_rtu(server->held, size, MODBUS_CLIENT, &item);
        if (size == server->length && !is_full(server))
            take_request(server, &item);
        else
            take_followed(server, &item);
        drop(server, size);
    }
}

/* FM-63 */
static void shorten(struct modbus_server *server)
{
    struct modbus_item item;
    size_t size;
    bool needs;
    while (server->length > MAX_RTU) {
        if (find_frame(server, server->held, server->length, true, &size, &needs) == NO_FRAME) {
            spoil(server);
            return;
        }
        modbus_decode_rtu(server->held, size, MODBUS_CLIENT, &item);
        if (is_own(server, item.message.unit) || item.message.unit == 0) {
            struct modbus_server_event *event = report(server, MODBUS_SERVER_REFUSED);
            event->unit = item.message.unit;
            event->function = item.message.function;
        }
        drop(server, size);
    }
}

/* RTU over TCP: frames from the beginning of what is held, as they come. */
static void read_rtu(struct modbus_server *server, bool ended)
{
    struct modbus_item item;
    size_t size;
    bool needs;
    while (!is_full(server)) {
        enum found found = find_frame(server, server->held, server->length, ended, &size, &needs);
        if (found == WAIT || (found == NO_FRAME && needs))
            return;
        if (found == NO_FRAME) {
            spoil(server);
            return;
        }
        modbus_decode_rtu(server->held, size, MODBUS_CLIENT, &item);
        take_request(server, &item);
        drop(server, size);
    }
}

static size_t input_tcp(struct modbus_server *server, const uint8_t *data, size_t size)
{
    struct modbus_fault error;
    size_t taken = 0, more;
    do {
        more = is_full(server) && server->decoder.length >= KEPT ? 0 : modbus_push(&server->decoder, data + taken, size - taken);
        taken += more;
        read_tcp(server);
    } while (more != 0);
    if (modbus_step_is_lost(&server->step, &server->decoder, &error))
        report(server, MODBUS_SERVER_OUT_OF_STEP)->error = error;
    return taken;
}

/* FM-88, FM-92: how many of the first bytes are not to be read. */
static size_t remove_echo(struct modbus_server *server, const uint8_t *data, size_t size)
{
    struct line_echo_error error;
    size_t own = line_echo_receive(&server->echo, server->sent, data, size, &error);
    if (error.kind == LINE_ECHO_NOT_SET)
        forget_held(server);
    if (error.kind != LINE_ECHO_NONE)
        report(server, MODBUS_SERVER_LINE_ECHO)->echo = error;
    return own;
}

size_t modbus_server_input(struct modbus_server *server, uint64_t now, const uint8_t *data, size_t size)
{
    if (!server->is_up) {
        report(server, MODBUS_SERVER_UNEXPECTED);
        return size;
    }
    if (is_tcp(server))
        return input_tcp(server, data, size);
    size_t taken = remove_echo(server, data, size);
    if (taken == size)
        return size;
    server->is_busy = true;
    server->is_partial = false;
    server->silent_at = after(now, server->config.silence);
    for (; taken < size; taken++) {
        if (!is_serial(server) && is_full(server) && server->length >= KEPT)
            break;
        if (server->length == MODBUS_SERVER_HELD)
            shorten(server);
        if (server->is_spoiled)
            continue;
        server->held[server->length++] = data[taken];
        if (!is_serial(server))
            read_rtu(server, false);
    }
    return taken;
}

/* FM-83 */
void modbus_server_timeout(struct modbus_server *server, uint64_t now)
{
    if (now < server->silent_at || (!is_serial(server) && is_full(server)))
        return;
    bool is_pause = !server->is_partial;
    server->is_busy = server->is_partial = false;
    if (server->is_spoiled)
        report(server, MODBUS_SERVER_CORRUPT)->error = server->fault;
    else if (is_serial(server))
        judge_serial(server, now, is_pause);
    else
        read_rtu(server, true);
    server->is_spoiled = false;
}

bool modbus_server_event(struct modbus_server *server, struct modbus_server_event *event) { return TAKE_EVENT(server, event); }

/* FM-92 */
static bool is_proof(const uint8_t *reply, size_t length)
{
    return length > READ_REQUEST && modbus_asks(reply[1]);
}

/* FM-60 */
size_t modbus_server_transmit(struct modbus_server *server, uint64_t now, uint8_t *out, size_t size)
{
    bool was_full = is_full(server);
    if (server->reply_count == 0 || size < MODBUS_MAX_LEN || (is_serial(server) && server->is_busy && !server->is_partial))
        return 0;
    size_t length = server->replies[0].length;
    memcpy(out, server->replies[0].bytes, length);
    memmove(server->replies, server->replies + 1, --server->reply_count * sizeof *server->replies);
    if (is_tcp(server)) {
        read_tcp(server);
        return length;
    }
    line_echo_sent(&server->echo, server->sent, out, length, is_proof(out, length));
    if (!is_serial(server)) {
        if (was_full)
            server->silent_at = after(now, server->config.silence);
        read_rtu(server, false);
    }
    return length;
}

/* FM-66 */
bool modbus_server_deadline(const struct modbus_server *server, uint64_t *deadline)
{
    *deadline = server->silent_at;
    return server->is_busy && (is_serial(server) || !is_full(server));
}
