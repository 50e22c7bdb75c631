/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The messages of a DBC file on a CAN bus, as points and a cycle.
 *
 * One node of the file is ours: the messages that it sends are sent, with a pin for each signal; the messages with
 * signals for it (or for anybody, Vector__XXX) are received, with a pin for each of these signals. Without a node
 * everything is received and nothing is sent. Names are PREFIX.MESSAGE.SIGNAL; those of a message itself have a hyphen
 * (rx-age, tx-period-ms), which no signal of a DBC file can have.
 *
 * A pin is a bit for one unsigned bit without scale; u32 or s32 when scale and offset are whole and every value fits;
 * a float for all others.
 *
 * A cycle takes what the bus has queued, at most HM2_CAN_FRAMES_PER_CYCLE frames, and applies the newest frame of each
 * message; of multiplexed messages every frame. That is more than a bus of 1 Mbit/s carries in ten periods of a
 * millisecond (21 frames each, at 47 bits a frame), so what waits is always worked off. A frame that is shorter than
 * its message is dropped as a whole. In the same cycle the messages that are due are sent, in the order of the file.
 *
 * When the interface is down, has gone away or is bus-off, every message that is received counts as timed out until it
 * comes again, and those that are sent on change are sent again afterwards.
 *
 * hm2_can_read() and hm2_can_write() are realtime safe (no allocation, lock or formatting, no system call but those of
 * the bus) and must be called from one thread.
 */
#ifndef HM2_CAN_H
#define HM2_CAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/dbc.h>
#include <hm2/module.h>
#include <hm2/points.h>

#define HM2_CAN_FRAMES_PER_CYCLE 256u

/* ---- how frames reach a bus -----------------------------------------------------------------------------------------
 */

struct hm2_can_frame {
    uint32_t id; /* 11 or 29 bits; of an error frame the classes of linux/can/error.h */
    bool extended, fd, remote, error;
    bool hardware_stamp; /* stamp_ns is the interface's own */
    uint8_t bytes;
    int64_t stamp_ns; /* when it was received, on a clock of its own; 0 = not known */
    uint8_t data[HM2_CAN_MAX_BYTES];
};

struct hm2_can_bus;

struct hm2_can_bus_ops {
    /* Up to max frames that are there already. Their number, or HM2_ERR_IO when the interface is down. */
    int (*receive)(struct hm2_can_bus *bus, struct hm2_can_frame *frames, unsigned max);
    /* 0, HM2_ERR_NOSPACE (the queue is full: try again in another cycle), HM2_ERR_IO (the interface is down). */
    int (*send)(struct hm2_can_bus *bus, const struct hm2_can_frame *frame);
    void (*close)(struct hm2_can_bus *bus); /* releases everything, the bus itself included */
};

struct hm2_can_bus {
    const struct hm2_can_bus_ops *ops;
    uint32_t overruns; /* frames that were lost because nobody took them in time */
};

struct hm2_can_filter {
    uint32_t id;
    bool extended;
};

#define HM2_CAN_MAX_FILTERS 512u /* what the kernel takes (CAN_RAW_FILTER_MAX); with more there are none */

/* A SocketCAN interface ("can0"). Only the identifiers of the filters, and error frames, are received. With fd the
 * interface must be able to carry CAN FD. HM2_ERR_NOTFOUND, HM2_ERR_UNSUPPORTED, HM2_ERR_IO. Not realtime safe; the
 * bus itself is: it makes recvmmsg() and send(), and never waits. */
HM2_API int HM2_MUST_CHECK hm2_can_open(const char *interface, const struct hm2_can_filter *filters, unsigned count,
                                        bool fd, struct hm2_can_bus **bus, struct hm2_diag *diag);

/* ---- the messages of a node
 * ------------------------------------------------------------------------------------------ */

struct hm2_can_options {
    const char *prefix; /* of all names */
    const char *node;   /* ours; NULL or "" = receive everything */
    bool floats;        /* every pin that is not a bit is a float */
};

struct hm2_can;

/* Choose the messages. dbc must live as long. HM2_ERR_NOTFOUND when the file has no such node or nothing for it. */
HM2_API int HM2_MUST_CHECK hm2_can_new(const struct hm2_dbc *dbc, const struct hm2_can_options *options,
                                       struct hm2_can **can, struct hm2_diag *diag);
HM2_API void hm2_can_free(struct hm2_can *can); /* closes the bus, too */

/* Filters for what is received: their number, at most max are stored. */
HM2_API unsigned hm2_can_filters(const struct hm2_can *can, struct hm2_can_filter *filters, unsigned max);
/* Whether any of the messages is one of CAN FD. */
HM2_API bool hm2_can_needs_fd(const struct hm2_can *can);
/* Type of a signal's pin. */
HM2_API enum hm2_point_type hm2_can_type(const struct hm2_dbc_signal *signal, bool floats);
/* What our node does with a message. node as of hm2_dbc_node(), negative for none. */
HM2_API bool hm2_can_sends(const struct hm2_dbc *dbc, const struct hm2_dbc_message *message, int node);
HM2_API bool hm2_can_hears(const struct hm2_dbc *dbc, const struct hm2_dbc_signal *signal, int node);

/* Create the points. Takes over the bus in any case. HM2_ERR_NOMEM, HM2_ERR_NOSPACE, HM2_ERR_HOST. */
HM2_API int HM2_MUST_CHECK hm2_can_setup(struct hm2_can *can, struct hm2_can_bus *bus, struct hm2_binder *binder,
                                         struct hm2_diag *diag);

/* now_ns is any clock that goes on steadily, the same for both. */
HM2_API void hm2_can_read(struct hm2_can *can, int64_t now_ns);
HM2_API void hm2_can_write(struct hm2_can *can, int64_t now_ns);

/* Somebody who asked the controller itself says whether it is bus-off: the next cycle shows it. Drivers report bus-off
 * by an error frame, but not all of them its end. May be called from any thread, at any time. */
HM2_API void hm2_can_tell_bus_off(struct hm2_can *can, bool bus_off);

/* An interface that went away and came back is another one for the kernel. Whoever sees it there opens it and hands it
 * over: the next cycle uses it in place of the present one, which hm2_can_close_old() closes later. Takes over the bus.
 * Both from one thread, not realtime safe. */
HM2_API void hm2_can_replace_bus(struct hm2_can *can, struct hm2_can_bus *bus);
HM2_API void hm2_can_close_old(struct hm2_can *can);

/* The tables of points; ended by a group without points. */
HM2_API const struct hm2_point_group *hm2_can_point_groups(void);

#endif
