/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* User LEDs of the card (register map 3.3, hal-interface 2.5): one write-only word, LED CR01 in bit 31. */
#include "bind.h"
#include "levels.h"
#include "module_types.h"

#define MAX_LEDS 32u

struct leds {
    unsigned gathered;              /* LEDs in whole groups of HM2_GATHER */
    hm2_bit_t nothing;              /* stays 0 */
    struct hm2_bit_in on[MAX_LEDS]; /* the last of them first; of LEDs that do not exist: the constant 0 */
    uint32_t seen;                  /* which are lit, as handed to the plan last */
    struct hm2_section data;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct hm2_bit_in, bit, "CR##", HM2_BIT, HM2_PIN_IN, 0, "", "1 = lit"),
};

static const struct hm2_point_group groups[] = {
    {"led", points, sizeof points / sizeof points[0], "one for each LED of the card, from CR01 on"},
    {NULL, NULL, 0, NULL},
};

/* The descriptor does not tell how many LEDs there are, the card's name does. */
static unsigned led_count(const struct hm2_setup *const setup)
{
    const unsigned present = setup->board_leds < MAX_LEDS ? setup->board_leds : MAX_LEDS;
    const int wanted = setup->config->count[HM2_CFG_LEDS];
    if (wanted < 0)
        return present;
    if ((unsigned)wanted > present)
        hm2_diag_warn(setup->diag, "num_leds=%d, but %s has %u user LEDs; using %u", wanted, setup->prefix, present,
                      present);
    return (unsigned)wanted < present ? (unsigned)wanted : present;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct leds *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    const unsigned count = led_count(setup);
    ctx->gathered = (count + HM2_GATHER - 1u) / HM2_GATHER * HM2_GATHER;
    int err = 0;
    for (unsigned i = 0; err == 0 && i < ctx->gathered; i++) {
        struct hm2_bit_in *const led = &ctx->on[ctx->gathered - 1u - i];
        if (i < count)
            err = hm2_bind_group(setup, &groups[0], led, i + 1);
        else
            led->bit = &ctx->nothing;
    }
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ctx->data, HM2_RANK_NORMAL, hm2_md_address(module->md, 0, 0), 1, 0,
                                 setup->diag);
    return err;
}

HM2_RARE static void show(struct leds *const ctx, const uint32_t lit, const bool first)
{
    ctx->seen = lit;
    hm2_section_set(&ctx->data, 0, (uint32_t)((uint64_t)lit << (MAX_LEDS - ctx->gathered))); /* by 32: no LED */
    if (first)
        hm2_section_touch(&ctx->data);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct leds *const ctx = module->context;
    const uint32_t lit = hm2_gather(ctx->on, ctx->gathered);
    if (lit != ctx->seen || cycle->writes == 0)
        show(ctx, lit, cycle->writes == 0);
}

static const struct hm2_md_variant variants[] = {{.version = 0, .registers = 1, .instance_stride = 4, .multiple = 0}};

const struct hm2_module_type hm2_led_type = {
    .name = "led",
    .gtag = HM2_GTAG_LED,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1, /* num_leds counts LEDs, not instances; see led_count() */
    .setup = setup,
    .pack = pack,
    .groups = groups,
};
