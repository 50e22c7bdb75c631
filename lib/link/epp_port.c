/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* EPP cycles by the registers of a PC's parallel port (ppmc.md sections 3.2, 3.3 and 10.2). */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#if defined __x86_64__ || defined __i386__
#include <sys/io.h>
#define HAVE_PORTS 1
#endif

#include "epp.h"

/* Registers from the port's base. */
enum { PORT_STATUS = 1, PORT_CONTROL = 2, PORT_EPP_ADDRESS = 3, PORT_EPP_DATA = 4, PORTS = 8 };

#define ECR_OFFSET      2u    /* from the ECR's base */
#define ECR_EPP         0x80u /* mode 100 in bits 7..5 */
#define STATUS_TIMEOUT  0x01u
#define CONTROL_RELEASE 0x04u /* nInit high: no reset; all strobes released */
#define CONTROL_REVERSE 0x20u /* data lines are inputs */

struct port {
    struct epp base;
    struct epp_port_io io;
    uint16_t at, ecr_at;
    bool reverse, reversed;
    bool owns_ports;
};

static uint8_t port_get(const struct port *const port, const unsigned offset)
{
    return port->io.in(port->io.context, (uint16_t)(port->at + offset));
}

static void port_put(const struct port *const port, const unsigned offset, const unsigned value)
{
    port->io.out(port->io.context, (uint16_t)(port->at + offset), (uint8_t)value);
}

static bool timed_out(const struct port *const port)
{
    return (port_get(port, PORT_STATUS) & STATUS_TIMEOUT) != 0;
}

/* By chip it takes a read, a one or a zero to clear the bit; a zero last, so that it is not left asking. */
static void clear_timeout(const struct port *const port)
{
    const unsigned status = port_get(port, PORT_STATUS);
    port_put(port, PORT_STATUS, status | STATUS_TIMEOUT);
    port_put(port, PORT_STATUS, status & ~STATUS_TIMEOUT & 0xFFu);
}

static void set_direction(struct port *const port, const bool reversed)
{
    if (!port->reverse || port->reversed == reversed)
        return;
    port_put(port, PORT_CONTROL, CONTROL_RELEASE | (reversed ? CONTROL_REVERSE : 0));
    port->reversed = reversed;
}

static int run_step(struct port *const port, const struct epp_step *const step, struct epp_done *const done)
{
    const unsigned offset = epp_is_address(step->kind) ? PORT_EPP_ADDRESS : PORT_EPP_DATA;
    const bool reads = epp_is_read(step->kind);
    set_direction(port, reads);
    for (done->bytes = 0; done->bytes < step->len; done->bytes++) {
        if (reads)
            step->data[done->bytes] = port_get(port, offset);
        else
            port_put(port, offset, step->data[done->bytes]);
        if (timed_out(port)) {
            clear_timeout(port);
            return HM2_ERR_TIMEOUT;
        }
    }
    done->steps++;
    done->bytes = 0;
    return 0;
}

static int port_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                    struct epp_done *const done)
{
    struct port *const port = (struct port *)epp;
    int err = 0;
    *done = (struct epp_done){0};
    while (err == 0 && done->steps < count)
        err = run_step(port, &steps[done->steps], done);
    return err;
}

/* ---- open and close ---------------------------------------------------------------------------------------------- */

#if HAVE_PORTS
static uint8_t real_in(void *const context, const uint16_t port)
{
    (void)context;
    return inb(port);
}

static void real_out(void *const context, const uint16_t port, const uint8_t value)
{
    (void)context;
    outb(value, port);
}

static int take_ports(struct port *const port, struct hm2_diag *const diag)
{
    port->io = (struct epp_port_io){.in = real_in, .out = real_out};
    if (ioperm(port->at, PORTS, 1) != 0 || (port->ecr_at != 0 && ioperm(port->ecr_at, 1, 1) != 0))
        return hm2_diag_add(diag, HM2_ERR_IO,
                            "Parallel port at 0x%X: the kernel gives no access to I/O ports: %s. It takes root or "
                            "CAP_SYS_RAWIO, and a kernel that is not locked down; /dev/parportN needs neither.",
                            port->at, strerror(errno));
    port->owns_ports = true;
    return 0;
}

static void leave_ports(const struct port *const port)
{
    if (!port->owns_ports)
        return;
    (void)ioperm(port->at, PORTS, 0);
    if (port->ecr_at != 0)
        (void)ioperm(port->ecr_at, 1, 0);
}
#else
static int take_ports(struct port *const port, struct hm2_diag *const diag)
{
    return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                        "Parallel port at 0x%X: this machine has no I/O ports; use /dev/parportN.", port->at);
}

static void leave_ports(const struct port *const port)
{
    (void)port;
}
#endif

static void port_close(struct epp *const epp)
{
    struct port *const port = (struct port *)epp;
    leave_ports(port);
    free(port);
}

static void prepare(struct port *const port)
{
    if (port->ecr_at != 0)
        port->io.out(port->io.context, port->ecr_at, ECR_EPP);
    port_put(port, PORT_CONTROL, CONTROL_RELEASE);
    if (timed_out(port))
        clear_timeout(port);
}

int epp_port_open(struct epp **const epp, const struct epp_port_options *const options, struct hm2_diag *const diag)
{
    static const struct epp_ops ops = {.run = port_run, .now_ns = epp_monotonic_ns, .close = port_close};
    struct port *const port = calloc(1, sizeof *port);
    if (!port)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for a parallel port.");
    port->base.ops = &ops;
    port->at = options->base;
    port->ecr_at = options->ecr_base ? (uint16_t)(options->ecr_base + ECR_OFFSET) : 0;
    port->reverse = options->reverse;
    if (options->io)
        port->io = *options->io;
    const int err = options->io ? 0 : take_ports(port, diag);
    if (err) {
        free(port);
        return err;
    }
    prepare(port);
    *epp = &port->base;
    return 0;
}
