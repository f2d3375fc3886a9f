/* Serial ports under qemu-user, which knows the ioctls of plain termios and not those of termios2: one is done by the other, for the
 * standard rates. Loaded before the C library (LD_PRELOAD) into a program of another platform. */
#define _GNU_SOURCE
#include <asm/termbits.h>
#include <dlfcn.h>
#include <errno.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#define GET2 0x802c542a
#define SET2 0x402c542b
#define GET 0x5401
#define SET 0x5402

static const struct { unsigned code, baud; } rates[] = {
    {B50, 50}, {B75, 75}, {B110, 110}, {B134, 134}, {B150, 150}, {B200, 200}, {B300, 300}, {B600, 600}, {B1200, 1200}, {B1800, 1800},
    {B2400, 2400}, {B4800, 4800}, {B9600, 9600}, {B19200, 19200}, {B38400, 38400}, {B57600, 57600}, {B115200, 115200},
    {B230400, 230400}, {B460800, 460800}, {B500000, 500000}, {B921600, 921600}, {B1000000, 1000000},
};

int ioctl(int fd, unsigned long request, ...) {
    static int (*next)(int, unsigned long, ...);
    if (!next) next = dlsym(RTLD_NEXT, "ioctl");
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    struct termios plain;
    struct termios2 *port = argument;
    size_t shared = offsetof(struct termios2, c_ispeed);
    if ((unsigned)request == GET2) {
        int result = next(fd, GET, &plain);
        if (result) return result;
        memset(port, 0, sizeof *port);
        memcpy(port, &plain, shared);
        for (unsigned i = 0; i < sizeof rates / sizeof *rates; i++)
            if (rates[i].code == (plain.c_cflag & CBAUD)) port->c_ispeed = port->c_ospeed = rates[i].baud;
        return 0;
    }
    if ((unsigned)request == SET2) {
        memset(&plain, 0, sizeof plain);
        memcpy(&plain, port, shared);
        if ((port->c_cflag & CBAUD) == BOTHER) {
            unsigned i = 0;
            while (i < sizeof rates / sizeof *rates && rates[i].baud != port->c_ospeed) i++;
            if (i == sizeof rates / sizeof *rates) return errno = EINVAL, -1;
            plain.c_cflag = (plain.c_cflag & ~(CBAUD | CIBAUD)) | rates[i].code;
        }
        return next(fd, SET, &plain);
    }
    return next(fd, request, argument);
}
