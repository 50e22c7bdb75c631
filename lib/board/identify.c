/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Who is there: the card's name (LBP16 space 7), cookie, config name and IDROM (register map 1.2). */
#include <string.h>

#include <hm2/bytes.h>
#include <hm2/lbp16.h>

#include "board_private.h"

#define ID_WORDS 4u

void board_image_add(struct lbp16_builder *const builder, struct board_image_request *const where,
                     const uint16_t rom_address)
{
    (void)lbp16_add_read_hm2(builder, HM2_ADDR_COOKIE, ID_WORDS, &where->id_at);
    unsigned done = 0;
    for (unsigned i = 0; i < 3; i++) {
        const unsigned left = HM2_IDROM_WORDS - done;
        const unsigned count = left < LBP16_MAX_COUNT ? left : LBP16_MAX_COUNT;
        (void)lbp16_add_read_hm2(builder, (uint16_t)(rom_address + 4u * done), count, &where->rom_at[i]);
        done += count;
    }
}

static void take_words(const uint8_t *const bytes, const unsigned count, uint32_t *const words)
{
    for (unsigned i = 0; i < count; i++)
        words[i] = hm2_get_le32(bytes + 4u * i);
}

void board_image_take(const uint8_t *const reply, const struct board_image_request *const where,
                      struct hm2_image *const image)
{
    take_words(reply + where->id_at, ID_WORDS, image->id);
    /* The three reads follow one another, so the ROM is one run of bytes. */
    take_words(reply + where->rom_at[0], HM2_IDROM_WORDS, image->rom);
}

static bool is_word_char(const char c)
{
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
}

/* HAL name of a card that the table does not know: up to four characters of its name (hal-interface 1.3). */
static void make_stem(struct hm2_board *const board)
{
    unsigned len = 0;
    for (; len < 4 && board->card_name[len]; len++) {
        const char c = board->card_name[len];
        board->stem[len] = c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : is_word_char(c) ? c : '_';
    }
    memcpy(board->stem + len, len ? "" : "card", len ? 1 : sizeof "card");
}

static void take_name(struct hm2_board *const board, const uint8_t *const bytes)
{
    char name[HM2_BOARD_NAME_BYTES];
    memcpy(name, bytes, sizeof name);
    board->type = *hm2_board_type_find(name);
    for (unsigned i = 0; i < HM2_BOARD_NAME_BYTES; i++)
        board->card_name[i] = name[i] && (name[i] < ' ' || name[i] > '~') ? '?' : name[i];
    if (board->type.name[0] == '\0') {
        make_stem(board);
        board->type.stem = board->stem;
        board->type.name = board->card_name;
    }
}

static int no_answer(struct hm2_board *const board, const int err, struct hm2_diag *const diag)
{
    return hm2_diag_add(
        diag, err,
        "%s after %u requests of %d ms each: %s; expected a Mesa card that answers LBP16 on UDP port %d. "
        "Check the card's power and cable, its address jumpers, and that this host has an address in "
        "the same network",
        board->card_name[0] ? board->card_name : "no card answers", BOARD_TRIES, (int)(BOARD_TRY_NS / 1000000),
        hm2_strerror(err), LBP16_UDP_PORT);
}

static int read_name(struct hm2_board *const board, uint32_t id[ID_WORDS])
{
    struct board_exchange exchange;
    size_t name_at, id_at;
    board_exchange_begin(board, &exchange);
    (void)lbp16_add_read16(&exchange.builder, LBP16_SPACE_INFO, LBP16_INFO_NAME, HM2_BOARD_NAME_BYTES / 2u, &name_at);
    (void)lbp16_add_read_hm2(&exchange.builder, HM2_ADDR_COOKIE, ID_WORDS, &id_at);
    const int err = board_exchange_run(board, &exchange, BOARD_TRIES, BOARD_TRY_NS);
    if (err < 0)
        return err;
    take_name(board, exchange.reply + name_at);
    take_words(exchange.reply + id_at, ID_WORDS, id);
    return 0;
}

static int read_image(struct hm2_board *const board, const uint16_t rom_address)
{
    struct board_exchange exchange;
    struct board_image_request where;
    board_exchange_begin(board, &exchange);
    board_image_add(&exchange.builder, &where, rom_address);
    const int err = board_exchange_run(board, &exchange, BOARD_TRIES, BOARD_TRY_NS);
    if (err == 0)
        board_image_take(exchange.reply, &where, &board->image);
    return err;
}

int hm2_board_identify(struct hm2_board *const board, struct link *const link, struct hm2_diag *const diag)
{
    if (board->state != BOARD_NEW || board->link)
        return hm2_diag_add(diag, HM2_ERR_STATE, "this board has been identified already");
    board->link = link;
    /* Numbers that an earlier program is unlikely to have used, should its replies still be on their way. */
    board->nonce = (uint32_t)(link_now_ns(link) / 1000) * 2654435761u;
    uint32_t id[ID_WORDS];
    int err = read_name(board, id);
    if (err == 0)
        err = read_image(board, (uint16_t)id[3]);
    if (err < 0)
        return no_answer(board, err, diag);
    const struct hm2_idrom_expect expect = {board->card_name, board->type.io_ports, board->type.port_width};
    err = hm2_idrom_parse(&board->image, &expect, &board->idrom, diag);
    if (err < 0)
        return err;
    board->idrom.io_ports = hm2_idrom_ports(&board->idrom);
    const unsigned usable = board->idrom.io_ports * board->idrom.port_width;
    board->idrom.pin_count = usable < board->idrom.pin_count ? usable : board->idrom.pin_count;
    if (board->type.io_ports == 0) {
        board->type.io_ports = board->idrom.io_ports;
        board->type.port_width = board->idrom.port_width;
    }
    if (board->type.stem == board->stem)
        hm2_diag_warn(diag, "\"%s\" is no card known here; its connectors' names are not known either",
                      board->card_name);
    board->state = BOARD_IDENTIFIED;
    return 0;
}
