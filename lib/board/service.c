/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A smart-serial port of an identified card that nobody drives, for tools. */
#include <hm2/board.h>
#include <hm2/bytes.h>
#include <hm2/lbp16.h>
#include <hm2/sslbp.h>

#include "board_private.h"

#define LISTEN_NS    INT64_C(60000000) /* a driver sends in every cycle, of 10 ms at the very most */
#define MAX_OWN      BOARD_TRIES       /* packets of our own between the two readings */
#define MAX_RECEIVED 64u
#define MAX_IOPORTS  16u

enum { IOPORT_DIRECTION = 1, IOPORT_ALT_SOURCE = 2 }; /* registers (register map 3.1) */

static int count_packets(struct hm2_board *const board, uint16_t *const count)
{
    struct board_exchange exchange;
    size_t at = 0;
    board_exchange_begin(board, &exchange);
    (void)lbp16_add_read16(&exchange.builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_RX_UDP, 1, &at);
    const int err = board_exchange_run(board, &exchange, BOARD_TRIES, BOARD_TRY_NS);
    *count = err ? 0 : hm2_get_le16(exchange.reply + at);
    return err;
}

static void let_time_pass(struct hm2_board *const board)
{
    uint8_t late[LBP16_MAX_REPLY_BYTES];
    const int64_t end_ns = link_now_ns(board->link) + LISTEN_NS;
    for (unsigned i = 0; i < MAX_RECEIVED; i++)
        if (link_recv(board->link, late, sizeof late, end_ns) == HM2_ERR_TIMEOUT)
            return;
}

int hm2_board_undriven(struct hm2_board *const board, struct hm2_diag *const diag)
{
    uint16_t before = 0, after = 0;
    int err = count_packets(board, &before);
    let_time_pass(board);
    if (!err)
        err = count_packets(board, &after);
    if (err)
        return hm2_diag_add(diag, err, "The card's packet counters cannot be read: %s.", hm2_strerror(err));
    const uint16_t packets = (uint16_t)(after - before);
    if (packets <= MAX_OWN)
        return 0;
    return hm2_diag_add(
        diag, HM2_ERR_STATE,
        "Another program talks to this card: %u packets in %d ms. End it first: what is to be done here "
        "would stop the machine it drives.",
        packets, (int)(LISTEN_NS / 1000000));
}

/* ---- registers and pins -------------------------------------------------------------------------------------------
 */

static int bus_read(void *const access, const uint16_t address, const unsigned words, uint32_t *const values)
{
    return board_peek(access, address, words, values);
}

static int bus_write(void *const access, const uint16_t address, const unsigned words, const uint32_t *const values)
{
    return board_poke(access, address, words, values, BOARD_TRIES, BOARD_TRY_NS);
}

static int64_t bus_now_ns(void *const access)
{
    const struct hm2_board *const board = access;
    return link_now_ns(board->link);
}

/* Drive the outputs of this port, or with port_pins = false none of any module. */
static int drive(struct hm2_board *const board, const uint8_t gtag, const unsigned port, const bool port_pins)
{
    const struct hm2_idrom *const idrom = hm2_board_idrom(board);
    const struct hm2_md *const ioport = hm2_idrom_find(idrom, HM2_GTAG_IOPORT);
    uint32_t words[MAX_IOPORTS] = {0};
    if (!ioport || idrom->port_width == 0)
        return HM2_ERR_UNSUPPORTED;
    for (unsigned io = 0; port_pins && io < idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &idrom->pins[io];
        if (pd->secondary_tag == gtag && pd->secondary_unit == port && pd->secondary_pin & HM2_PIN_OUTPUT &&
            io / idrom->port_width < MAX_IOPORTS)
            words[io / idrom->port_width] |= UINT32_C(1) << io % idrom->port_width;
    }
    int err = 0;
    for (unsigned i = 0; !err && i < ioport->instances && i < MAX_IOPORTS; i++)
        err = bus_write(board, hm2_md_address(ioport, IOPORT_ALT_SOURCE, i), 1, &words[i]);
    for (unsigned i = 0; !err && i < ioport->instances && i < MAX_IOPORTS; i++)
        err = bus_write(board, hm2_md_address(ioport, IOPORT_DIRECTION, i), 1, &words[i]);
    return err;
}

/* ---- port ---------------------------------------------------------------------------------------------------------
 */

static const struct hm2_md *find_module(const struct hm2_board *const board)
{
    const struct hm2_md *const plain = hm2_idrom_find(hm2_board_idrom(board), HM2_GTAG_SSERIAL);
    return plain ? plain : hm2_idrom_find(hm2_board_idrom(board), HM2_GTAG_SSERIALB);
}

int hm2_board_sserial_open(struct hm2_board *const board, const unsigned port, struct sslbp_port *const access,
                           struct hm2_diag *const diag)
{
    const struct hm2_md *const md = find_module(board);
    *access = (struct sslbp_port){
        .bus = {board, bus_read, bus_write, bus_now_ns}, .name = hm2_board_card_name(board), .diag = diag};
    if (!md || port >= md->instances)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "%s: smart-serial port %u: this firmware has %u of them.",
                            access->name, port, md ? md->instances : 0u);
    sslbp_port_place(access, md, port);
    const int err = drive(board, md->gtag, port, true);
    if (err)
        return hm2_diag_add(diag, err, "%s: the pins of smart-serial port %u cannot be driven: %s.", access->name, port,
                            hm2_strerror(err));
    return sslbp_port_open(access);
}

void hm2_board_sserial_close(struct hm2_board *const board, const struct sslbp_port *const access)
{
    (void)!sslbp_port_stop(access);
    (void)!drive(board, 0, 0, false);
}
