/* val2-alter: the host accepts a start */
#include <cellwire/val2_alter.h>

int main(void)
{
    const struct val2_alter_message accept = {.kind = VAL2_ALTER_START_REPLY, .answer = 0x00};
    const struct val2_alter_framing framing = {.leading_dle = 2};
    uint8_t frame[VAL2_ALTER_MAX_LEN];
    return val2_alter_encode(&accept, framing, frame, sizeof frame) > 0 ? 0 : 1;
}
