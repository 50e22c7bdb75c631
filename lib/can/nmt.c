/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A CANopen node as its NMT master sees it. */
#include <hm2/nmt.h>

/* Only of two responses in a row is it known that the bit must differ. */
static void check_toggle(struct hm2_nmt *const node, const struct hm2_nmt_in *const in)
{
    if (in->count == node->count)
        return;
    const bool next = node->guarded && in->count == node->count + 1u;
    if (in->guarding && next && in->toggle == node->toggle)
        node->toggle_errors++;
    node->guarded = in->guarding;
    node->count = in->count;
    node->toggle = in->toggle;
}

bool hm2_nmt_look(struct hm2_nmt *const node, const struct hm2_nmt_in *const in)
{
    check_toggle(node, in);
    return !in->lost && in->state == HM2_NMT_OPERATIONAL;
}

bool hm2_nmt_must_start(const struct hm2_nmt *const node, const struct hm2_nmt_in *const in, const int64_t now_ns)
{
    if (in->lost || (in->state != HM2_NMT_BOOT_UP && in->state != HM2_NMT_PRE_OPERATIONAL))
        return false;
    return !node->started || now_ns - node->started_ns >= HM2_NMT_RETRY_NS;
}

void hm2_nmt_started(struct hm2_nmt *const node, const int64_t now_ns)
{
    node->started = true;
    node->started_ns = now_ns;
}
