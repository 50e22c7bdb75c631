/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* SocketCAN: raw frames of an interface. Reading does not wait and takes many frames with one system call. */
#include <hm2/can.h>

#include <errno.h>
#include <time.h>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define BATCH         32u
#define CONTROL_BYTES 256u
#define QUEUE_BYTES   (2 << 20) /* some thousand frames: what a bus brings while the cycle is late */

struct socket_bus {
    struct hm2_can_bus base;
    int fd;
    struct mmsghdr headers[BATCH];
    struct iovec parts[BATCH];
    struct canfd_frame frames[BATCH];
    _Alignas(struct cmsghdr) char control[BATCH][CONTROL_BYTES];
};

/* ---- receiving
 * ------------------------------------------------------------------------------------------------------- */

static int64_t stamp_ns(const struct timespec *const time)
{
    return (int64_t)time->tv_sec * INT64_C(1000000000) + time->tv_nsec;
}

static void read_control(struct socket_bus *const bus, struct msghdr *const header, struct hm2_can_frame *const frame)
{
    struct scm_timestamping stamps;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(header); c; c = CMSG_NXTHDR(header, c)) {
        if (c->cmsg_level != SOL_SOCKET)
            continue;
        if (c->cmsg_type == SO_RXQ_OVFL && c->cmsg_len >= CMSG_LEN(sizeof bus->base.overruns))
            memcpy(&bus->base.overruns, CMSG_DATA(c), sizeof bus->base.overruns);
        if (c->cmsg_type != SO_TIMESTAMPING || c->cmsg_len < CMSG_LEN(sizeof stamps))
            continue;
        memcpy(&stamps, CMSG_DATA(c), sizeof stamps);
        frame->hardware_stamp = stamp_ns((const struct timespec *)&stamps.ts[2]) != 0;
        frame->stamp_ns = stamp_ns((const struct timespec *)&stamps.ts[frame->hardware_stamp ? 2 : 0]);
    }
}

/* False for what is no frame. */
static bool read_frame(struct socket_bus *const bus, const unsigned i, struct hm2_can_frame *const frame)
{
    const struct canfd_frame *const raw = &bus->frames[i];
    const unsigned len = bus->headers[i].msg_len;
    const bool fd = len == CANFD_MTU;
    if ((!fd && len != CAN_MTU) || raw->len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN))
        return false;
    *frame = (struct hm2_can_frame){.extended = (raw->can_id & CAN_EFF_FLAG) != 0,
                                    .remote = (raw->can_id & CAN_RTR_FLAG) != 0,
                                    .error = (raw->can_id & CAN_ERR_FLAG) != 0,
                                    .fd = fd,
                                    .bytes = raw->len};
    frame->id = raw->can_id & (frame->error ? CAN_ERR_MASK : frame->extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    memcpy(frame->data, raw->data, raw->len);
    read_control(bus, &bus->headers[i].msg_hdr, frame);
    return true;
}

static int socket_receive(struct hm2_can_bus *const base, struct hm2_can_frame *const frames, const unsigned max)
{
    struct socket_bus *const bus = (struct socket_bus *)base;
    const unsigned batch = max < BATCH ? max : BATCH;
    for (unsigned i = 0; i < batch; i++)
        bus->headers[i].msg_hdr.msg_controllen = CONTROL_BYTES;
    const int count = recvmmsg(bus->fd, bus->headers, batch, MSG_DONTWAIT, NULL);
    if (count < 0)
        return errno == EAGAIN || errno == EINTR ? 0 : HM2_ERR_IO;
    int good = 0;
    for (int i = 0; i < count; i++)
        good += read_frame(bus, (unsigned)i, &frames[good]);
    return good;
}

/* ---- sending
 * --------------------------------------------------------------------------------------------------------- */

static int socket_send(struct hm2_can_bus *const base, const struct hm2_can_frame *const frame)
{
    const struct socket_bus *const bus = (const struct socket_bus *)base;
    struct canfd_frame raw = {.can_id =
                                  frame->id | (frame->extended ? CAN_EFF_FLAG : 0) | (frame->remote ? CAN_RTR_FLAG : 0),
                              .len = frame->bytes,
                              .flags = frame->fd ? CANFD_BRS : 0};
    memcpy(raw.data, frame->data, frame->bytes);
    const size_t len = frame->fd ? CANFD_MTU : CAN_MTU;
    const ssize_t sent = send(bus->fd, &raw, len, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent == (ssize_t)len)
        return 0;
    return sent < 0 && (errno == ENOBUFS || errno == EAGAIN || errno == EINTR) ? HM2_ERR_NOSPACE : HM2_ERR_IO;
}

/* ---- opening
 * --------------------------------------------------------------------------------------------------------- */

static void socket_close(struct hm2_can_bus *const base)
{
    struct socket_bus *const bus = (struct socket_bus *)base;
    if (bus->fd >= 0)
        close(bus->fd);
    free(bus);
}

static const struct hm2_can_bus_ops socket_ops = {socket_receive, socket_send, socket_close};

static int set_filters(const int fd, const struct hm2_can_filter *const filters, const unsigned count)
{
    struct can_filter *const list = calloc(count + 1u, sizeof *list);
    if (!list)
        return -1;
    for (unsigned i = 0; i < count; i++) {
        list[i].can_id = filters[i].id | (filters[i].extended ? CAN_EFF_FLAG : 0);
        list[i].can_mask = (filters[i].extended ? CAN_EFF_MASK : CAN_SFF_MASK) | CAN_EFF_FLAG | CAN_RTR_FLAG;
    }
    const unsigned used = count <= HM2_CAN_MAX_FILTERS ? count : 0;
    const bool all = count > HM2_CAN_MAX_FILTERS; /* the socket's own filter lets everything through */
    const int result = all ? 0 : setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, list, (socklen_t)(used * sizeof *list));
    free(list);
    return result;
}

/* What it is like when one of these is not possible is worse, but good enough. */
static void set_comforts(const int fd)
{
    const int on = 1, queue = QUEUE_BYTES;
    const int stamps = SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE | SOF_TIMESTAMPING_RX_SOFTWARE |
                       SOF_TIMESTAMPING_SOFTWARE;
    (void)setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps);
    (void)setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &queue, sizeof queue) != 0)
        (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &queue, sizeof queue);
}

static int enable_fd(const int fd, const char *const interface, struct hm2_diag *const diag)
{
    const int on = 1;
    struct ifreq request = {0};
    memcpy(request.ifr_name, interface, strlen(interface));
    if (ioctl(fd, SIOCGIFMTU, &request) != 0 || request.ifr_mtu < (int)CANFD_MTU)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                            "%s: the file has messages of CAN FD, and the interface carries classic CAN only (mtu %d, "
                            "expected %d): set it up with \"fd on\"",
                            interface, request.ifr_mtu, (int)CANFD_MTU);
    if (setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED, "%s: the kernel has no CAN FD: %s", interface, strerror(errno));
    return 0;
}

static int set_up(struct socket_bus *const bus, const char *const interface, const struct hm2_can_filter *const filters,
                  const unsigned count, const bool with_fd, struct hm2_diag *const diag)
{
    const can_err_mask_t errors = CAN_ERR_MASK;
    struct sockaddr_can address = {.can_family = AF_CAN};
    if (strlen(interface) >= IFNAMSIZ || (address.can_ifindex = (int)if_nametoindex(interface)) == 0)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no interface \"%s\"; \"ip link\" lists them", interface);
    if (set_filters(bus->fd, filters, count) != 0 ||
        setsockopt(bus->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO, "%s: filters: %s", interface, strerror(errno));
    const int err = with_fd ? enable_fd(bus->fd, interface, diag) : 0;
    if (err)
        return err;
    set_comforts(bus->fd);
    if (bind(bus->fd, (const struct sockaddr *)&address, sizeof address) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO, "%s: %s; is it a CAN interface?", interface, strerror(errno));
    return 0;
}

int hm2_can_open(const char *const interface, const struct hm2_can_filter *const filters, const unsigned count,
                 const bool fd, struct hm2_can_bus **const result, struct hm2_diag *const diag)
{
    *result = NULL;
    struct socket_bus *const bus = calloc(1, sizeof *bus);
    if (!bus)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory", interface);
    bus->base.ops = &socket_ops;
    for (unsigned i = 0; i < BATCH; i++) {
        bus->parts[i] = (struct iovec){&bus->frames[i], sizeof bus->frames[i]};
        bus->headers[i].msg_hdr =
            (struct msghdr){.msg_iov = &bus->parts[i], .msg_iovlen = 1, .msg_control = bus->control[i]};
    }
    bus->fd = socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    int err = bus->fd >= 0
                  ? 0
                  : hm2_diag_add(diag, HM2_ERR_UNSUPPORTED, "%s: this kernel has no CAN (modules can, can-raw): %s",
                                 interface, strerror(errno));
    err = err ? err : set_up(bus, interface, filters, count, fd, diag);
    if (err)
        socket_close(&bus->base);
    else
        *result = &bus->base;
    return err;
}
