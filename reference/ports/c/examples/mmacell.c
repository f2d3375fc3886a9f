/* mmacell-proto: a move of the robot, in µm and 0.1 mrad */
#include <cellwire/mmacell_proto.h>
#include <string.h>

int main(void)
{
    const struct mmacell_proto_message move = {
        .kind = MMACELL_PROTO_MOV, .axes_len = 4, .axes = {10000, -2000, 5999, -12322}};
    const struct mmacell_proto_dialect strict = {0};
    uint8_t line[MMACELL_PROTO_MAX_LINE];
    size_t length = mmacell_proto_encode(&move, strict, line, sizeof line);
    return length == 38 && memcmp(line, "MOVA+010.000-002.000+005.999-01.2322\r\n", length) == 0 ? 0 : 1;
}
