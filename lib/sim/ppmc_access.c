/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Three ways to a simulated bus: the seam in the same process, the socket protocol, and a parallel port. */
#include <stdlib.h>
#include <string.h>

#include <hm2/bytes.h>

#include "ppmc_bus.h"

/* ---- the seam ---------------------------------------------------------------------------------------------------- */

struct direct {
    struct epp base;
    struct sim_ppmc *bus;
};

/* False when a cycle was not answered. */
static bool run_step(struct sim_ppmc *const bus, const struct epp_step *const step, struct epp_done *const done)
{
    for (done->bytes = 0; done->bytes < step->len; done->bytes++)
        if (!sim_ppmc_cycle(bus, step->kind, &step->data[done->bytes]))
            return false;
    done->steps++;
    done->bytes = 0;
    return true;
}

static int direct_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                      struct epp_done *const done)
{
    const struct direct *const direct = (const struct direct *)epp;
    *done = (struct epp_done){0};
    while (done->steps < count)
        if (!run_step(direct->bus, &steps[done->steps], done))
            return HM2_ERR_TIMEOUT;
    return 0;
}

static int64_t direct_now(struct epp *const epp)
{
    return ((const struct direct *)epp)->bus->now_ns;
}

static void direct_close(struct epp *const epp)
{
    free(epp);
}

struct epp *sim_ppmc_epp(struct sim_ppmc *const bus)
{
    static const struct epp_ops ops = {.run = direct_run, .now_ns = direct_now, .close = direct_close};
    struct direct *const direct = malloc(sizeof *direct);
    if (!direct)
        return NULL;
    direct->base.ops = &ops;
    direct->bus = bus;
    return &direct->base;
}

/* ---- the socket protocol ------------------------------------------------------------------------------------------*/

static bool is_read(const unsigned kind)
{
    return kind == EPP_ADDRESS_READ || kind == EPP_DATA_READ;
}

/* Length of a request whose steps are all well formed, or 0. */
static size_t check_request(const uint8_t *const request, const size_t len)
{
    size_t at = EPP_WIRE_REQUEST_HEAD;
    if (len < at || request[2] > EPP_MAX_STEPS)
        return 0;
    for (unsigned i = 0; i < request[2]; i++) {
        if (len - at < EPP_WIRE_STEP_HEAD)
            return 0;
        const unsigned kind = request[at], bytes = request[at + 1];
        at += EPP_WIRE_STEP_HEAD;
        if (kind >= EPP_KINDS || bytes == 0 || bytes > EPP_MAX_STEP_BYTES || (!is_read(kind) && len - at < bytes))
            return 0;
        at += is_read(kind) ? 0 : bytes;
    }
    return at == len ? len : 0;
}

size_t sim_ppmc_serve(struct sim_ppmc *const bus, const uint8_t *const request, const size_t len, uint8_t *const reply)
{
    struct epp_done done = {0};
    const uint8_t *at = request + EPP_WIRE_REQUEST_HEAD;
    size_t used = EPP_WIRE_REPLY_HEAD;
    bool answered = true;
    if (check_request(request, len) == 0)
        return 0;
    while (answered && done.steps < request[2]) {
        uint8_t bytes[EPP_MAX_STEP_BYTES];
        const struct epp_step step = {(enum epp_kind)at[0], at[1], bytes};
        at += EPP_WIRE_STEP_HEAD;
        if (!is_read(step.kind)) {
            memcpy(bytes, at, step.len);
            at += step.len;
        }
        answered = run_step(bus, &step, &done);
        if (is_read(step.kind)) {
            const size_t got = answered ? step.len : done.bytes;
            memcpy(reply + used, bytes, got);
            used += got;
        }
    }
    memcpy(reply, request, 2);
    reply[2] = !answered;
    reply[3] = (uint8_t)done.steps;
    reply[4] = (uint8_t)done.bytes;
    return used;
}

/* ---- the port ---------------------------------------------------------------------------------------------------- */

enum { PORT_STATUS = 1, PORT_CONTROL = 2, PORT_EPP_ADDRESS = 3, PORT_EPP_DATA = 4, PORT_END = 8, PORT_ECR = 0x402 };

#define STATUS_TIMEOUT   0x01u
#define CONTROL_STROBES  0x0Bu /* nStrobe, nAutoFd, nSelectIn: 1 holds the line low */
#define CONTROL_NO_RESET 0x04u /* nInit */
#define ECR_MODE         0xE0u
#define ECR_EPP          0x80u

/* Rule 6: with a line held, or in another mode, the boards see no cycle that they could answer. */
static bool port_cycle(struct sim_ppmc *const bus, const enum epp_kind kind, uint8_t *const byte)
{
    const bool ready =
        (bus->control & (CONTROL_STROBES | CONTROL_NO_RESET)) == CONTROL_NO_RESET && (bus->ecr & ECR_MODE) == ECR_EPP;
    if (ready)
        return sim_ppmc_cycle(bus, kind, byte);
    bus->now_ns += bus->options.timeout_ns;
    bus->stats.unanswered++;
    bus->timeout = true;
    return false;
}

uint8_t sim_ppmc_port_in(struct sim_ppmc *const bus, const unsigned offset)
{
    uint8_t byte = 0xFF;
    if (offset == PORT_STATUS)
        return bus->timeout ? STATUS_TIMEOUT : 0;
    if (offset == PORT_CONTROL)
        return bus->control;
    if (offset == PORT_ECR)
        return bus->ecr;
    if (offset == PORT_EPP_ADDRESS)
        (void)port_cycle(bus, EPP_ADDRESS_READ, &byte);
    else if (offset >= PORT_EPP_DATA && offset < PORT_END)
        (void)port_cycle(bus, EPP_DATA_READ, &byte);
    return byte;
}

void sim_ppmc_port_out(struct sim_ppmc *const bus, const unsigned offset, uint8_t value)
{
    if (offset == PORT_STATUS && (value & STATUS_TIMEOUT))
        bus->timeout = false;
    if (offset == PORT_CONTROL) {
        bus->control = value;
        if (!(value & CONTROL_NO_RESET))
            sim_ppmc_reset(bus);
    }
    if (offset == PORT_ECR)
        bus->ecr = value;
    if (offset == PORT_EPP_ADDRESS)
        (void)port_cycle(bus, EPP_ADDRESS_WRITE, &value);
    else if (offset >= PORT_EPP_DATA && offset < PORT_END)
        (void)port_cycle(bus, EPP_DATA_WRITE, &value);
}
