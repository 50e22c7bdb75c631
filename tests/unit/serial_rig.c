/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "serial_rig.h"

#include "unit.h"

#include "replay.h"

#define MODULES_AT   1u /* word of the ROM: where the module descriptors begin, in bytes */
#define MODULE_WORDS 3u

struct sim_bench *serial_rig_pipelined(const char *const firmware)
{
    static const uint32_t dpll[MODULE_WORDS] = {1u << 24 | 1u << 16 | HM2_GTAG_DPLL, 7u << 16 | 0x7000u, 0};
    static struct hm2_image image;
    assert_true(replay_firmware(firmware, &image));
    uint32_t at = image.rom[MODULES_AT] / 4u;
    while (image.rom[at] & 0xFFu)
        at += MODULE_WORDS;
    memcpy(image.rom + at, dpll, sizeof dpll);
    image.rom[at + MODULE_WORDS] = 0;
    return sim_bench_of(&(struct sim_card_options){.profile = "7i80hd-16", .seed = 1, .image = &image}, "pipelined=4");
}

void serial_rig_start_turns(struct sim_bench *const bench)
{
    for (unsigned i = 0; i < SERIAL_RIG_TO_TURNS && sim_bench_get(bench, "pipeline.active") == 0; i++)
        sim_bench_cycle(bench);
    assert_true(sim_bench_get(bench, "pipeline.active") == 1);
}

struct hm2_serial *serial_rig_open(struct sim_bench *bench, const enum hm2_serial_kind kind,
                                   const struct hm2_serial_settings *settings)
{
    struct hm2_serial *const port = hm2_serial_port(bench->board, kind, 0);
    assert_non_null(port);
    hm2_board_change_begin(bench->board);
    assert_int_equal(hm2_serial_open(port, &bench->diag), 0);
    assert_int_equal(hm2_board_change_end(bench->board, &bench->diag), 0);
    if (hm2_serial_set(port, settings, &bench->diag) != 0)
        fail_msg("%s", bench->diag.text);
    return port;
}

static void echo_uart(void *context, uint8_t byte)
{
    const struct sim_bench *const bench = context;
    assert_int_equal(sim_card_serial_put(bench->card, HM2_GTAG_UART_TX, 0, &byte, 1), 1);
}

static void echo_pktuart(void *context, uint8_t byte)
{
    const struct sim_bench *const bench = context;
    assert_int_equal(sim_card_serial_put(bench->card, HM2_GTAG_PKTUART_TX, 0, &byte, 1), 1);
}

void serial_rig_echo(struct sim_bench *bench, const uint8_t gtag)
{
    const bool uart = gtag == HM2_GTAG_UART_TX;
    assert_int_equal(sim_card_serial(bench->card, gtag, 0, uart ? echo_uart : echo_pktuart, bench), 0);
}

static void hear(void *context, uint8_t byte)
{
    struct serial_ear *const ear = context;
    if (ear->heard < sizeof ear->byte)
        ear->byte[ear->heard] = byte;
    ear->heard++;
}

void serial_rig_listen(struct sim_bench *bench, struct serial_ear *ear)
{
    assert_int_equal(sim_card_serial(bench->card, HM2_GTAG_PKTUART_TX, 0, hear, ear), 0);
}

void serial_rig_say(struct sim_bench *bench, const void *bytes, const size_t len)
{
    assert_int_equal(sim_card_serial_put(bench->card, HM2_GTAG_PKTUART_TX, 0, bytes, len), len);
}
