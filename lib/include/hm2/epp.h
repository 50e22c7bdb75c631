/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How bytes reach boards on an EPP bus (IEEE 1284 enhanced parallel port) and come back.
 *
 * There are four operations: address write, address read, data write and data read, each a bus cycle a byte. A caller
 * lists them as steps and runs the list, so that a list can be laid out once at set-up and handed over as a whole:
 * one call a list, and with the simulated bus one exchange a list. A cycle that nobody answers is an error wherever the
 * hardware can tell (EPP time-out bit, ppmc.md section 3.3), and the list ends there: a dead bus costs one time-out a
 * run and never blocks.
 *
 * A bus is used by one thread at a time. epp_run() and epp_now_ns() are realtime safe: no allocation, no lock, no
 * system call but those that move the bytes.
 */
#ifndef HM2_EPP_H
#define HM2_EPP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define EPP_MAX_STEP_BYTES 32u  /* of one step */
#define EPP_MAX_STEPS      128u /* of one list */

enum epp_kind {
    EPP_ADDRESS_WRITE,
    EPP_ADDRESS_READ,
    EPP_DATA_WRITE,
    EPP_DATA_READ,
    EPP_KINDS,
};

struct epp_step {
    enum epp_kind kind;
    uint8_t len;   /* bytes, one cycle each, 1..EPP_MAX_STEP_BYTES */
    uint8_t *data; /* written from or read into; the caller's, valid while the list runs */
};

/* How far a list came. */
struct epp_done {
    size_t steps; /* that went through */
    size_t bytes; /* of the step that failed that went through before the failure; 0 when none failed */
};

struct epp;

struct epp_ops {
    /* Run the steps in order. 0; HM2_ERR_TIMEOUT when a cycle was not answered, HM2_ERR_IO when the system refused to
     * move bytes. *done says how far it came, also after an error: what was read up to there is valid, the rest of the
     * memory may have changed. */
    int (*run)(struct epp *epp, const struct epp_step *steps, size_t count, struct epp_done *done);
    /* The clock against which what the bus brings is judged (CLOCK_MONOTONIC, or virtual time). */
    int64_t (*now_ns)(struct epp *epp);
    void (*close)(struct epp *epp); /* releases everything, the bus itself included */
};

struct epp {
    const struct epp_ops *ops;
};

static inline int HM2_MUST_CHECK epp_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                                         struct epp_done *const done)
{
    return epp->ops->run(epp, steps, count, done);
}

static inline int64_t epp_now_ns(struct epp *const epp)
{
    return epp->ops->now_ns(epp);
}

static inline void epp_close(struct epp *const epp)
{
    if (epp)
        epp->ops->close(epp);
}

/* Open a bus by its name. Not realtime safe. On failure diag says why.
 *   /dev/parportN          the kernel's ppdev driver
 *   port:0x378[:0x778]     direct port I/O at this base; with a second number the extended control register (ECR) of
 *                          the port is two above it and is set to EPP mode
 *   sim:PATH               a simulated bus behind a local socket, see hm2ppmcsim(1)
 * reverse is hal_ppmc's epp_dir: command the direction of the data lines before reads (old ports need it, a few newer
 * ones must not see it; ppmc.md section 7). */
HM2_API int HM2_MUST_CHECK epp_open(struct epp **epp, const char *name, bool reverse, struct hm2_diag *diag);

/* The kernel's driver. System calls of a list: one ioctl(2) where the kind or the direction of the steps changes, one
 * read(2) or write(2) a step. The device is opened without blocking: the kernel would go on trying for ever to read
 * from a bus that does not answer. No negotiation takes place, and the port leaves EPP mode before it is closed,
 * because the kernel would otherwise reset the boards (ppmc.md section 10.1). */
HM2_API int HM2_MUST_CHECK epp_ppdev_open(struct epp **epp, const char *device, bool reverse, struct hm2_diag *diag);

/* Access to I/O ports, which tests replace. */
struct epp_port_io {
    uint8_t (*in)(void *context, uint16_t port);
    void (*out)(void *context, uint16_t port, uint8_t value);
    void *context;
};

struct epp_port_options {
    uint16_t base;
    uint16_t ecr_base; /* 0 = the port has no ECR, or its firmware set-up has chosen EPP already */
    bool reverse;
    const struct epp_port_io *io; /* NULL = the machine's own ports, after ioperm(2): x86 only, needs CAP_SYS_RAWIO */
};

/* Direct port I/O: no system call in a list. The time-out bit is looked at after every cycle. */
HM2_API int HM2_MUST_CHECK epp_port_open(struct epp **epp, const struct epp_port_options *options,
                                         struct hm2_diag *diag);

/* The simulated bus of another process. A list is one datagram, its results another; system calls of a list: send(2),
 * ppoll(2), recv(2). A simulator that does not answer within wait_ns (epp_open: EPP_SOCKET_WAIT_NS) counts as a bus
 * that does not. */
#define EPP_SOCKET_WAIT_NS 20000000
HM2_API int HM2_MUST_CHECK epp_socket_open(struct epp **epp, const char *path, int64_t wait_ns, struct hm2_diag *diag);

/* ---- the simulated bus on its socket (AF_UNIX, SOCK_SEQPACKET) ---------------------------------------------------
 * Request:  number (16 bits, little end first), count of steps (8), then for each step kind (8), len (8) and, when it
 *           writes, len bytes.
 * Reply:    the number again (16), status (8: 0 done, 1 a cycle was not answered), steps done (8), bytes done of the
 *           step that failed (8), then all bytes read, in order. */
#define EPP_WIRE_REQUEST_HEAD 3u
#define EPP_WIRE_STEP_HEAD    2u
#define EPP_WIRE_REPLY_HEAD   5u
#define EPP_WIRE_MAX_BYTES    (8u + EPP_MAX_STEPS * (EPP_WIRE_STEP_HEAD + EPP_MAX_STEP_BYTES))

#endif
