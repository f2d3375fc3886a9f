/* laser-eb90: an instruction with two parameters */
#include <assert.h>
#include <cellwire/laser_eb90.h>

int main(void)
{
    static struct laser_eb90_payload payload = {.profile = &LASER_EB90_DEFAULT};
    static struct laser_eb90_decoder decoder;
    static struct laser_eb90_result result;
    struct laser_eb90_item item;
    uint8_t bytes[64];
    size_t at = 0;
    laser_eb90_put_item(&payload, LASER_EB90_I16, 1);
    laser_eb90_put_i16(&payload, 0x101);
    laser_eb90_put_item(&payload, LASER_EB90_F32, 2);
    laser_eb90_put_f32(&payload, 18.0f);
    laser_eb90_put_f32(&payload, -50.5f);
    size_t length = laser_eb90_encode(&payload, bytes, sizeof bytes);
    laser_eb90_init(&decoder, LASER_EB90_DEFAULT);
    laser_eb90_push(&decoder, bytes, length);
    assert(laser_eb90_next(&decoder, &result) && result.kind == LASER_EB90_FRAME);
    assert(laser_eb90_item(&LASER_EB90_DEFAULT, result.payload, result.payload_len, &at, &item));
    return laser_eb90_get_i16(&LASER_EB90_DEFAULT, &item, 0) == 0x101 ? 0 : 1;
}
