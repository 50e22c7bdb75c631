/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A simulated 7I96S whose IDROM was changed here and there, and any config string: the board refuses it with a reason,
 * or sets it up and runs a few cycles. Input: number of patches, each a word number and a value, then the string.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/board.h>
#include <hm2/bytes.h>
#include <hm2/sim.h>

#define PERIOD_NS 1000000
#define CYCLES    4u

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const struct hm2_image *original(void)
{
    static struct hm2_image image;
    static bool loaded;
    if (loaded)
        return &image;
    char text[8192];
    FILE *const file = fopen(TEST_DATA "/idrom_7i96s/7i96s_d.hex", "r");
    if (!file)
        abort();
    const size_t len = fread(text, 1, sizeof text, file);
    (void)fclose(file);
    if (hm2_image_from_text(text, len, &image, NULL) != 0)
        abort();
    loaded = true;
    return &image;
}

static void run(struct hm2_board *const board, struct sim_net *const net)
{
    for (unsigned i = 0; i < CYCLES; i++) {
        hm2_board_read(board, PERIOD_NS);
        hm2_board_write(board, PERIOD_NS);
        sim_net_sleep_until(net, link_now_ns(sim_net_link(net)) + PERIOD_NS);
    }
    char text[512];
    bool error;
    while (hm2_board_next_message(board, text, sizeof text, &error) > 0)
        ;
    (void)hm2_board_describe_pins(board, text, sizeof text);
}

static void bring_up(struct sim_net *const net, const char *const config)
{
    struct hm2_diag diag = {0};
    struct hm2_board *const board = hm2_board_new();
    struct hm2_plain_binder *const plain = hm2_plain_binder_new();
    if (!board || !plain)
        abort();
    int err = hm2_board_identify(board, sim_net_link(net), &diag);
    if (err == 0)
        err = hm2_board_setup(board, 0, hm2_plain_binder(plain), config, &diag);
    if (err == 0)
        err = hm2_board_start(board, &diag);
    if (err < 0 && diag.problems == 0)
        abort(); /* refused without a sentence */
    if (err == 0)
        run(board, net);
    hm2_board_stop(board);
    hm2_board_free(board);
    hm2_plain_binder_free(plain);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hm2_image image = *original();
    unsigned patches = size > 0 ? data[0] % 16u : 0;
    for (size > 0 ? (data++, size--) : 0; patches > 0 && size >= 5; patches--, data += 5, size -= 5)
        image.rom[data[0]] = hm2_get_le32(data + 1);
    char config[512];
    const size_t len = size < sizeof config - 1 ? size : sizeof config - 1;
    memcpy(config, data, len);
    config[len] = '\0';

    const struct sim_card_options options = {.profile = "7i96s", .image = &image, .seed = 1};
    struct sim_card *card;
    struct sim_net *net;
    if (sim_card_new(&card, &options, NULL) != 0)
        return 0;
    if (sim_net_new(&net, card, NULL) == 0) {
        bring_up(net, config);
        sim_net_free(net);
    }
    sim_card_free(card);
    return 0;
}
