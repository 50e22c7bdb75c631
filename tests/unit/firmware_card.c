/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "firmware_card.h"

#include "idrom_files.h"
#include "replay.h"
#include "unit.h"

struct sim_card *firmware_card(const char *const firmware)
{
    struct hm2_image image;
    if (firmware)
        assert_true(replay_firmware(firmware, &image));
    else
        load_image(IDROM_7I96S, &image);
    const struct sim_card_options options = {.profile = firmware ? "7i93" : "7i96s", .image = &image};
    struct sim_card *card = NULL;
    struct hm2_diag diag = {0};
    if (sim_card_new(&card, &options, &diag) != 0)
        fail_msg("%s", diag.text);
    return card;
}
