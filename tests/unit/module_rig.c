/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "module_rig.h"

#include <hm2/lbp16.h>

#include "unit.h"

#define ROM_ADDRESS 0x0400u

/* ---- images ----------------------------------------------------------------------------------------------------- */

void rig_compose(struct hm2_image *const image, const struct rig_header *const header,
                 const struct rig_md *const modules, const size_t module_count, const uint32_t *const pins,
                 const size_t pin_count)
{
    const uint32_t io_width = header->io_ports * header->port_width;
    const uint32_t words[16] = {
        header->type,
        header->offset_modules,
        header->offset_pins,
        hm2_get_le32((const uint8_t *)header->board_name),
        hm2_get_le32((const uint8_t *)header->board_name + 4),
        header->fpga_size,
        header->fpga_pins,
        header->io_ports,
        io_width,
        header->port_width,
        header->clock_low_hz,
        header->clock_high_hz,
        4,
        header->instance_stride_1,
        256,
        256,
    };
    *image = (struct hm2_image){.id = {HM2_COOKIE, 0x54534F48, 0x32544F4D, ROM_ADDRESS}};
    memcpy(image->rom, words, sizeof words);
    for (size_t i = 0; i < module_count; i++) {
        const struct rig_md *const md = &modules[i];
        uint32_t *const at = &image->rom[header->offset_modules / 4 + 3 * i];
        at[0] = md->gtag | (uint32_t)md->version << 8 | (uint32_t)md->clock_tag << 16 | (uint32_t)md->instances << 24;
        at[1] = md->base | (uint32_t)md->registers << 16 | (uint32_t)md->strides << 24;
        at[2] = md->multiple;
    }
    for (size_t i = 0; i < io_width; i++)
        image->rom[header->offset_pins / 4 + i] = i < pin_count ? pins[i] : 0x03000000u;
}

static const struct rig_header header_7i96s = {3, 0x40, 0x1C0, "MESA7I96", 20, 256, 3, 17, 100000000, 200000000, 64};
static const struct rig_header header_7i93 = {3, 0x40, 0x1C0, "MESA7I93", 9, 144, 2, 24, 100000000, 200000000, 64};

static const struct rig_md modules_7i96s[] = {
    {HM2_GTAG_DPLL, 0, 1, 1, 0x7000, 7, 0x00, 0x00000000},    {HM2_GTAG_WATCHDOG, 0, 1, 1, 0x0C00, 3, 0x00, 0},
    {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x0000001F},  {HM2_GTAG_OUTM, 0, 1, 1, 0xB000, 1, 0x00, 0x00000001},
    {HM2_GTAG_PWMGEN, 0, 2, 1, 0x4100, 5, 0x00, 0x00000003},  {HM2_GTAG_STEPGEN, 2, 1, 5, 0x2000, 10, 0x00, 0x1FF},
    {HM2_GTAG_ENCODER, 2, 1, 1, 0x3000, 5, 0x00, 0x00000003}, {HM2_GTAG_SSERIAL, 0, 1, 1, 0x5B00, 6, 0x10, 0x3C},
    {HM2_GTAG_SSR, 0, 1, 1, 0x7D00, 2, 0x00, 0x00000003},     {HM2_GTAG_INM, 0, 1, 1, 0x8500, 5, 0x00, 0x0000001F},
    {HM2_GTAG_LED, 0, 1, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const uint32_t pins_7i96s[] = {
    0x03002301, 0x03002302, 0x03002303, 0x03002304, 0x03002305, 0x03002306, 0x03002307, 0x03002308, 0x03002309,
    0x0300230A, 0x0300230B, 0x0300C381, 0x0300C382, 0x0300C383, 0x0300C384, 0x03002D85, 0x03002D86, 0x03000581,
    0x03000582, 0x03010581, 0x03010582, 0x03020581, 0x03020582, 0x03030581, 0x03030582, 0x03040581, 0x03040582,
    0x03000401, 0x03000402, 0x03000403, 0x0300C101, 0x0300C181, 0x0300C191, 0x0300C3A0,
};

static const struct rig_md modules_7i93[] = {
    {HM2_GTAG_DPLL, 0, 1, 1, 0x7000, 7, 0x00, 0x00000000},   {HM2_GTAG_WATCHDOG, 0, 1, 1, 0x0C00, 3, 0x00, 0},
    {HM2_GTAG_IOPORT, 0, 1, 2, 0x1000, 5, 0x00, 0x0000001F}, {HM2_GTAG_ENCODER, 2, 1, 8, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_PWMGEN, 0, 2, 8, 0x4100, 5, 0x00, 0x00000003}, {HM2_GTAG_STEPGEN, 2, 1, 4, 0x2000, 10, 0x00, 0x1FF},
    {HM2_GTAG_LED, 0, 1, 1, 0x0200, 1, 0x00, 0x00000000},
};

/* A servo pair of SVST8_4IM2: the second unit of the pair comes first in each row (register map 5.2.1). */
static void servo_pair(uint32_t *const pins, const uint32_t unit)
{
    static const uint16_t functions[6] = {0x0402, 0x0401, 0x0403, 0x0681, 0x0682, 0x0683};
    static const uint8_t place[6][2] = {{0, 2}, {1, 3}, {4, 5}, {6, 7}, {8, 9}, {10, 11}};
    for (unsigned i = 0; i < 6; i++) {
        pins[place[i][0]] = 0x03000000u | (unit + 1) << 16 | functions[i];
        pins[place[i][1]] = 0x03000000u | unit << 16 | functions[i];
    }
}

const struct hm2_image *rig_image_7i96s(void)
{
    static struct hm2_image image;
    rig_compose(&image, &header_7i96s, modules_7i96s, sizeof modules_7i96s / sizeof modules_7i96s[0], pins_7i96s,
                sizeof pins_7i96s / sizeof pins_7i96s[0]);
    return &image;
}

const struct hm2_image *rig_image_7i93(void)
{
    static struct hm2_image image;
    uint32_t pins[48];
    for (unsigned pair = 0; pair < 4; pair++)
        servo_pair(pins + 12 * pair, 2 * pair);
    rig_compose(&image, &header_7i93, modules_7i93, sizeof modules_7i93 / sizeof modules_7i93[0], pins, 48);
    return &image;
}

const struct hm2_image *rig_image_with(const struct rig_md *const modules, const size_t module_count,
                                       const uint32_t *const pins, const size_t pin_count)
{
    static struct hm2_image image;
    rig_compose(&image, &header_7i96s, modules, module_count, pins, pin_count);
    return &image;
}

/* ---- set-up ----------------------------------------------------------------------------------------------------- */

static int rig_peek(struct hm2_setup *const setup, const uint16_t address, const unsigned words, uint32_t *const values)
{
    const struct module_rig *const rig = setup->access;
    for (unsigned i = 0; i < words; i++)
        values[i] = rig->card ? sim_card_read(rig->card, rig->clk, (uint16_t)(address + 4u * i), NULL)
                              : rig->readable[(address / 4u + i) % 0x4000u];
    return rig->peek_error;
}

static int rig_poke(struct hm2_setup *const setup, const uint16_t address, const unsigned words,
                    const uint32_t *const values)
{
    struct module_rig *const rig = setup->access;
    for (unsigned i = 0; i < words && rig->peek_error == 0; i++)
        rig->written[(address / 4u + i) % 0x4000u] = values[i];
    return rig->peek_error;
}

static int64_t rig_now_ns(const struct hm2_setup *const setup)
{
    return ((const struct module_rig *)setup->access)->cycle.now_ns;
}

struct module_rig *rig_new(const struct hm2_image *const image, const char *const config)
{
    struct module_rig *const rig = calloc(1, sizeof *rig);
    assert_non_null(rig);
    if (hm2_idrom_parse(image, NULL, &rig->idrom, &rig->diag) < 0)
        fail_msg("the image is refused: %s", rig->diag.text);
    if (hm2_config_parse(config, &rig->config, &rig->diag) < 0)
        fail_msg("the config is refused: %s", rig->diag.text);
    rig->plain = hm2_plain_binder_new();
    rig->plan = calloc(1, hm2_plan_size());
    assert_non_null(rig->plain);
    assert_non_null(rig->plan);
    hm2_plan_init(rig->plan, 0x5E551011);
    for (unsigned io = 0; io < rig->idrom.pin_count; io++)
        rig->pins[io].pd = rig->idrom.pins[io];
    rig->setup = (struct hm2_setup){
        .idrom = &rig->idrom,
        .config = &rig->config,
        .plan = rig->plan,
        .binder = hm2_plain_binder(rig->plain),
        .pins = rig->pins,
        .diag = &rig->diag,
        .prefix = RIG_PREFIX,
        .board_leds = 4,
        .has_dpll = hm2_idrom_find(&rig->idrom, HM2_GTAG_DPLL) != NULL,
        .access = rig,
        .peek = rig_peek,
        .poke = rig_poke,
        .now_ns = rig_now_ns,
    };
    rig_set_period(rig, RIG_PERIOD_NS);
    return rig;
}

void rig_free(struct module_rig *const rig)
{
    if (!rig)
        return;
    hm2_plain_binder_free(rig->plain);
    free(rig->plan);
    free(rig);
}

static unsigned instances_of(const struct module_rig *const rig, const struct hm2_module_type *const type,
                             const struct hm2_md *const md)
{
    const unsigned present = md ? md->instances : 1;
    const int wanted = type->config_count < 0 ? HM2_CFG_ALL : rig->config.count[type->config_count];
    return wanted >= 0 && (unsigned)wanted < present ? (unsigned)wanted : present;
}

int rig_try_add(struct module_rig *const rig, const struct hm2_module_type *const type)
{
    assert_true(rig->count < RIG_MODULES);
    struct hm2_module *const module = &rig->modules[rig->count];
    module->type = type;
    module->md = type->gtag == HM2_GTAG_NONE ? NULL : hm2_idrom_find(&rig->idrom, type->gtag);
    module->instances = instances_of(rig, type, module->md);
    module->prefix = RIG_PREFIX;
    module->noticed = rig->noticed[rig->count];
    if (type->gtag != HM2_GTAG_NONE && !module->md)
        fail_msg("the image has no %s", type->name);
    const int err = type->setup(module, &rig->setup);
    if (err == 0)
        rig->count++;
    return err;
}

struct hm2_module *rig_add(struct module_rig *const rig, const struct hm2_module_type *const type)
{
    const int err = rig_try_add(rig, type);
    if (err < 0)
        fail_msg("%s: %s: %s", type->name, hm2_strerror(err), rig->diag.text);
    return &rig->modules[rig->count - 1];
}

void rig_add_all(struct module_rig *const rig)
{
    for (size_t i = 0; hm2_module_types[i]; i++)
        if (hm2_module_types[i]->gtag == HM2_GTAG_NONE || hm2_idrom_find(&rig->idrom, hm2_module_types[i]->gtag))
            (void)rig_add(rig, hm2_module_types[i]);
}

/* ---- the "card": an LBP16 server over the register file ------------------------------------------------------- */

static void write_register(struct module_rig *const rig, const uint16_t address, const uint32_t value)
{
    rig->written[address / 4u] = value;
    if (rig->card)
        sim_card_write(rig->card, rig->clk, address, value);
    assert_true(rig->logged < RIG_LOG);
    rig->log[rig->logged++] = (struct rig_write){address, value};
}

static void do_write(struct module_rig *const rig, const struct lbp16_command *const command,
                     const uint8_t *const payload)
{
    for (unsigned i = 0; i < command->count; i++) {
        const size_t step = command->increment ? i * lbp16_item_bytes(command->size) : 0;
        const uint16_t address = (uint16_t)(command->address + step);
        if (command->space == LBP16_SPACE_HM2)
            write_register(rig, address, hm2_get_le32(payload + 4u * i));
        else if (command->space == LBP16_SPACE_TIMER && address < LBP16_TIMER_BYTES)
            rig->timer[address / 2u] = hm2_get_le16(payload + 2u * i);
        else
            fail_msg("a write to space %d, address 0x%04X", (int)command->space, address);
    }
}

static uint32_t read_register(const struct module_rig *const rig, const uint16_t address)
{
    return rig->card ? sim_card_read(rig->card, rig->clk, address, NULL) : rig->readable[address / 4u];
}

static void do_read(const struct module_rig *const rig, const struct lbp16_command *const command, uint8_t *const out)
{
    for (unsigned i = 0; i < command->count; i++) {
        const size_t step = command->increment ? i * lbp16_item_bytes(command->size) : 0;
        const uint16_t address = (uint16_t)(command->address + step);
        if (command->space == LBP16_SPACE_HM2)
            hm2_put_le32(out + 4u * i, read_register(rig, address));
        else if (command->space == LBP16_SPACE_TIMER && address < LBP16_TIMER_BYTES)
            hm2_put_le16(out + 2u * i, rig->timer[address / 2u]);
        else if (command->space == LBP16_SPACE_CONTROL && address == LBP16_CONTROL_RX_UDP)
            hm2_put_le16(out + 2u * i, rig->rx_udp);
        else
            fail_msg("a read of space %d, address 0x%04X", (int)command->space, address);
    }
}

/* Serve a datagram; the reply goes to out. Returns its length. */
static size_t serve(struct module_rig *const rig, const uint8_t *const data, const size_t len, uint8_t *const out,
                    const size_t capacity)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len, used = 0;
    bool truncated;
    int more;
    rig->rx_udp++;
    lbp16_parser_init(&parser, data, len);
    while ((more = lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated)) > 0) {
        assert_false(truncated);
        assert_true(command.has_address);
        const size_t bytes = lbp16_data_bytes(&command);
        if (command.write) {
            assert_int_equal(payload_len, bytes);
            do_write(rig, &command, payload);
        } else {
            assert_non_null(out);
            assert_true(used + bytes <= capacity);
            do_read(rig, &command, out + used);
            used += bytes;
        }
    }
    assert_int_equal(more, 0);
    return used;
}

/* ---- cycles ----------------------------------------------------------------------------------------------------- */

void rig_set_period(struct module_rig *const rig, const int64_t period_ns)
{
    rig->cycle.period_ns = period_ns;
    rig->cycle.period_s = (double)period_ns * 1e-9;
}

static void exchange(struct module_rig *const rig)
{
    size_t len;
    const uint8_t *const request = hm2_plan_request(rig->plan, &len);
    rig->logged = 0;
    const size_t got = serve(rig, request, len, hm2_plan_reply_buffer(rig->plan), hm2_plan_reply_capacity(rig->plan));
    assert_int_equal(hm2_plan_judge(rig->plan, got), HM2_REPLY_FRESH);
}

static void send_write(struct module_rig *const rig)
{
    size_t len;
    const uint8_t *const data = hm2_plan_write(rig->plan, &len);
    rig->logged = 0;
    if (!rig->lose_writes)
        assert_int_equal(serve(rig, data, len, NULL, 0), 0);
}

void rig_start(struct module_rig *const rig)
{
    if (hm2_plan_freeze(rig->plan, &rig->diag) < 0)
        fail_msg("the plan is refused: %s", rig->diag.text);
    hm2_plan_touch_all(rig->plan);
    send_write(rig);
    exchange(rig);
    for (unsigned i = 0; i < rig->count; i++)
        if (rig->modules[i].type->start)
            rig->modules[i].type->start(&rig->modules[i], &rig->cycle);
}

void rig_read(struct module_rig *const rig)
{
    exchange(rig);
    for (unsigned i = 0; i < rig->count; i++)
        if (rig->modules[i].type->unpack && rig->modules[i].context)
            rig->modules[i].type->unpack(&rig->modules[i], &rig->cycle);
}

void rig_write_out(struct module_rig *const rig)
{
    for (unsigned i = 0; i < rig->count; i++)
        if (rig->modules[i].type->pack && rig->modules[i].context)
            rig->modules[i].type->pack(&rig->modules[i], &rig->cycle);
    send_write(rig);
    rig->cycle.writes++;
}

void rig_cycle(struct module_rig *const rig)
{
    rig->cycle.now_ns += rig->cycle.period_ns;
    rig->clk += rig->cycle.period_ns * rig->idrom.clock_low_hz / 1000000000;
    rig_read(rig);
    rig_write_out(rig);
}

void rig_cycles(struct module_rig *const rig, const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        rig_cycle(rig);
}

/* ---- looking ---------------------------------------------------------------------------------------------------- */

uint32_t rig_written(const struct module_rig *const rig, const uint16_t address)
{
    return rig->written[address / 4u];
}

void rig_put(struct module_rig *const rig, const uint16_t address, const uint32_t value)
{
    rig->readable[address / 4u] = value;
}

int rig_position(const struct module_rig *const rig, const uint16_t address)
{
    for (unsigned i = rig->logged; i > 0; i--)
        if (rig->log[i - 1].address == address)
            return (int)i - 1;
    return -1;
}

bool rig_wrote(const struct module_rig *const rig, const uint16_t address)
{
    return rig_position(rig, address) >= 0;
}

const struct hm2_plain_object *rig_object(const struct module_rig *const rig, const char *const name)
{
    char full[HM2_NAME_SIZE];
    (void)snprintf(full, sizeof full, RIG_PREFIX ".%s", name);
    return hm2_plain_find(rig->plain, full);
}

bool rig_has(const struct module_rig *const rig, const char *const name)
{
    return rig_object(rig, name) != NULL;
}

double rig_get(const struct module_rig *const rig, const char *const name)
{
    const struct hm2_plain_object *const object = rig_object(rig, name);
    if (!object)
        fail_msg("there is no %s", name);
    return object ? hm2_point_load(object->point->type, object->value) : 0.0;
}

void rig_set(struct module_rig *const rig, const char *const name, const double value)
{
    const struct hm2_plain_object *const object = rig_object(rig, name);
    if (!object)
        fail_msg("there is no %s", name);
    else
        hm2_point_store(object->point->type, object->value, value);
}
