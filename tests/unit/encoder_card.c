/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "encoder_card.h"

enum { CONTROL = 0x100, STAMP = 0x300 };

#define LATCH_INDEX 0x0010u
#define JUST_ONCE   0x0040u
#define QUAD_ERROR  0x8000u
#define KEPT        0xBFF8u /* bits 15..3; bit 14 is not used here */

struct encoder_card encoder_card_open(const struct hm2_image *const image, const char *const config,
                                      const struct hm2_module_type *const type)
{
    struct encoder_card card = {.rig = rig_new(image, config)};
    const struct hm2_module *const module = rig_add(card.rig, type);
    card.base = module->md->base;
    rig_start(card.rig);
    encoder_card_take(&card);
    encoder_card_show(&card);
    return card;
}

void encoder_card_show(const struct encoder_card *const card)
{
    rig_put(card->rig, card->base, (uint32_t)(uint16_t)card->edge_ticks << 16 | (uint16_t)card->count);
    rig_put(card->rig, (uint16_t)(card->base + CONTROL), (uint32_t)card->latch << 16 | card->control);
    rig_put(card->rig, (uint16_t)(card->base + STAMP), (uint16_t)card->ticks);
}

void encoder_card_take(struct encoder_card *const card)
{
    if (!rig_wrote(card->rig, (uint16_t)(card->base + CONTROL)))
        return;
    const uint32_t word = rig_written(card->rig, (uint16_t)(card->base + CONTROL)) & KEPT;
    const uint32_t error = card->new_quad_error ? card->control & ~word & QUAD_ERROR : word & QUAD_ERROR;
    card->control = (word & ~QUAD_ERROR) | error;
}

void encoder_card_move(struct encoder_card *const card, const int64_t ticks, const int counts)
{
    card->ticks += ticks;
    card->count += counts;
    if (counts)
        card->edge_ticks = card->ticks;
}

void encoder_card_index(struct encoder_card *const card)
{
    if (!(card->control & LATCH_INDEX))
        return;
    card->latch = (uint16_t)card->count;
    if (card->control & JUST_ONCE)
        card->control &= ~LATCH_INDEX;
}

void encoder_card_quad_error(struct encoder_card *const card)
{
    card->control |= QUAD_ERROR;
}

void encoder_card_cycle(struct encoder_card *const card)
{
    encoder_card_show(card);
    rig_cycle(card->rig);
    encoder_card_take(card);
}
