/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* EPP cycles of a simulated bus in another process. */
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <hm2/bytes.h>

#include "epp.h"

#define NS_PER_S INT64_C(1000000000)

struct bus_socket {
    struct epp base;
    int fd;
    int64_t wait_ns; /* for a reply */
    uint16_t number; /* of the last request */
    uint8_t message[EPP_WIRE_MAX_BYTES];
};

static size_t put_request(struct bus_socket *const bus, const struct epp_step *const steps, const size_t count)
{
    size_t used = EPP_WIRE_REQUEST_HEAD;
    hm2_put_le16(bus->message, ++bus->number);
    bus->message[2] = (uint8_t)count;
    for (size_t i = 0; i < count; i++) {
        bus->message[used++] = (uint8_t)steps[i].kind;
        bus->message[used++] = steps[i].len;
        if (epp_is_read(steps[i].kind))
            continue;
        memcpy(bus->message + used, steps[i].data, steps[i].len);
        used += steps[i].len;
    }
    return used;
}

/* Bytes that a reply of this progress carries; SIZE_MAX when the progress is impossible. */
static size_t bytes_read(const struct epp_step *const steps, const size_t count, const struct epp_done done)
{
    size_t bytes = 0;
    if (done.steps > count || (done.steps == count && done.bytes > 0))
        return SIZE_MAX;
    if (done.steps < count && done.bytes >= steps[done.steps].len)
        return SIZE_MAX;
    for (size_t i = 0; i < done.steps; i++)
        bytes += epp_is_read(steps[i].kind) ? steps[i].len : 0;
    return bytes + (done.steps < count && epp_is_read(steps[done.steps].kind) ? done.bytes : 0);
}

static void take_bytes(const struct epp_step *const steps, const struct epp_done done, const uint8_t *at)
{
    for (size_t i = 0; i < done.steps; i++) {
        if (!epp_is_read(steps[i].kind))
            continue;
        memcpy(steps[i].data, at, steps[i].len);
        at += steps[i].len;
    }
    if (done.bytes > 0 && epp_is_read(steps[done.steps].kind))
        memcpy(steps[done.steps].data, at, done.bytes);
}

static int take_reply(const struct bus_socket *const bus, const size_t len, const struct epp_step *const steps,
                      const size_t count, struct epp_done *const done)
{
    const struct epp_done told = {bus->message[3], bus->message[4]};
    const bool whole = bus->message[2] == 0;
    if (len != EPP_WIRE_REPLY_HEAD + bytes_read(steps, count, told) || whole != (told.steps == count))
        return HM2_ERR_MALFORMED;
    take_bytes(steps, told, bus->message + EPP_WIRE_REPLY_HEAD);
    *done = told;
    return whole ? 0 : HM2_ERR_TIMEOUT;
}

/* Length of the reply to the last request; older ones, which came too late for theirs, are passed over. */
static ssize_t receive(struct bus_socket *const bus)
{
    const int64_t end_ns = epp_monotonic_ns(&bus->base) + bus->wait_ns;
    for (;;) {
        const int64_t left_ns = end_ns - epp_monotonic_ns(&bus->base);
        const int64_t wait_ns = left_ns > 0 ? left_ns : 0;
        const struct timespec wait = {(time_t)(wait_ns / NS_PER_S), (long)(wait_ns % NS_PER_S)};
        struct pollfd ready = {.fd = bus->fd, .events = POLLIN};
        const int events = ppoll(&ready, 1, &wait, NULL);
        if (events == 0 || (events < 0 && errno != EINTR))
            return HM2_ERR_TIMEOUT;
        if (events < 0)
            continue;
        const ssize_t len = recv(bus->fd, bus->message, sizeof bus->message, MSG_DONTWAIT | MSG_TRUNC);
        if (len == 0 || (len < 0 && errno != EAGAIN && errno != EINTR))
            return HM2_ERR_IO; /* the simulator has gone */
        if (len < (ssize_t)EPP_WIRE_REPLY_HEAD || hm2_get_le16(bus->message) != bus->number)
            continue;
        return len <= (ssize_t)sizeof bus->message ? len : HM2_ERR_MALFORMED;
    }
}

static int socket_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                      struct epp_done *const done)
{
    struct bus_socket *const bus = (struct bus_socket *)epp;
    *done = (struct epp_done){0};
    if (count > EPP_MAX_STEPS)
        return HM2_ERR_NOSPACE;
    const size_t len = put_request(bus, steps, count);
    if (send(bus->fd, bus->message, len, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)len)
        return errno == EAGAIN ? HM2_ERR_TIMEOUT : HM2_ERR_IO;
    const ssize_t got = receive(bus);
    return got < 0 ? (int)got : take_reply(bus, (size_t)got, steps, count, done);
}

/* ---- open and close ---------------------------------------------------------------------------------------------- */

static void socket_close(struct epp *const epp)
{
    struct bus_socket *const bus = (struct bus_socket *)epp;
    if (bus->fd >= 0)
        (void)close(bus->fd);
    free(bus);
}

static int connect_to(struct bus_socket *const bus, const char *const path, struct hm2_diag *const diag)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const size_t len = strlen(path);
    if (len == 0 || len >= sizeof address.sun_path)
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "Bus sim:%.64s: a socket's path has 1 to %zu characters; write for example sim:/tmp/ppmc.",
                            path, sizeof address.sun_path - 1);
    memcpy(address.sun_path, path, len);
    bus->fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (bus->fd < 0 || connect(bus->fd, (const struct sockaddr *)&address, sizeof address) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO,
                            "Bus sim:%s: %s. Start the simulated boards first: hm2ppmcsim --socket %s.", path,
                            strerror(errno), path);
    return 0;
}

int epp_socket_open(struct epp **const epp, const char *const path, const int64_t wait_ns, struct hm2_diag *const diag)
{
    static const struct epp_ops ops = {.run = socket_run, .now_ns = epp_monotonic_ns, .close = socket_close};
    struct bus_socket *const bus = calloc(1, sizeof *bus);
    if (!bus)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for a simulated bus.");
    bus->base.ops = &ops;
    bus->fd = -1;
    bus->wait_ns = wait_ns;
    const int err = connect_to(bus, path, diag);
    if (err) {
        socket_close(&bus->base);
        return err;
    }
    *epp = &bus->base;
    return 0;
}
