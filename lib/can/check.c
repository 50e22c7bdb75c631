/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What can only be said of a DBC file as a whole. */
#include "reader.h"

#include <string.h>

bool hm2_can_length_exists(const unsigned bytes, const bool fd)
{
    static const uint8_t fd_lengths[] = {12, 16, 20, 24, 32, 48, 64};
    for (size_t i = 0; fd && i < sizeof fd_lengths; i++)
        if (bytes == fd_lengths[i])
            return true;
    return bytes <= 8u;
}

/* The one multiplexor of simple multiplexing. */
static void find_multiplexor(struct dbc_reader *const r, const struct hm2_dbc_message *const m,
                             struct hm2_dbc_signal *const s)
{
    unsigned found = 0;
    if (s->mux_count == 0 || s->multiplexor != HM2_DBC_NO_SIGNAL)
        return;
    for (uint32_t i = m->first_signal; i < m->first_signal + m->signal_count; i++) {
        const struct hm2_dbc_signal *const other = &r->dbc->signals[i];
        if (other == s || !other->is_multiplexor || other->mux_count != 0)
            continue;
        s->multiplexor = i;
        found++;
    }
    if (found != 1u)
        (void)dbc_problem(r, HM2_ERR_INVALID, s->line,
                          "%s.%s is multiplexed, and %s has %u multiplexors (M), expected 1%s", m->name, s->name,
                          m->name, found, found ? ", or SG_MUL_VAL_" : "");
}

/* A chain of multiplexors that goes in a circle is longer than any. */
static void check_depth(struct dbc_reader *const r, const struct hm2_dbc_message *const m,
                        const struct hm2_dbc_signal *const s)
{
    const struct hm2_dbc_signal *at = s;
    for (unsigned depth = 0; at->multiplexor != HM2_DBC_NO_SIGNAL; depth++) {
        if (depth >= HM2_DBC_MAX_MUX_DEPTH) {
            (void)dbc_problem(r, HM2_ERR_INVALID, s->line, "%s.%s has more than %u multiplexors above it", m->name,
                              s->name, HM2_DBC_MAX_MUX_DEPTH);
            return;
        }
        at = &r->dbc->signals[at->multiplexor];
    }
}

static void check_place(struct dbc_reader *const r, const struct hm2_dbc_message *const m,
                        const struct hm2_dbc_signal *const s)
{
    if (hm2_dbc_signal_bytes(s) > m->bytes)
        (void)dbc_problem(r, HM2_ERR_RANGE, s->line,
                          "%s.%s (start %u, %u bits, %s) reaches into byte %u, and %s has %u", m->name, s->name,
                          s->start, s->bits, s->big_endian ? "Motorola" : "Intel", hm2_dbc_signal_bytes(s), m->name,
                          m->bytes);
}

/* Signals that are always there must not share bits. Multiplexed ones may, with those that are not there with them;
 * they are only compared with the former. */
static void warn_of_overlaps(struct dbc_reader *const r, const struct hm2_dbc_message *const m)
{
    uint8_t always[HM2_CAN_MAX_BYTES] = {0}, bits[HM2_CAN_MAX_BYTES];
    for (unsigned pass = 0; pass < 2u; pass++)
        for (uint32_t i = m->first_signal; i < m->first_signal + m->signal_count; i++) {
            const struct hm2_dbc_signal *const s = &r->dbc->signals[i];
            bool overlaps = false;
            if ((s->multiplexor != HM2_DBC_NO_SIGNAL) != (pass == 1u))
                continue;
            memset(bits, 0, sizeof bits);
            hm2_dbc_put_raw(s, bits, UINT64_MAX);
            for (unsigned b = 0; b < m->bytes; b++) {
                overlaps = overlaps || (always[b] & bits[b]) != 0;
                always[b] = (uint8_t)(always[b] | (pass == 0u ? bits[b] : 0));
            }
            if (overlaps)
                hm2_diag_warn(r->diag, "%s:%u: %s.%s shares bits with another signal", r->file, s->line, m->name,
                              s->name);
        }
}

/* The file gives start values raw. */
static void convert_start(struct hm2_dbc_signal *const s)
{
    const double physical = s->start_value * s->scale + s->offset;
    s->start_value = physical - physical == 0.0 ? physical : s->offset;
}

static void check_message(struct dbc_reader *const r, struct hm2_dbc_message *const m)
{
    m->fd = m->fd || m->bytes > 8u;
    if (!hm2_can_length_exists(m->bytes, m->fd))
        (void)dbc_problem(r, HM2_ERR_RANGE, m->line,
                          "%s has %u bytes: lengths of CAN FD are 0 to 8, 12, 16, 20, 24, 32, 48, 64", m->name,
                          m->bytes);
    const unsigned before = r->problems;
    for (uint32_t i = m->first_signal; i < m->first_signal + m->signal_count; i++) {
        check_place(r, m, &r->dbc->signals[i]);
        find_multiplexor(r, m, &r->dbc->signals[i]);
        convert_start(&r->dbc->signals[i]);
    }
    if (r->problems != before)
        return;
    for (uint32_t i = m->first_signal; i < m->first_signal + m->signal_count; i++)
        check_depth(r, m, &r->dbc->signals[i]);
    if (r->problems == before)
        warn_of_overlaps(r, m);
}

void dbc_check(struct dbc_reader *const r)
{
    for (uint32_t i = 0; i < r->dbc->message_count; i++)
        check_message(r, &r->dbc->messages[i]);
}
