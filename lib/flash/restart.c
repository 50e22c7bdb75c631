/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Starting the FPGA from its flash, or the card's firmware, and waiting until it is back (flash tool reference 3.13,
 * 3.14). */
#include <string.h>

#include <hm2/bytes.h>

#include "card.h"

#define RELOAD_FIRMWARE 15u /* the first that can */
#define POLL_NS         INT64_C(100000000)
#define FALLBACK_BANK   0x01u

/* Spartan-6: GENERAL1/2 = where to load from, then IPROG. From 0 the boot block leads to the user image. */
static void add_xilinx(struct lbp16_builder *const builder, const enum flash_area area)
{
    const uint16_t bank = area == FLASH_FALLBACK ? FALLBACK_BANK : 0;
    const uint16_t words[] = {0xFFFF, 0xFFFF, 0xAA99, 0x5566, 0x3261, 0x0000, 0x3281, (uint16_t)(0x0B00u | bank),
                              0x30A1, 0x000E, 0x2000, 0x2000, 0x2000, 0x2000};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        (void)lbp16_add_write16(builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_ICAP, 1, &words[i], NULL);
}

/* Trion: image number, then the same with the start bit. */
static void add_efinix(struct lbp16_builder *const builder, const enum flash_area area)
{
    enum { ENABLE = 4, START = 8 };
    const unsigned number = area == FLASH_USER ? 1 : 0;
    const uint16_t words[] = {(uint16_t)(number | ENABLE), (uint16_t)(number | ENABLE | START)};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        (void)lbp16_add_write16(builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_ICAP, 1, &words[i], NULL);
}

static int fire(struct flash_card *const card, struct hm2_diag *const diag)
{
    const int err = flash_port_fire(&card->port);
    return err < 0 ? hm2_diag_add(diag, err, "the request could not be sent: %s", hm2_strerror(err)) : 0;
}

int flash_card_reload(struct flash_card *const card, const enum flash_area area, struct hm2_diag *const diag)
{
    const struct flash_card_info *const info = &card->info;
    if (!info->board)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED, "how a \"%s\" is reloaded is not known; switch it off and on",
                            info->card_name);
    if (info->firmware < RELOAD_FIRMWARE)
        return hm2_diag_add(
            diag, HM2_ERR_UNSUPPORTED,
            "ERROR: FPGA reload only supported by ethernet card firmware > %u. This card has %u: switch "
            "it off and on instead",
            RELOAD_FIRMWARE - 1, info->firmware);
    lbp16_builder_init(&card->port.builder, card->port.request, sizeof card->port.request);
    (info->board->family == FLASH_XILINX ? add_xilinx : add_efinix)(&card->port.builder, area);
    return fire(card, diag);
}

int flash_card_reset(struct flash_card *const card, struct hm2_diag *const diag)
{
    const uint16_t any = 1;
    lbp16_builder_init(&card->port.builder, card->port.request, sizeof card->port.request);
    (void)lbp16_add_write16(&card->port.builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_RESET, 1, &any, NULL);
    return fire(card, diag);
}

/* The old program may still answer until it is gone. The new one has another number in its scratch register, counts
 * its packets from the start, or was silent in between. */
static bool started_anew(struct flash_card *const card, bool *const silent)
{
    struct flash_port *const port = &card->port;
    const uint16_t accepted = port->accepted, newest = port->sequence, rx_udp = port->rx_udp;
    port->greeted = false;
    flash_port_begin(port);
    if (flash_port_run(port, FLASH_WORK_READ, 1) != 0) {
        *silent = true;
        return false;
    }
    const uint16_t before = hm2_get_le16(port->reply + port->before_at);
    return *silent || (before != accepted && before != newest) || (int16_t)(port->rx_udp - rx_udp) < 0;
}

int flash_card_await(struct flash_card *const card, const int64_t limit_ns, struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    const int64_t end_ns = link_now_ns(port->link) + limit_ns;
    bool silent = false;
    while (link_now_ns(port->link) < end_ns) {
        const int64_t next_ns = link_now_ns(port->link) + POLL_NS;
        if (started_anew(card, &silent))
            return flash_identify(card, diag);
        if (link_now_ns(port->link) < next_ns)
            flash_port_wait(port, next_ns - link_now_ns(port->link));
    }
    if (!silent)
        return hm2_diag_add(diag, HM2_ERR_STATE,
                            "the card goes on answering as before: it did not restart. Switch it off and on");
    return hm2_diag_add(diag, HM2_ERR_TIMEOUT,
                        "the card did not come back within %d s. Its address is what its jumpers say, which may differ "
                        "from before. An Efinix card starts its fallback image at 192.168.1.121 when both address "
                        "jumpers are up at power-on; a Xilinx card does by itself when its user image is damaged",
                        (int)(limit_ns / INT64_C(1000000000)));
}
