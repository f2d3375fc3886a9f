/* fanuc-hmi-modbus: a request of TCP; of a serial line with MODBUS_RTU */
#include <assert.h>
#include <cellwire/fanuc_hmi_modbus.h>

int main(void)
{
    static const struct modbus_message request = {
        .transaction = 1, .unit = 1, .function = 3, .shape = MODBUS_READ, .address = 0, .quantity = 37};
    static struct modbus_decoder server;
    static struct modbus_item item;
    uint8_t bytes[300];
    size_t length = modbus_encode(&request, MODBUS_TCP, bytes, sizeof bytes);
    modbus_init(&server, MODBUS_CLIENT, MODBUS_TCP);
    modbus_push(&server, bytes, length);
    assert(modbus_next(&server, &item) && item.error == MODBUS_NO_ERROR);
    return length == 12 && item.message.quantity == 37 ? 0 : 1;
}
