/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A serial port as a link: bytes in both directions, without frames. */
#include <hm2/link.h>

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "clock.h"

struct tty {
    struct link base;
    int fd;
    bool changed;          /* settings */
    struct termios before; /* of the one who had the port before */
};

static const struct {
    uint32_t baud;
    speed_t speed;
} speeds[] = {{9600, B9600},       {19200, B19200},     {38400, B38400},     {57600, B57600},
              {115200, B115200},   {230400, B230400},   {460800, B460800},   {921600, B921600},
              {1000000, B1000000}, {1500000, B1500000}, {2000000, B2000000}, {2500000, B2500000}};

static int64_t tty_now(struct link *const link)
{
    (void)link;
    return clock_now_ns();
}

/* In one write, so that no gap comes between the bytes. The commands of a request and reply protocol always fit into
 * the port's buffer; one that does not take them is broken. */
static int tty_send(struct link *const link, const void *const data, const size_t len)
{
    const struct tty *const tty = (const struct tty *)link;
    if (len > LINK_MAX_DATAGRAM_BYTES)
        return HM2_ERR_NOSPACE;
    if (write(tty->fd, data, len) == (ssize_t)len) {
        link->counters.sent++;
        return 0;
    }
    link->counters.send_errors++;
    return HM2_ERR_IO;
}

/* True when something can be read, or the port is gone. */
static bool wait_until(struct tty *const tty, const int64_t deadline_ns)
{
    struct pollfd ready = {.fd = tty->fd, .events = POLLIN};
    const int64_t left_ns = deadline_ns > 0 ? deadline_ns - tty_now(&tty->base) : 0;
    if (left_ns <= 0)
        return false;
    const struct timespec timeout = clock_span(left_ns);
    return ppoll(&ready, 1, &timeout, NULL) > 0;
}

static int tty_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                    const int64_t clock_ns)
{
    struct tty *const tty = (struct tty *)link;
    (void)clock_ns;
    for (bool waited = true; waited;) {
        const ssize_t len = read(tty->fd, data, cap);
        if (len > 0) {
            link->counters.received++;
            return (int)len;
        }
        if (len == 0 || (errno != EAGAIN && errno != EINTR)) {
            link->counters.receive_errors++;
            return HM2_ERR_IO; /* the adapter was pulled, or the other end of a pseudo-terminal is closed */
        }
        waited = wait_until(tty, deadline_ns);
    }
    return HM2_ERR_TIMEOUT;
}

static void tty_close(struct link *const link)
{
    struct tty *const tty = (struct tty *)link;
    if (tty->changed)
        (void)tcsetattr(tty->fd, TCSANOW, &tty->before);
    if (tty->fd >= 0) {
        (void)ioctl(tty->fd, TIOCNXCL);
        (void)close(tty->fd);
    }
    free(tty);
}

static const struct link_ops tty_ops = {.send = tty_send, .recv = tty_recv, .now_ns = tty_now, .close = tty_close};

static int find_speed(const uint32_t baud, speed_t *const speed, struct hm2_diag *const diag)
{
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        if (speeds[i].baud != baud)
            continue;
        *speed = speeds[i].speed;
        return 0;
    }
    return hm2_diag_add(diag, HM2_ERR_RANGE,
                        "Baud rate %u: serial ports here have 9600, 19200, 38400, 57600, 115200, 230400, 460800, "
                        "921600, 1000000, 1500000, 2000000 and 2500000.",
                        (unsigned)baud);
}

/* Nobody else may open it from now on, and nobody who asks for the lock may have it open already. */
static int own(struct tty *const tty, const char *const path, struct hm2_diag *const diag)
{
    tty->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (tty->fd < 0 && errno == EBUSY)
        return hm2_diag_add(diag, HM2_ERR_STATE, "Serial port %s: another program has it; end that program.", path);
    if (tty->fd < 0)
        return hm2_diag_add(diag, HM2_ERR_IO, "Serial port %s: %s.%s", path, strerror(errno),
                            errno == EACCES ? " Usually its users must be in group dialout." : "");
    if (!isatty(tty->fd))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "%s is not a serial port.", path);
    if (flock(tty->fd, LOCK_EX | LOCK_NB) != 0)
        return hm2_diag_add(diag, HM2_ERR_STATE, "Serial port %s: another program has it; end that program.", path);
    (void)ioctl(tty->fd, TIOCEXCL);
    return 0;
}

/* Raw, 8N1, no flow control. What the driver did not take over is an error: tcsetattr(3) is content with a part. */
static int configure(struct tty *const tty, const char *const path, const speed_t speed, struct hm2_diag *const diag)
{
    struct termios wanted, now;
    if (tcgetattr(tty->fd, &tty->before) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO, "Serial port %s: %s.", path, strerror(errno));
    wanted = tty->before;
    cfmakeraw(&wanted);
    wanted.c_cflag = (wanted.c_cflag | CLOCAL | CREAD) & ~(tcflag_t)(CSTOPB | CRTSCTS);
    wanted.c_cc[VMIN] = 1; /* an empty queue is EAGAIN, so that 0 bytes mean the end */
    wanted.c_cc[VTIME] = 0;
    (void)cfsetispeed(&wanted, speed);
    (void)cfsetospeed(&wanted, speed);
    tty->changed = tcsetattr(tty->fd, TCSANOW, &wanted) == 0;
    if (!tty->changed || tcgetattr(tty->fd, &now) != 0 || cfgetospeed(&now) != speed ||
        (now.c_cflag & (CSIZE | CSTOPB | CRTSCTS)) != (wanted.c_cflag & (CSIZE | CSTOPB | CRTSCTS)))
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED, "Serial port %s cannot have this baud rate, 8N1.", path);
    (void)tcflush(tty->fd, TCIOFLUSH);
    return 0;
}

int link_tty_open(struct link **const link, const char *const path, const uint32_t baud, struct hm2_diag *const diag)
{
    speed_t speed = B0;
    int err = find_speed(baud, &speed, diag);
    if (err)
        return err;
    struct tty *const tty = calloc(1, sizeof *tty);
    if (!tty)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for a serial port.");
    tty->base.ops = &tty_ops;
    tty->fd = -1;
    err = own(tty, path, diag);
    if (!err)
        err = configure(tty, path, speed, diag);
    if (err) {
        tty_close(&tty->base);
        return err;
    }
    *link = &tty->base;
    return 0;
}
