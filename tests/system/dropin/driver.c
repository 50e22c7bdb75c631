/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "driver.h"

#include <check.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hm2/bytes.h>
#include <hm2/lbp16.h>

#include "../dropin_table.h"
#include "halhost.h"
#include "sockets.h"
#include "sserial.h"
#include "state.h"

#define WRITE_NS  (DRIVER_PERIOD_NS * 4 / 10)
#define EVENTS_NS 100000
#define TASK      1

static const struct {
    const char *module, *before, *servo, *folder;
} kinds[] = {
    [DRIVER_LINUXCNC] = {"hm2_eth", "hostmot2", "mesa_7i65", DRIVER_MODULES},
    [DRIVER_OURS] = {"hm2_lbp16", NULL, "hm2_7i65", TEST_BUILD "/components"},
};

static const char servo_prefix[] = "mesa-7i65.";

const char *const *driver_files(const enum driver_kind kind)
{
    static char paths[2][256];
    static const char *files[3];
    snprintf(paths[0], sizeof paths[0], "%s/%s.so", kinds[kind].folder, kinds[kind].module);
    snprintf(paths[1], sizeof paths[1], "%s/%s.so", kinds[kind].folder, kinds[kind].before ? kinds[kind].before : "");
    files[0] = paths[0];
    files[1] = kinds[kind].before ? paths[1] : NULL;
    return files;
}

bool driver_available(const enum driver_kind kind)
{
    return access(driver_files(kind)[0], R_OK) == 0;
}

/* ---- what it says and sends ---------------------------------------------------------------------------------------
 */

static void keep_message(const void *const context, const enum halhost_stream stream, const char *const text)
{
    const struct driver *const driver = context;
    (void)stream;
    const size_t used = strlen(driver->messages);
    snprintf(driver->messages + used, driver->messages_size - used, "%s", text);
}

static void tell_writes(const struct driver *const driver, const uint8_t *const data, const size_t len)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    lbp16_parser_init(&parser, data, len);
    while (lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated) == 1) {
        if (!command.write || command.info || command.space != LBP16_SPACE_HM2 || command.size != LBP16_SIZE_32)
            continue;
        for (unsigned i = 0; i < payload_len / 4; i++)
            driver->on_write(driver->context, (uint16_t)(command.address + (command.increment ? 4 * i : 0)),
                             hm2_get_le32(payload + 4 * i));
    }
}

static bool on_send(void *const context, const uint8_t *const data, const size_t len)
{
    const struct driver *const driver = context;
    if (driver->in_write ? driver->lose_writes : driver->lose_requests)
        return false;
    if (driver->on_write)
        tell_writes(driver, data, len);
    return true;
}

/* ---- points -------------------------------------------------------------------------------------------------------
 */

static bool begins_with(const char *const name, const char *const prefix)
{
    return strncmp(name, prefix, strlen(prefix)) == 0;
}

static void add_point(struct driver *const driver, const struct hh_named *const names, const hal_type_t type,
                      const bool settable, const volatile void *const value)
{
    const bool of_card = begins_with(names->name, driver->prefix);
    if (of_card || begins_with(names->name, servo_prefix))
        driver->points[driver->point_count++] =
            (struct driver_point){hh_shown_name(names) + (of_card ? strlen(driver->prefix) : 0), (int)type, settable,
                                  (volatile void *)(uintptr_t)value};
}

/* What has arrived at the 7I65. */
static void add_world(struct driver *const driver)
{
    static const char *const names[SIM_7I65_CHANNELS] = {"7i65.volts.0", "7i65.volts.1", "7i65.volts.2",
                                                         "7i65.volts.3", "7i65.volts.4", "7i65.volts.5",
                                                         "7i65.volts.6", "7i65.volts.7"};
    for (unsigned i = 0; i < SIM_7I65_CHANNELS; i++)
        driver->points[driver->point_count++] =
            (struct driver_point){names[i], HAL_FLOAT, false, &driver->servo_volts[i]};
    driver->points[driver->point_count++] =
        (struct driver_point){"7i65.enables", HAL_U32, false, &driver->servo_enables};
}

static void look_at_world(struct driver *const driver)
{
    if (!driver->servo)
        return;
    sim_card_advance(driver->card, sim_card_clock_at(driver->card, sockets_now_ns()));
    for (unsigned i = 0; i < SIM_7I65_CHANNELS; i++)
        driver->servo_volts[i] = sim_7i65_output_volts(driver->servo, i);
    driver->servo_enables = sim_7i65_enables(driver->servo);
}

static void collect_points(struct driver *const driver)
{
    const struct hh *const host = hh_host();
    const struct hh_list *const pins = &host->pins.shown, *const params = &host->params.shown;
    driver->points = calloc(pins->count + params->count + SIM_7I65_CHANNELS + 1, sizeof *driver->points);
    ck_assert_ptr_nonnull(driver->points);
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        add_point(driver, &pin->names, pin->type, pin->dir == HAL_IN, hh_pin_value(pin));
    }
    for (size_t i = 0; i < params->count; i++) {
        const struct hh_param *const param = params->items[i];
        add_point(driver, &param->names, param->type, param->dir == HAL_RW, param->value);
    }
    if (driver->servo)
        add_world(driver);
}

const struct driver_point *driver_find(const struct driver *const driver, const char *const name)
{
    for (size_t i = 0; i < driver->point_count; i++)
        if (strcmp(driver->points[i].name, name) == 0)
            return &driver->points[i];
    return NULL;
}

double driver_value(const struct driver_point *const point)
{
    const struct hh_value value = hh_load((hal_type_t)point->type, point->value);
    if (value.type == HAL_FLOAT)
        return value.f;
    if (value.type == HAL_BIT)
        return value.b;
    return value.type == HAL_S32 ? (double)value.s : (double)value.u;
}

void driver_set(const struct driver_point *const point, const double value)
{
    struct hh_value v = {.type = (hal_type_t)point->type};
    if (v.type == HAL_FLOAT)
        v.f = value;
    else if (v.type == HAL_BIT)
        v.b = value > 0.5;
    else if (v.type == HAL_S32)
        v.s = (int32_t)value;
    else
        v.u = (uint32_t)value;
    hh_store(point->value, v);
}

/* ---- loading ------------------------------------------------------------------------------------------------------
 */

static void open_host(struct driver *const driver)
{
    static const char *folders[3];
    struct hm2_diag diag = {0};
    folders[0] = kinds[driver->kind].folder;
    const struct halhost_options options = {
        .message = keep_message, .context = driver, .folders = folders, .no_realtime = true};
    if (halhost_open(&options, &diag) != 0)
        ck_abort_msg("no HAL host: %s", diag.text);
}

static void read_firmware(const char *const path, struct hm2_image *const image)
{
    static char text[65536];
    struct hm2_diag diag = {0};
    FILE *const file = fopen(path, "r");
    ck_assert_msg(file, "%s: %s", path, strerror(errno));
    const size_t len = fread(text, 1, sizeof text, file);
    ck_assert_uint_lt(len, sizeof text);
    fclose(file);
    if (hm2_image_from_text(text, len, image, &diag) != 0)
        ck_abort_msg("%s: %s", path, diag.text);
}

static void open_card(struct driver *const driver, const char *const card)
{
    struct hm2_image image;
    struct sim_card_options options = {.profile = card, .seed = 1, .sources = driver->sources};
    struct hm2_diag diag = {0};
    if (driver->firmware) {
        read_firmware(driver->firmware, &image);
        options.image = &image;
    }
    if (sim_card_new(&driver->card, &options, &diag) != 0)
        ck_abort_msg("no card: %s", diag.text);
    if (driver->remote && sim_sserial_plug(driver->card, 0, 0, driver->remote, 1, &diag) != 0)
        ck_abort_msg("no remote: %s", diag.text);
    if (driver->has_7i65)
        ck_assert_int_eq(sim_7i65_new(&driver->servo, driver->card, 0), 0);
    ck_assert_int_eq(sim_net_new(&driver->net, driver->card, NULL), 0);
    sim_card_set_instant(driver->card, !driver->paced);
    sockets_open(driver->net, on_send, driver);
    sockets_engage(false);
}

static bool load(struct driver *const driver, const char *const module, const char *const *const arguments,
                 const size_t count)
{
    struct hm2_diag diag = {0};
    sockets_engage(true);
    const int err = halhost_load(module, arguments, count, &diag);
    sockets_engage(false);
    halhost_flush_messages();
    if (err != 0)
        keep_message(driver, HALHOST_STDERR, diag.text);
    return err == 0;
}

bool driver_load(struct driver *const driver, const char *const card, const char *const config)
{
    char line[512], port[64];
    const char *const arguments[] = {"board_ip=192.168.1.121", line, driver->parameter};
    const char *const servo_arguments[] = {port};
    snprintf(line, sizeof line, "config=%s", config);
    dropin_prefix(card, driver->prefix, sizeof driver->prefix);
    snprintf(port, sizeof port, "bspi_chans=%sbspi.0", driver->prefix);
    open_host(driver);
    open_card(driver, card);
    if (kinds[driver->kind].before && !load(driver, kinds[driver->kind].before, NULL, 0))
        return false;
    if (!load(driver, kinds[driver->kind].module, arguments, driver->parameter ? 3 : 2))
        return false;
    if (driver->has_7i65 && !load(driver, kinds[driver->kind].servo, servo_arguments, 1))
        return false;
    collect_points(driver);
    driver->start_ns = (sockets_now_ns() / DRIVER_PERIOD_NS + 10) * DRIVER_PERIOD_NS;
    return true;
}

void driver_unload(struct driver *const driver)
{
    struct hm2_diag diag = {0};
    sockets_engage(true);
    (void)halhost_close(&diag);
    sockets_engage(false);
    sim_net_free(driver->net);
    sim_7i65_free(driver->servo);
    sim_card_free(driver->card);
    free(driver->points);
}

/* ---- cycles -------------------------------------------------------------------------------------------------------
 */

static void call(const struct driver *const driver, const char *const function)
{
    char name[64];
    snprintf(name, sizeof name, "%s%s", driver->prefix, function);
    const struct hh_funct *const funct = hh_table_find(&hh_host()->functs, name);
    if (!funct)
        ck_abort_msg("no function %s", name);
    sockets_engage(true);
    hh_task_enter(TASK);
    funct->code(funct->arg, DRIVER_PERIOD_NS);
    hh_task_enter(-EINVAL);
    sockets_engage(false);
}

static int64_t cycle_ns(const struct driver *const driver)
{
    return driver->start_ns + (int64_t)driver->cycle * DRIVER_PERIOD_NS;
}

void driver_begin_cycle(struct driver *const driver)
{
    sockets_sleep_until(cycle_ns(driver) - EVENTS_NS);
    look_at_world(driver);
}

void driver_read(struct driver *const driver)
{
    sockets_sleep_until(cycle_ns(driver));
    driver->in_write = false;
    call(driver, "read");
}

void driver_write(struct driver *const driver)
{
    sockets_sleep_until(cycle_ns(driver) + WRITE_NS);
    driver->in_write = true;
    call(driver, "write");
    driver->in_write = false;
}
