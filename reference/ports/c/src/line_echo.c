#include "cellwire/line_echo.h"

#include <string.h>

#define BEGINNINGS 3 /* an adapter may give two bytes of noise before */

void line_echo_init(struct line_echo *echo, bool is_set) { *echo = (struct line_echo){.returns = is_set}; }

void line_echo_sent(struct line_echo *echo, uint8_t *sent, const uint8_t *frame, size_t length, bool is_proof)
{
    bool is_asked = echo->returns || is_proof;
    *echo = (struct line_echo){.returns = echo->returns, .unread = echo->unread};
    if (!is_asked)
        return;
    memcpy(sent, frame, length);
    echo->length = length;
    echo->begun = (1 << BEGINNINGS) - 1;
}

/* FM-88, IB-41, LE-113, VV-42 */
static size_t compare(struct line_echo *echo, const uint8_t *sent, const uint8_t *data, size_t size, struct line_echo_error *error)
{
    size_t count = 0;
    for (; count < size && echo->come < echo->length; count++, echo->come++) {
        if (data[count] == sent[echo->come] || echo->has_collided)
            continue;
        echo->has_collided = true;
        error->kind = LINE_ECHO_COLLISION;
        error->offset = echo->come;
        error->expected = sent[echo->come];
        error->found = data[count];
    }
    return count;
}

/* FM-92, IB-42, LE-114, VV-43 */
static size_t look(struct line_echo *echo, const uint8_t *sent, const uint8_t *data, size_t size, struct line_echo_error *error)
{
    for (size_t i = 0; i < size && echo->begun != 0; i++, echo->come++)
        for (unsigned noise = 0; noise < BEGINNINGS && noise <= echo->come; noise++) {
            size_t at = echo->come - noise;
            if ((echo->begun >> noise & 1) == 0)
                continue;
            if (data[i] != sent[at]) {
                echo->begun &= (uint8_t)~(1u << noise);
            } else if (at + 1 == echo->length) {
                error->kind = LINE_ECHO_NOT_SET;
                error->length = echo->length;
                line_echo_init(echo, true);
                return i + 1;
            }
        }
    return 0;
}

size_t line_echo_receive(struct line_echo *echo, const uint8_t *sent, const uint8_t *data, size_t size,
                         struct line_echo_error *error)
{
    *error = (struct line_echo_error){.kind = LINE_ECHO_NONE};
    return echo->returns ? compare(echo, sent, data, size, error) : look(echo, sent, data, size, error);
}

size_t line_echo_begin(struct line_echo *echo, const uint8_t *sent, const uint8_t *data, size_t *size,
                       struct line_echo_error *error)
{
    if (echo->unread == 0)
        return line_echo_receive(echo, sent, data, *size, error);
    *error = (struct line_echo_error){.kind = LINE_ECHO_NONE};
    if (*size > echo->unread)
        *size = echo->unread;
    return 0;
}

size_t line_echo_taken(struct line_echo *echo, size_t size, size_t taken)
{
    echo->unread = size - taken;
    return taken;
}
