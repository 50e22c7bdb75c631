/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Set-up of a card's modules: which of them this library drives, how many instances, in which order. */
#include <stdio.h>
#include <string.h>

#include "board_private.h"

/* What num_ keys count, by module tag (hal-interface 1.2, 1.5). */
struct counted {
    uint8_t gtag[2];
    uint8_t per_instance; /* single resolvers are counted, six of which are one instance */
    bool clamped;         /* too many are cut with a message instead of refused */
};

static const struct counted counted[HM2_CFG_COUNTS] = {
    [HM2_CFG_ENCODERS] = {{HM2_GTAG_ENCODER, HM2_GTAG_MUXED_ENCODER}, 1, false},
    [HM2_CFG_RESOLVERS] = {{HM2_GTAG_RESOLVER}, 6, false},
    [HM2_CFG_PWMGENS] = {{HM2_GTAG_PWMGEN}, 1, false},
    [HM2_CFG_3PWMGENS] = {{HM2_GTAG_TPPWM}, 1, false},
    [HM2_CFG_RCPWMGENS] = {{HM2_GTAG_RCPWM}, 1, false},
    [HM2_CFG_STEPGENS] = {{HM2_GTAG_STEPGEN}, 1, false},
    [HM2_CFG_INMUXS] = {{HM2_GTAG_INMUX}, 1, false},
    [HM2_CFG_INMS] = {{HM2_GTAG_INM}, 1, false},
    [HM2_CFG_OUTMS] = {{HM2_GTAG_OUTM}, 1, false},
    [HM2_CFG_SSRS] = {{HM2_GTAG_SSR}, 1, false},
    [HM2_CFG_ONESHOTS] = {{HM2_GTAG_ONESHOT}, 1, false},
    [HM2_CFG_PERIODMS] = {{HM2_GTAG_PERIODM}, 1, false},
    [HM2_CFG_XY2MODS] = {{HM2_GTAG_XY2MOD}, 1, false},
    [HM2_CFG_BSPIS] = {{HM2_GTAG_BSPI}, 1, false},
    [HM2_CFG_UARTS] = {{HM2_GTAG_UART_TX, HM2_GTAG_UART_RX}, 1, false},
    [HM2_CFG_PKTUARTS] = {{HM2_GTAG_PKTUART_TX, HM2_GTAG_PKTUART_RX}, 1, false},
    [HM2_CFG_LEDS] = {{HM2_GTAG_LED}, 1, true},
    [HM2_CFG_DPLLS] = {{HM2_GTAG_DPLL}, 1, true},
};

static unsigned instances_of(const struct hm2_idrom *const idrom, const uint8_t gtag)
{
    const struct hm2_md *const md = gtag ? hm2_idrom_find(idrom, gtag) : NULL;
    return md ? md->instances : 0;
}

static unsigned available(const struct hm2_idrom *const idrom, const struct counted *const what)
{
    const unsigned a = instances_of(idrom, what->gtag[0]);
    const unsigned b = instances_of(idrom, what->gtag[1]);
    return (a > b ? a : b) * what->per_instance;
}

/* More than the firmware has is refused, for modules without a driver here too (hal-interface 1.2). What it lacks
 * altogether has no effect: LinuxCNC's driver does not even look at such a count, so that there are load lines with it.
 * LEDs are counted by the card's name, so their own module looks after them. */
static int check_counts(const struct hm2_board *const board, struct hm2_diag *const diag)
{
    int err = 0;
    for (unsigned i = 0; i < HM2_CFG_COUNTS; i++) {
        const unsigned there = available(&board->idrom, &counted[i]);
        const int wanted = board->config.count[i];
        if (wanted <= 0 || (unsigned)wanted <= there || i == HM2_CFG_LEDS)
            continue;
        const char *const key = hm2_config_key((enum hm2_config_count)i);
        if (there == 0)
            hm2_diag_warn(diag, "%s: config %s=%d has no effect: the firmware has none", board->prefix, key, wanted);
        else if (counted[i].clamped)
            hm2_diag_warn(diag, "%s: config %s=%d, but the firmware has %u; using %u", board->prefix, key, wanted,
                          there, there);
        else
            err = hm2_diag_add(diag, HM2_ERR_INVALID,
                               "%s: config %s=%d found, at most %u expected: the firmware has no more", board->prefix,
                               key, wanted, there);
    }
    return err;
}

static int check_channels(const struct hm2_board *const board, const char *const key,
                          const char formats[HM2_CFG_CHANNELS][HM2_CFG_FORMAT_SIZE], const uint8_t gtag,
                          struct hm2_diag *const diag)
{
    const unsigned there = instances_of(&board->idrom, gtag);
    int err = 0;
    for (unsigned i = there; i < HM2_CFG_CHANNELS; i++)
        if (formats[i][0] && there == 0)
            hm2_diag_warn(diag, "%s: config %s_%u has no effect: the firmware has no such channels", board->prefix, key,
                          i);
        else if (formats[i][0])
            err = hm2_diag_add(diag, HM2_ERR_INVALID, "%s: config %s_%u found, but the firmware has %u such channels",
                               board->prefix, key, i, there);
    return err;
}

static void check_daughters(const struct hm2_board *const board, struct hm2_diag *const diag)
{
    for (unsigned i = board->idrom.io_ports; i < HM2_CFG_CONNECTORS; i++)
        if (board->config.dbname[i])
            hm2_diag_warn(diag, "%s: config dbname%u has no effect: the card has %u connectors", board->prefix, i + 1u,
                          board->idrom.io_ports);
}

static int check_serial(const struct hm2_board *const board, struct hm2_diag *const diag)
{
    const struct hm2_config *const config = &board->config;
    const unsigned there =
        instances_of(&board->idrom, HM2_GTAG_SSERIAL) + instances_of(&board->idrom, HM2_GTAG_SSERIALB);
    int err = 0;
    /* LinuxCNC's driver passes over such a token in silence, so that there are load lines with it. */
    for (unsigned i = there; i < HM2_CFG_SSERIAL_PORTS; i++)
        if (config->sserial_port_used[i])
            hm2_diag_warn(diag, "%s: config sserial_port_%u has no effect: the firmware has %u smart-serial ports",
                          board->prefix, i, there);
    static const struct {
        const char *key;
        uint8_t gtag;
    } kinds[] = {{"ssi_chan", HM2_GTAG_SSI}, {"biss_chan", HM2_GTAG_BISS}, {"fanuc_chan", HM2_GTAG_FABS}};
    const char(*const formats[])[HM2_CFG_FORMAT_SIZE] = {config->ssi_format, config->biss_format, config->fanuc_format};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        const int bad = check_channels(board, kinds[i].key, formats[i], kinds[i].gtag, diag);
        err = bad < 0 ? bad : err;
    }
    return err;
}

/* ---- module descriptors -------------------------------------------------------------------------------------------
 */

static bool is_variant(const struct hm2_module_type *const type, const struct hm2_md *const md)
{
    for (size_t i = 0; i < type->variant_count; i++) {
        const struct hm2_md_variant *const v = &type->variants[i];
        if (v->version == md->version && v->registers == md->registers && v->instance_stride == md->instance_stride &&
            v->multiple == md->multiple)
            return true;
    }
    return type->variant_count == 0;
}

/* What the card cannot be driven without, and what the load line asks for by number. */
static bool is_needed(const struct hm2_board *const board, const struct hm2_module_type *const type)
{
    return type->gtag == HM2_GTAG_WATCHDOG || type->gtag == HM2_GTAG_IOPORT ||
           (type->config_count >= 0 && type->config_count < (int)HM2_CFG_COUNTS &&
            board->config.count[type->config_count] > 0);
}

/* A module that cannot be driven: an error where it is needed, else it is left alone, as unknown tags are. */
static int leave_alone(const struct hm2_board *const board, const struct hm2_module_type *const type,
                       const char *const sentence, struct hm2_diag *const diag)
{
    if (is_needed(board, type))
        return hm2_diag_add(diag, HM2_ERR_MISMATCH, "%s: %s", board->prefix, sentence);
    hm2_diag_warn(diag, "%s: %s; it is left alone", board->prefix, sentence);
    return 0;
}

static int leave_variant(const struct hm2_board *const board, const struct hm2_module_type *const type,
                         const struct hm2_md *const md, struct hm2_diag *const diag)
{
    char expected[512] = "", sentence[768];
    size_t used = 0;
    for (size_t i = 0; i < type->variant_count && used < sizeof expected; i++) {
        const struct hm2_md_variant *const v = &type->variants[i];
        used += (size_t)snprintf(expected + used, sizeof expected - used, "%s0x%02X/%u/%u/0x%X", i ? " or " : "",
                                 v->version, v->registers, (unsigned)v->instance_stride, (unsigned)v->multiple);
    }
    (void)snprintf(sentence, sizeof sentence,
                   "module %s (tag 0x%02X): version/registers/instance stride/register mask 0x%02X/%u/%u/0x%X found, "
                   "expected %s; the firmware does not suit this driver",
                   hm2_tag_name(md->gtag), md->gtag, md->version, md->registers, (unsigned)md->instance_stride,
                   (unsigned)md->multiple, expected);
    return leave_alone(board, type, sentence, diag);
}

/* Two types of one HAL name (plain and muxed encoders) would create the same pins: the module that has the name, or
 * NULL. */
static const struct hm2_module *twin_of(const struct hm2_board *const board, const struct hm2_module_type *const type)
{
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].md && strcmp(board->modules[i].type->name, type->name) == 0)
            return &board->modules[i];
    return NULL;
}

static int leave_twin(const struct hm2_board *const board, const struct hm2_module_type *const type,
                      const struct hm2_module *const twin, struct hm2_diag *const diag)
{
    char sentence[256];
    (void)snprintf(sentence, sizeof sentence,
                   "the firmware has both %s and %s, which share the name %s; only %s is used",
                   hm2_tag_name(twin->md->gtag), hm2_tag_name(type->gtag), type->name, hm2_tag_name(twin->md->gtag));
    return leave_alone(board, type, sentence, diag);
}

static unsigned instances_to_use(const struct hm2_board *const board, const struct hm2_module_type *const type,
                                 const struct hm2_md *const md)
{
    if (type->config_count < 0 || type->config_count >= (int)HM2_CFG_COUNTS)
        return md->instances;
    const int wanted = board->config.count[type->config_count];
    return wanted < 0 || wanted > md->instances ? md->instances : (unsigned)wanted;
}

static int add_module(struct hm2_board *const board, const struct hm2_module_type *const type,
                      const struct hm2_md *const md, struct hm2_diag *const diag)
{
    if (md && !is_variant(type, md))
        return leave_variant(board, type, md, diag);
    const struct hm2_module *const twin = md ? twin_of(board, type) : NULL;
    if (twin)
        return leave_twin(board, type, twin, diag);
    if (board->module_count == BOARD_MODULES)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "%s: more than %u modules", board->prefix, BOARD_MODULES);
    struct hm2_module *const module = &board->modules[board->module_count++];
    *module = (struct hm2_module){
        .type = type,
        .md = md,
        .board = board,
        .instances = md ? instances_to_use(board, type, md) : 1,
        .prefix = board->prefix,
    };
    if (type->gtag == HM2_GTAG_WATCHDOG)
        board->watchdog = module;
    return 0;
}

/* Select outputs belong to the muxed encoder and have no registers (register map 2.1, tag 0D). */
static bool has_driver(const uint8_t gtag)
{
    for (const struct hm2_module_type *const *type = hm2_module_types; *type; type++)
        if ((*type)->gtag == gtag)
            return true;
    return gtag == HM2_GTAG_MUXED_ENCODER_SEL;
}

static int match_modules(struct hm2_board *const board, struct hm2_diag *const diag)
{
    const struct hm2_idrom *const idrom = &board->idrom;
    for (unsigned i = 0; i < idrom->module_count; i++)
        if (!has_driver(idrom->modules[i].gtag))
            hm2_diag_warn(diag, "%s: module %s (tag 0x%02X, version 0x%02X) has no driver here and is left alone",
                          board->prefix, hm2_tag_name(idrom->modules[i].gtag), idrom->modules[i].gtag,
                          idrom->modules[i].version);
    int err = 0;
    for (const struct hm2_module_type *const *type = hm2_module_types; *type; type++) {
        const struct hm2_md *const md = hm2_idrom_find(idrom, (*type)->gtag);
        if (!md && (*type)->gtag != HM2_GTAG_NONE)
            continue;
        const int bad = add_module(board, *type, md, diag);
        err = bad < 0 ? bad : err;
    }
    return err;
}

/* ---- modules ------------------------------------------------------------------------------------------------------
 */

static int setup_peek(struct hm2_setup *const setup, const uint16_t address, const unsigned words,
                      uint32_t *const values)
{
    return board_peek(setup->access, address, words, values);
}

static int setup_poke(struct hm2_setup *const setup, const uint16_t address, const unsigned words,
                      const uint32_t *const values)
{
    return board_poke(setup->access, address, words, values, BOARD_TRIES, BOARD_TRY_NS);
}

static int64_t setup_now_ns(const struct hm2_setup *const setup)
{
    const struct hm2_board *const board = setup->access;
    return link_now_ns(board->link);
}

static int setup_one(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const unsigned before = setup->diag ? setup->diag->problems : 0;
    const int err = module->type->setup(module, setup);
    /* A failure without a sentence still gets one. */
    if (err < 0 && setup->diag && setup->diag->problems == before)
        return hm2_diag_add(setup->diag, err, "%s: module %s cannot be set up: %s", setup->prefix, module->type->name,
                            hm2_strerror(err));
    return err;
}

static int setup_modules(struct hm2_board *const board, struct hm2_setup *const setup)
{
    int err = 0;
    for (unsigned i = 0; i < board->module_count; i++) {
        const int bad = setup_one(&board->modules[i], setup);
        err = bad < 0 ? bad : err;
    }
    return err;
}

static void add_call(struct board_calls *const calls, struct hm2_module *const module,
                     void (*const function)(struct hm2_module *module, const struct hm2_cycle *cycle))
{
    if (function && module->context)
        calls->call[calls->count++] = (struct board_call){function, module};
}

static void prepare_cycle(struct hm2_board *const board)
{
    board->reply = (struct board_buffer){hm2_plan_reply_buffer(board->plan), hm2_plan_reply_capacity(board->plan)};
    for (unsigned i = 0; i < board->module_count; i++) {
        struct hm2_module *const module = &board->modules[i];
        add_call(&board->unpacks, module, module->type->unpack);
        add_call(&board->packs, module, module->type->pack);
    }
}

static int lay_out(struct hm2_board *const board, struct hm2_diag *const diag)
{
    const unsigned timer = board->config.pipelined;
    if (timer == 0)
        return hm2_plan_freeze(board->plan, diag);
    board_pipeline_setup(board);
    int err = hm2_plan_pipeline(board->plan, timer, diag);
    if (err == 0)
        err = hm2_plan_freeze(board->plan, diag);
    if (err == 0 && !hm2_plan_pipelines(board->plan))
        board_pipeline_warn(board, diag);
    return err;
}

static int create_objects(struct hm2_board *const board, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    struct hm2_setup setup = {
        .idrom = &board->idrom,
        .config = &board->config,
        .plan = board->plan,
        .binder = binder,
        .pins = board->pins,
        .diag = diag,
        .prefix = board->prefix,
        .board_leds = board->type.leds,
        .has_dpll = hm2_idrom_find(&board->idrom, HM2_GTAG_DPLL) != NULL,
        .access = board,
        .peek = setup_peek,
        .poke = setup_poke,
        .now_ns = setup_now_ns,
    };
    for (unsigned i = 0; i < board->idrom.pin_count; i++)
        board->pins[i] = (struct hm2_pin){.pd = board->idrom.pins[i]};
    int err = board_points_bind(board, binder, diag);
    if (err == 0)
        err = setup_modules(board, &setup);
    if (err == 0)
        err = lay_out(board, diag);
    prepare_cycle(board);
    return err;
}

static int check_pipeline(struct hm2_board *const board, struct hm2_diag *const diag)
{
    const unsigned timer = board->config.pipelined;
    if (timer == 0)
        return 0;
    if (instances_of(&board->idrom, HM2_GTAG_DPLL) == 0 || board->config.count[HM2_CFG_DPLLS] == 0)
        return hm2_diag_add(
            diag, HM2_ERR_INVALID, "%s: config pipelined=%u found, but no DPLL is %s; the card has nothing to wait for",
            board->prefix, timer, board->config.count[HM2_CFG_DPLLS] == 0 ? "used (num_dplls=0)" : "in the firmware");
    board->pipeline.timer = timer;
    return 0;
}

/* The identity request of a card that comes back is prepared here: the cycle only changes its number. */
static int prepare_identity(struct hm2_board *const board)
{
    board_exchange_begin(board, &board->identity);
    board_image_add(&board->identity.builder, &board->identity_at, (uint16_t)board->image.id[3]);
    return board_exchange_seal(&board->identity);
}

int hm2_board_setup(struct hm2_board *const board, const unsigned index, struct hm2_binder *const binder,
                    const char *const config, struct hm2_diag *const diag)
{
    if (board->state != BOARD_IDENTIFIED || board->prefix[0])
        return hm2_diag_add(diag, HM2_ERR_STATE, "a board is set up once, after it has been identified");
    const int len = snprintf(board->prefix, sizeof board->prefix, "hm2_%s.%u", board->type.stem, index);
    if (len < 0 || (size_t)len >= sizeof board->prefix)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "number %u of a card is too large for a name", index);
    int err = hm2_config_parse(config, &board->config, diag);
    if (err < 0)
        return err;
    hm2_plan_init(board->plan, board->nonce);
    check_daughters(board, diag);
    const int checks[] = {check_counts(board, diag), check_serial(board, diag), match_modules(board, diag),
                          prepare_identity(board), check_pipeline(board, diag)};
    for (size_t i = 0; i < sizeof checks / sizeof checks[0]; i++)
        if (checks[i] < 0)
            return checks[i];
    err = create_objects(board, binder, diag);
    if (err == 0)
        board->state = BOARD_SET_UP;
    return err;
}
