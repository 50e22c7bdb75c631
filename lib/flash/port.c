/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "port.h"

#include <string.h>

#include <hm2/bytes.h>

#define MS           INT64_C(1000000)
#define STATUS_WORDS 6u /* error flags, parse, memory and write errors, packets, UDP packets */
#define MAX_STALE    64u

/* How long an answer is waited for: `first_ns` before there is experience, then four times the worst of late, doubled
 * with every try, all within limits. An erase takes up to 3 s and a page 5 ms (flash tool reference 4.3). */
static const struct {
    int64_t first_ns, min_ns, max_ns;
} patience[FLASH_WORKS] = {
    [FLASH_WORK_READ] = {100 * MS, 30 * MS, 1000 * MS},
    [FLASH_WORK_PROGRAM] = {200 * MS, 80 * MS, 1000 * MS},
    [FLASH_WORK_ERASE] = {4000 * MS, 1000 * MS, 5000 * MS},
};

void flash_port_init(struct flash_port *const port, struct link *const link)
{
    memset(port, 0, sizeof *port);
    port->link = link;
    /* Numbers that an earlier program is unlikely to have used, should its replies still be on their way. */
    port->sequence = (uint16_t)((uint64_t)link_now_ns(link) / 1000u);
    port->accepted = port->sequence;
}

void flash_port_begin(struct flash_port *const port)
{
    port->sequence++;
    lbp16_builder_init(&port->builder, port->request, sizeof port->request);
    (void)lbp16_add_read16(&port->builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_SCRATCH, 1, &port->before_at);
    (void)lbp16_add_write16(&port->builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_SCRATCH, 1, &port->sequence, NULL);
}

static int seal(struct flash_port *const port)
{
    (void)lbp16_add_read16(&port->builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_ERROR, STATUS_WORDS, &port->status_at);
    return lbp16_add_read16(&port->builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_SCRATCH, 1, &port->echo_at);
}

static int64_t patience_of(const struct flash_port *const port, const enum flash_work work, const unsigned try)
{
    int64_t ns = port->worst_ns[work] > 0 ? 4 * port->worst_ns[work] : patience[work].first_ns;
    if (ns < patience[work].min_ns)
        ns = patience[work].min_ns;
    for (unsigned i = 0; i < try && ns < patience[work].max_ns; i++)
        ns *= 2;
    return ns < patience[work].max_ns ? ns : patience[work].max_ns;
}

/* So many datagrams have come to the card since they were last counted, and so many were sent. */
static void count_others(struct flash_port *const port, const uint16_t come)
{
    if (come > port->unaccounted)
        port->counters.foreign += come - port->unaccounted;
    port->behind += (int64_t)port->unaccounted - come;
    port->rx_udp = (uint16_t)(port->rx_udp + come);
    port->unaccounted = 0;
}

/* Before a request the scratch register held the number of one of ours, sent since the last that is known to have come,
 * or somebody else has written it. */
static void look_for_intruders(struct flash_port *const port)
{
    const uint16_t before = hm2_get_le16(port->reply + port->before_at);
    if ((uint16_t)(before - port->accepted) > (uint16_t)(port->sequence - port->accepted))
        port->intruders++;
}

static uint16_t come_since(const struct flash_port *const port, const size_t status_at)
{
    return (uint16_t)(hm2_get_le16(port->reply + status_at + LBP16_CONTROL_RX_UDP) - port->rx_udp);
}

/* Who else has been here since the last answer? */
static void account(struct flash_port *const port)
{
    const uint16_t come = come_since(port, port->status_at);
    if (port->greeted) {
        look_for_intruders(port);
        count_others(port, come);
    }
    port->greeted = true;
    port->rx_udp = hm2_get_le16(port->reply + port->status_at + LBP16_CONTROL_RX_UDP);
    port->unaccounted = 0;
    port->accepted = port->sequence;
}

static bool answers(const struct flash_port *const port, const int len)
{
    return len >= 0 && (size_t)len == port->builder.reply_bytes &&
           hm2_get_le16(port->reply + port->echo_at) == port->sequence;
}

static int try_once(struct flash_port *const port, const int64_t ns)
{
    const int64_t deadline_ns = link_now_ns(port->link) + ns;
    int err = link_send(port->link, port->request, port->builder.used);
    port->counters.sent++;
    port->unaccounted++;
    for (unsigned i = 0; i < MAX_STALE; i++) {
        const int len = link_recv(port->link, port->reply, sizeof port->reply, deadline_ns);
        if (answers(port, len))
            return 0;
        if (len == HM2_ERR_TIMEOUT)
            return err < 0 ? err : len;
        if (len >= 0)
            port->counters.stale++;
        else
            err = len;
    }
    return err < 0 ? err : HM2_ERR_TIMEOUT;
}

int flash_port_run(struct flash_port *const port, const enum flash_work work, const unsigned tries)
{
    int err = seal(port);
    if (err < 0)
        return err;
    err = HM2_ERR_TIMEOUT;
    for (unsigned try = 0; try < tries && err != 0; try++) {
        const int64_t start_ns = link_now_ns(port->link);
        err = try_once(port, patience_of(port, work, try));
        port->counters.resent += try > 0;
        const int64_t took_ns = link_now_ns(port->link) - start_ns;
        const int64_t faded_ns = port->worst_ns[work] - port->worst_ns[work] / 8;
        if (err == 0)
            port->worst_ns[work] = took_ns > faded_ns ? took_ns : faded_ns;
    }
    if (err < 0)
        return HM2_ERR_TIMEOUT;
    port->counters.replies++;
    account(port);
    return 0;
}

/* ---- several at once ----------------------------------------------------------------------------------------------
 */

#define STATUS_FROM_END (2u * (STATUS_WORDS + 1u)) /* status words, then the echo */

void flash_batch_begin(const struct flash_port *const port, struct flash_batch *const batch)
{
    *batch = (struct flash_batch){.first = (uint16_t)(port->sequence + 1)};
}

int flash_batch_send(struct flash_port *const port, struct flash_batch *const batch)
{
    const int err = seal(port);
    if (err < 0)
        return err;
    batch->part[batch->sent].reply_bytes = port->builder.reply_bytes;
    batch->sent++;
    port->counters.sent++;
    port->unaccounted++;
    return link_send(port->link, port->request, port->builder.used);
}

int flash_batch_receive(struct flash_port *const port, struct flash_batch *const batch)
{
    const int64_t deadline_ns = link_now_ns(port->link) + patience_of(port, FLASH_WORK_READ, 0);
    for (unsigned i = 0; i < MAX_STALE; i++) {
        const int len = link_recv(port->link, port->reply, sizeof port->reply, deadline_ns);
        if (len < 0)
            return len;
        if ((size_t)len < STATUS_FROM_END + 2u) {
            port->counters.stale++;
            continue;
        }
        const unsigned which = (uint16_t)(hm2_get_le16(port->reply + len - 2) - batch->first);
        if (which >= batch->sent || batch->part[which].answered || batch->part[which].reply_bytes != (size_t)len) {
            port->counters.stale++;
            continue;
        }
        const uint16_t come = come_since(port, (size_t)len - STATUS_FROM_END);
        batch->part[which].answered = true;
        batch->answered++;
        batch->come = come > batch->come ? come : batch->come;
        port->counters.replies++;
        look_for_intruders(port);
        return (int)which;
    }
    return HM2_ERR_TIMEOUT;
}

/* What is not answered stays open for the next exchange to account for. */
void flash_batch_end(struct flash_port *const port, const struct flash_batch *const batch)
{
    if (batch->answered == batch->sent)
        count_others(port, batch->come);
}

int flash_port_fire(struct flash_port *const port)
{
    port->counters.sent++;
    port->unaccounted++;
    return port->builder.error < 0 ? port->builder.error : link_send(port->link, port->request, port->builder.used);
}

void flash_port_wait(struct flash_port *const port, const int64_t ns)
{
    const int64_t until_ns = link_now_ns(port->link) + ns;
    while (link_now_ns(port->link) < until_ns) {
        const int len = link_recv(port->link, port->reply, sizeof port->reply, until_ns);
        if (len >= 0)
            port->counters.stale++;
    }
}
