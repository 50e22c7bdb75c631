/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Index and probe: arming a latch and noticing that it fired, without false events when packets are lost, late or
 * doubled (hal-interface 6, row 9).
 *
 * The card clears the arming bit (4 or 13) at the event, and only that: bit 6, "just once", stays as written. So a
 * control word that reads bit 6 set and the arming bit clear proves that the arming write arrived and that the latch
 * fired after it, provided that bit 6 was read clear before arming. Therefore nothing is armed before the card was seen
 * with bit 6 clear, and an event counts only when the write that armed it is confirmed. The polarity must be in place
 * before too: a write that changes it can itself make an edge (register map 3.5.1).
 *
 * A word may have to be written again while it is armed: because its confirmation got lost, or because another of its
 * bits changed. If the latch fired just before, that write arms it anew, and the bits tell nothing. The latched count
 * does: it only changes when the latch fires, so another value than before arming is an event too.
 */
#include "encoder.h"

#include <hm2/bytes.h>

uint32_t encoder_arm(struct encoder *const enc, const uint32_t polarity, const bool has_probe)
{
    uint32_t wanted = 0;
    if (*enc->index_enable)
        wanted = ENCODER_LATCH_INDEX | ENCODER_JUST_ONCE;
    else if (has_probe && *enc->probe_enable)
        wanted = ENCODER_LATCH_PROBE | ENCODER_JUST_ONCE;
    const uint32_t armed = enc->word & ENCODER_LATCHES;
    if (!armed) {
        if (!wanted || (enc->seen ^ polarity) & (ENCODER_LATCH_INDEX | ENCODER_JUST_ONCE | ENCODER_INDEX_HIGH))
            return 0;
        enc->latch_before = (uint16_t)(enc->seen >> 16);
        enc->latch_known = true;
        return wanted;
    }
    /* From armed the way leads over disarmed, also when the pin was set again at once. */
    const bool keep = !enc->spent && armed == (wanted & ENCODER_LATCHES);
    enc->spent = false;
    if (!keep)
        enc->seen |= ENCODER_JUST_ONCE; /* until the card is seen without it */
    return keep ? wanted : 0;
}

static void latch_fired(struct encoder *const enc, const uint16_t latch)
{
    /* The latch and the counter are of the same reply: they differ by less than half a turn of 16 bits. */
    enc->latched = enc->raw + hm2_delta16(latch, (uint16_t)enc->count_word);
    enc->spent = true;
    if (enc->word & ENCODER_LATCH_INDEX) {
        if (!*enc->no_clear_on_index)
            enc->zero = enc->latched;
        *enc->index_enable = false;
    } else {
        *enc->probe_enable = false;
    }
}

void encoder_check_latch(struct encoder *const enc, const uint32_t control)
{
    const uint16_t latch = (uint16_t)(control >> 16);
    const uint32_t armed = enc->word & ENCODER_LATCHES;
    if (!armed || enc->spent)
        return;
    const bool cleared_itself = !(control & armed) && (control & ENCODER_JUST_ONCE);
    const bool latched_anew = enc->latch_known && latch != enc->latch_before;
    if (latched_anew || (cleared_itself && hm2_section_confirmed(&enc->control)))
        latch_fired(enc, latch);
}

void encoder_forget_latch(struct encoder *const enc)
{
    enc->latch_known = false;
    enc->spent = false;
    hm2_section_touch(&enc->control);
}
