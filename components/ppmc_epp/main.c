/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * ppmc_epp: Pico Systems encoder counters on an EPP parallel port as HAL pins and functions.
 *
 *     loadrt ppmc_epp port_addr=0x378[,...] [bus=/dev/parport0[,...]] [enc_clock=0xA02,...] [timestamp=0x02,...]
 *
 * HAL glue only: everything about boards is in libhm2. Names and module parameters are those of LinuxCNC's hal_ppmc.
 */
#include <errno.h>
#include <stdatomic.h>
#include <time.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/ppmc.h>

#include "common/component.h"
#include "common/hal_binder.h"
#include "common/messenger.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("Pico Systems encoder counters on EPP");
MODULE_LICENSE("GPL");

#define MAX_BUSES  3
#define MAX_BOARDS 24 /* of all buses, as in hal_ppmc */
#define UNUSED     (-1)
#define UNUSED_24                                                                                      \
    {                                                                                                  \
        -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1 \
    }

static int port_addr[MAX_BUSES] = {0x378, UNUSED, UNUSED};
RTAPI_MP_ARRAY_INT(port_addr, MAX_BUSES, "I/O base of each port, or N below 16 for /dev/parportN");
static int epp_dir[MAX_BUSES];
RTAPI_MP_ARRAY_INT(epp_dir, MAX_BUSES, "1 = command the direction of the data lines before each read");
static int timestamp[MAX_BOARDS] = UNUSED_24;
RTAPI_MP_ARRAY_INT(timestamp, MAX_BOARDS, "0xBS of each board whose timestamps are used, B = bus, S = slot");
static int enc_clock[MAX_BOARDS] = UNUSED_24;
RTAPI_MP_ARRAY_INT(enc_clock, MAX_BOARDS, "0xFBS: filter rate F of a board, 1, 2, 5, A for 1, 2.5, 5, 10 MHz");

/* Accepted so that load lines written for hal_ppmc work unchanged; ppmc_epp(9) says what they would do. */
static int extradac[MAX_BOARDS] = UNUSED_24;
RTAPI_MP_ARRAY_INT(extradac, MAX_BOARDS, "accepted for compatibility; extra ports are not driven");
static int extradout[MAX_BOARDS] = UNUSED_24;
RTAPI_MP_ARRAY_INT(extradout, MAX_BOARDS, "accepted for compatibility; extra ports are not driven");

/* Not in hal_ppmc. */
static char *bus[MAX_BUSES];
RTAPI_MP_ARRAY_STRING(bus, MAX_BUSES, "each bus by name instead of port_addr: /dev/parport0, port:0x378, sim:SOCKET");
static int expect[MAX_BOARDS] = UNUSED_24;
RTAPI_MP_ARRAY_INT(expect, MAX_BOARDS, "0xBS of each board with encoders that must be there");
static int verify = 1;
RTAPI_MP_INT(verify, "0 = read counts only once in a period");

struct bus {
    struct ppmc *ppmc;
    atomic_bool busy; /* one of its functions runs */
};

static int component_id;
static struct bus buses[MAX_BUSES];
static unsigned bus_count;
static struct hal_binder hal;
static atomic_bool closing; /* no function may touch a bus any more */

/* ---- functions of a bus ------------------------------------------------------------------------------------------ */

/* A host may unload the component while its functions are still in a thread (LinuxCNC's does): what is announced here
 * is waited for in close_functions(). */
static bool enter(struct bus *const b)
{
    atomic_store(&b->busy, true);
    if (!atomic_load(&closing))
        return true;
    atomic_store_explicit(&b->busy, false, memory_order_release);
    return false;
}

static void leave(struct bus *const b)
{
    atomic_store_explicit(&b->busy, false, memory_order_release);
}

static void bus_read(void *const arg, const long period)
{
    struct bus *const b = arg;
    if (!enter(b))
        return;
    ppmc_read(b->ppmc, period);
    leave(b);
}

static void bus_write(void *const arg, const long period)
{
    struct bus *const b = arg;
    if (!enter(b))
        return;
    ppmc_write(b->ppmc, period);
    leave(b);
}

#define CLOSE_STEP_NS 1000000L
#define CLOSE_STEPS   2000u

static void close_functions(void)
{
    const struct timespec step = {.tv_nsec = CLOSE_STEP_NS};
    atomic_store(&closing, true);
    for (unsigned i = 0, steps = 0; i < bus_count; i++)
        while (atomic_load(&buses[i].busy) && steps++ < CLOSE_STEPS)
            nanosleep(&step, NULL);
}

static int export_function(const unsigned number, const char *const what, void (*const function)(void *, long))
{
    char name[HAL_NAME_LEN + 1];
    rtapi_snprintf(name, sizeof name, "ppmc.%u.%s", number, what);
    const int result = hal_export_funct(name, function, &buses[number], 1, 0, component_id);
    if (result < 0)
        rtapi_print_msg(RTAPI_MSG_ERR, "ppmc_epp: HAL did not take the function %s (%d)\n", name, result);
    return result;
}

/* ---- messages: formatted and printed outside the realtime threads ------------------------------------------------ */

static void print_messages(void)
{
    char text[512];
    bool error;
    for (unsigned i = 0; i < bus_count; i++)
        for (unsigned n = 0; n < 32 && ppmc_next_message(buses[i].ppmc, text, sizeof text, &error) == 1; n++)
            rtapi_print_msg(error ? RTAPI_MSG_ERR : RTAPI_MSG_WARN, "ppmc_epp: %s\n", text);
}

/* ---- module parameters ------------------------------------------------------------------------------------------- */

/* 0xBS in the low byte. */
static int check_board_code(const char *const parameter, const int code, const int max)
{
    if (code >= 0 && code <= max && (code >> 4 & 15) < MAX_BUSES)
        return 0;
    rtapi_print_msg(RTAPI_MSG_ERR,
                    "ppmc_epp: %s: 0x%X names no board; write 0x%s with B = bus 0 to %d, S = slot 0 to F\n", parameter,
                    (unsigned)code, max > 0xFF ? "FBS" : "BS", MAX_BUSES - 1);
    return -EINVAL;
}

static int add_board_bits(const char *const parameter, const int *const codes, const unsigned number,
                          uint16_t *const bits)
{
    for (unsigned i = 0; i < MAX_BOARDS; i++) {
        if (codes[i] == UNUSED)
            continue;
        if (check_board_code(parameter, codes[i], 0xFF) != 0)
            return -EINVAL;
        if ((unsigned)codes[i] >> 4 == number)
            *bits |= (uint16_t)(1u << (codes[i] & 15));
    }
    return 0;
}

static int add_filters(const unsigned number, struct ppmc_options *const options)
{
    static const struct {
        int code;
        enum ppmc_filter filter;
    } rates[] = {{0x1, PPMC_1_MHZ}, {0x2, PPMC_2_5_MHZ}, {0x5, PPMC_5_MHZ}, {0xA, PPMC_10_MHZ}};
    for (unsigned i = 0; i < MAX_BOARDS; i++) {
        enum ppmc_filter filter = PPMC_FILTER_KEEP;
        if (enc_clock[i] == UNUSED)
            continue;
        if (check_board_code("enc_clock", enc_clock[i], 0xFFF) != 0)
            return -EINVAL;
        for (size_t k = 0; k < sizeof rates / sizeof rates[0]; k++)
            if (rates[k].code == enc_clock[i] >> 8)
                filter = rates[k].filter;
        if (filter == PPMC_FILTER_KEEP) {
            rtapi_print_msg(RTAPI_MSG_ERR, "ppmc_epp: enc_clock: 0x%X: rates are 1, 2, 5, A for 1, 2.5, 5, 10 MHz\n",
                            (unsigned)enc_clock[i]);
            return -EINVAL;
        }
        if (((unsigned)enc_clock[i] >> 4 & 15u) == number)
            options->filter[enc_clock[i] & 15] = filter;
    }
    return 0;
}

static void tell_what_has_no_effect(void)
{
    for (unsigned i = 0; i < MAX_BOARDS; i++)
        if (extradac[i] != UNUSED || extradout[i] != UNUSED)
            rtapi_print("ppmc_epp: warning: extradac and extradout have no effect: extra ports are not driven\n");
}

/* Name of a bus, or "" when there is none. bus= takes the place of port_addr= altogether. */
static void name_bus(const unsigned number, char *const name, const size_t size)
{
    const int address = port_addr[number];
    name[0] = '\0';
    if (bus[0] && bus[0][0])
        rtapi_snprintf(name, size, "%s", bus[number] ? bus[number] : "");
    else if (address >= 0 && address < 16)
        rtapi_snprintf(name, size, "/dev/parport%d", address);
    else if (address != UNUSED && address < 0x400) /* only there the ECR has a fixed place */
        rtapi_snprintf(name, size, "port:0x%X:0x%X", (unsigned)address, (unsigned)address + 0x400u);
    else if (address != UNUSED)
        rtapi_snprintf(name, size, "port:0x%X", (unsigned)address);
}

/* ---- load and unload --------------------------------------------------------------------------------------------- */

static int bring_up(struct bus *const b, const char *const name, const struct ppmc_options *const options,
                    struct hm2_diag *const diag)
{
    struct epp *epp;
    const int err = epp_open(&epp, name, epp_dir[options->bus] != 0, diag);
    return err ? err : ppmc_setup(b->ppmc, epp, &hal.binder, options, diag);
}

static int load_bus(const unsigned number, const char *const name)
{
    struct bus *const b = &buses[number];
    struct ppmc_options options = ppmc_default_options();
    struct hm2_diag diag;
    options.bus = number;
    options.verify = verify != 0;
    if (add_board_bits("timestamp", timestamp, number, &options.timestamps) != 0 ||
        add_board_bits("expect", expect, number, &options.expected) != 0 || add_filters(number, &options) != 0)
        return -EINVAL;
    hm2_diag_clear(&diag);
    b->ppmc = ppmc_new();
    if (!b->ppmc)
        return -ENOMEM;
    atomic_store(&b->busy, false);
    bus_count++;
    const int err = bring_up(b, name, &options, &diag);
    messenger_print_diag("ppmc_epp", name, &diag);
    if (err != HM2_OK) {
        rtapi_print_msg(RTAPI_MSG_ERR, "ppmc_epp: %s: not loaded: %s\n", name, hm2_strerror(err));
        return -EINVAL;
    }
    const int result = export_function(number, "read", bus_read);
    return result < 0 ? result : export_function(number, "write", bus_write);
}

static int load_buses(void)
{
    tell_what_has_no_effect();
    int result = 0;
    for (unsigned i = 0; result == 0 && i < MAX_BUSES; i++) {
        char name[128];
        name_bus(i, name, sizeof name);
        if (!name[0])
            break;
        result = load_bus(i, name);
    }
    if (result == 0 && bus_count == 0) {
        rtapi_print_msg(RTAPI_MSG_ERR, "ppmc_epp: no bus given; load with: loadrt ppmc_epp bus=/dev/parport0\n");
        return -EINVAL;
    }
    return result;
}

void rtapi_app_exit(void)
{
    close_functions();
    messenger_stop();
    print_messages();
    for (unsigned i = 0; i < bus_count; i++)
        ppmc_stop(buses[i].ppmc);
    hal_exit(component_id);
    for (unsigned i = 0; i < bus_count; i++)
        ppmc_free(buses[i].ppmc);
    bus_count = 0;
}

static int load(void)
{
    hal_binder_init(&hal, component_id);
    atomic_store(&closing, false);
    const int result = load_buses();
    return result ? result : messenger_start("ppmc_epp", print_messages, MESSENGER_PRINTS_NS);
}

int rtapi_app_main(void)
{
    return component_load("ppmc_epp", &component_id, load, rtapi_app_exit);
}
