/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "absenc.h"

#include <math.h>
#include <stdio.h>

#include "bind.h"

#define INVALID_CYCLES 10
#define TIMERS         4u
#define BITS_IN_WORD   32u

/* ---- for the kinds -------------------------------------------------------------------------------------------------
 */

const char *hm2_absenc_output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"clock", "clock-enable"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

int hm2_absenc_add_control(struct hm2_absenc_channel *const channel, const struct hm2_module *const module,
                           struct hm2_setup *const setup, const unsigned control, const unsigned reg)
{
    return hm2_plan_add_setup(setup->plan, &channel->control[control], HM2_RANK_NORMAL,
                              hm2_md_address(module->md, reg, channel->number), 1, 0, setup->diag);
}

uint32_t hm2_absenc_rate(const struct hm2_absenc_channel *const channel, const struct hm2_module *const module,
                         const double one, const uint32_t max)
{
    const double wanted_khz = *channel->frequency_khz;
    const double per_khz = one * 1000.0 / module->md->clock_hz;
    const uint32_t rate = hm2_trunc_u32(wanted_khz * per_khz);
    if (rate >= 1 && rate <= max)
        return rate;
    hm2_notice_point(module, isfinite(wanted_khz) ? HM2_NOTICE_VALUE_CLAMPED : HM2_NOTICE_VALUE_INVALID,
                     "frequency-khz", channel->number, wanted_khz);
    const uint32_t possible = rate < 1 ? 1 : max;
    *channel->frequency_khz = (possible + 0.5) / per_khz; /* half a step up, so that it is truncated to itself */
    return possible;
}

uint32_t hm2_absenc_timer(const struct hm2_absenc_channel *const channel, const struct hm2_module *const module)
{
    const uint32_t timer = *channel->timer_number;
    if (timer <= TIMERS)
        return timer;
    hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "timer-number", channel->number, timer);
    *channel->timer_number = TIMERS;
    return TIMERS;
}

int64_t hm2_absenc_clocks_ns(const struct hm2_absenc_channel *const channel, const double clocks)
{
    return (int64_t)(clocks * 1e6 / *channel->frequency_khz);
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

/* The format of a channel, "" without one: without it there is no channel. */
static const char *format_of(const struct hm2_config *const config, const uint8_t gtag, const unsigned channel)
{
    if (channel >= HM2_CFG_CHANNELS)
        return "";
    if (gtag == HM2_GTAG_SSI)
        return config->ssi_format[channel];
    return gtag == HM2_GTAG_BISS ? config->biss_format[channel] : config->fanuc_format[channel];
}

/* A channel's pins belong to it when it has a format. */
static bool filter_pin(const struct hm2_pd *const pd, const struct hm2_setup *const setup)
{
    return format_of(setup->config, pd->secondary_tag, pd->secondary_unit)[0] != '\0';
}

static int add_channel(struct hm2_absenc *const ctx, struct hm2_module *const module, struct hm2_setup *const setup,
                       const unsigned number)
{
    struct hm2_absenc_channel *const channel = &ctx->channel[ctx->count++];
    const char *const format = hm2_absenc_expand(format_of(setup->config, module->type->gtag, number));
    const unsigned bits = hm2_absenc_format_bits(format);
    char prefix[HM2_NAME_SIZE];
    if (bits == 0 || bits > ctx->kind->max_bits)
        return hm2_diag_add(setup->diag, HM2_ERR_INVALID,
                            "%s: the format of %s channel %u has %u bits; 1 to %u are expected, as many as the module "
                            "receives",
                            setup->prefix, module->type->name, number, bits, ctx->kind->max_bits);
    channel->number = number;
    channel->words = (bits + BITS_IN_WORD - 1) / BITS_IN_WORD;
    channel->for_khz = NAN;
    int err = hm2_bind_group(setup, ctx->kind->group, channel, number);
    (void)snprintf(prefix, sizeof prefix, "%s.%s.%02u", setup->prefix, module->type->name, number);
    if (!err)
        err = hm2_absenc_fields_bind(&channel->fields, setup, format, prefix);
    if (!err)
        err = ctx->kind->add_registers(channel, module, setup);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &channel->start, HM2_RANK_LAST, hm2_md_address(module->md, 0, number), 1,
                                 HM2_SECTION_ON_DEMAND, setup->diag);
    return err;
}

int hm2_absenc_setup(struct hm2_module *const module, struct hm2_setup *const setup,
                     const struct hm2_absenc_kind *const kind)
{
    unsigned wanted = 0;
    for (unsigned i = 0; i < module->instances; i++)
        wanted += format_of(setup->config, module->type->gtag, i)[0] != '\0';
    if (wanted == 0)
        return 0;
    struct hm2_absenc *const ctx = hm2_setup_alloc(setup, sizeof *ctx + wanted * sizeof ctx->channel[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->kind = kind;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, true, filter_pin);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->busy, HM2_RANK_FIRST,
                                hm2_md_address(module->md, kind->busy_register, 0), 1, setup->diag);
    for (unsigned i = 0; !err && i < module->instances; i++)
        if (format_of(setup->config, module->type->gtag, i)[0] != '\0')
            err = add_channel(ctx, module, setup, i);
    return err;
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

void hm2_absenc_start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct hm2_absenc *const ctx = module->context;
    for (unsigned i = 0; ctx && i < ctx->count; i++) {
        struct hm2_absenc_channel *const channel = &ctx->channel[i];
        channel->running = channel->again = channel->suspect = false;
        channel->started_ns = channel->good_ns = cycle->now_ns;
    }
}

static void take_reading(struct hm2_absenc_channel *const channel, const struct hm2_module *const module,
                         const struct hm2_cycle *const cycle)
{
    uint32_t words[HM2_ABSENC_WORDS] = {0};
    for (unsigned i = 0; i < channel->words; i++)
        words[i] = hm2_window_get(&channel->data[i], 0);
    hm2_absenc_fields_show(&channel->fields, module, channel->number, words);
    channel->good_ns = cycle->now_ns;
}

void hm2_absenc_unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct hm2_absenc *const ctx = module->context;
    const uint32_t busy = hm2_window_get(&ctx->busy, 0);
    for (unsigned i = 0; i < ctx->count; i++) {
        struct hm2_absenc_channel *const channel = &ctx->channel[i];
        const bool complete = !(busy >> channel->number & 1u);
        if (complete && !channel->suspect && (!ctx->kind->is_good || ctx->kind->is_good(channel)))
            take_reading(channel, module, cycle);
        if (complete)
            channel->running = channel->suspect = false;
        else if (cycle->now_ns - channel->started_ns > 2 * channel->transfer_ns)
            channel->running = false; /* nobody answers, or the start was lost: it may be given again */
        const int64_t patience_ns = INVALID_CYCLES * cycle->period_ns + 2 * channel->transfer_ns;
        *channel->data_invalid = cycle->now_ns - channel->good_ns > patience_ns;
        hm2_absenc_fields_follow(&channel->fields, module, channel->number);
    }
}

HM2_RARE static void take_parameters(struct hm2_absenc_channel *const channel, const struct hm2_module *const module)
{
    const struct hm2_absenc *const ctx = module->context;
    ctx->kind->set_registers(channel, module);
    channel->for_khz = *channel->frequency_khz;
    channel->for_timer = *channel->timer_number;
    channel->for_filter = channel->filter ? *channel->filter : 0;
}

static bool controls_arrived(const struct hm2_absenc_channel *const channel, const unsigned controls)
{
    for (unsigned i = 0; i < controls; i++)
        if (!hm2_section_confirmed(&channel->control[i]))
            return false;
    return true;
}

/* A start before the control registers are known to have arrived reads with the wrong length or, with BISS, takes the
 * filter's first rise for a start bit. */
static void start_transfer(struct hm2_absenc_channel *const channel, const unsigned controls,
                           const struct hm2_cycle *const cycle)
{
    if (channel->again)
        channel->started_ns = cycle->now_ns;
    channel->again = false;
    if (channel->running || cycle->now_ns - channel->started_ns < channel->transfer_ns ||
        !controls_arrived(channel, controls))
        return;
    hm2_section_touch(&channel->start);
    channel->running = true;
    channel->started_ns = cycle->now_ns;
}

void hm2_absenc_pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct hm2_absenc *const ctx = module->context;
    for (unsigned i = 0; i < ctx->count; i++) {
        struct hm2_absenc_channel *const channel = &ctx->channel[i];
        if (!(*channel->frequency_khz == channel->for_khz) || *channel->timer_number != channel->for_timer ||
            (channel->filter && *channel->filter != channel->for_filter))
            take_parameters(channel, module);
        if (channel->for_timer == 0)
            start_transfer(channel, ctx->kind->controls, cycle);
    }
}

/* The start is sent again with the next write. If the lost one arrives after all there are two, the second perhaps in
 * the middle of the first transfer: what comes of it is not used. */
void hm2_absenc_write_lost(struct hm2_module *const module)
{
    struct hm2_absenc *const ctx = module->context;
    for (unsigned i = 0; ctx && i < ctx->count; i++) {
        struct hm2_absenc_channel *const channel = &ctx->channel[i];
        if (channel->running && !hm2_section_confirmed(&channel->start))
            channel->again = channel->suspect = true;
    }
}
