/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Who is there, what is in its flash, and is anybody else talking to it (flash tool reference 3.1, 3.2, 3.17, 5). */
#include "card.h"

#include <stdlib.h>
#include <string.h>

#include <hm2/bytes.h>

#define ID_WORDS       4u
#define INFO_WORDS     (LBP16_INFO_BYTES / 2u)
#define TIMER_SPACE_IN 3u /* first LBP16 version that has space 4 (flash tool reference 1.4.1) */
#define FIRST_TRIES    5u /* 2.5 s */
#define QUIET_NS       INT64_C(100000000)
#define QUIET_ROUNDS   3u
#define QUIET_FOR_NS   INT64_C(1000000000)

int flash_lost(struct hm2_diag *const diag, const int err, const char *const what)
{
    return hm2_diag_add(
        diag, err,
        "the card does not answer any more while %s. Do not switch it off: what it runs now stays until "
        "then. Check cable and address, and run the same command again; it goes on where this one ended",
        what);
}

static int silent(struct hm2_diag *const diag)
{
    return hm2_diag_add(
        diag, HM2_ERR_TIMEOUT,
        "no card answers LBP16 on UDP port %d. Check its power and cable, its address jumpers (down/down "
        "is 192.168.1.121), and that this host has an address in the same network. While LinuxCNC's "
        "hm2_eth runs on this host, its firewall rules let nobody else send: stop LinuxCNC first",
        LBP16_UDP_PORT);
}

/* ---- identify --------------------------------------------------------------------------------------------------- */

static void take_name(struct flash_card_info *const info, const uint8_t *const bytes)
{
    for (unsigned i = 0; i < LBP16_INFO_NAME_BYTES && bytes[i]; i++)
        info->card_name[i] = bytes[i] < ' ' || bytes[i] > '~' ? '?' : (char)bytes[i];
    info->board = flash_board_of_card(info->card_name);
}

static void add_id(struct flash_port *const port, size_t *const at)
{
    const struct lbp16_command command = {
        .has_address = true, .space = LBP16_SPACE_FLASH, .size = LBP16_SIZE_32, .count = 1, .address = LBP16_FLASH_ID};
    (void)lbp16_add_read(&port->builder, &command, at);
}

static bool is_power(const unsigned log2, const uint32_t value)
{
    return log2 < 32 && (uint32_t)1 << log2 == value;
}

/* The information area tells the sizes independently of the ID; a chip of which they disagree is not written (3.2).
 * The firmware gives the size of the chip in bits, as log2 = ID + 4 (tests/data/lbp16, exchange 31), where the manuals
 * have bytes (seed 000, "INFO AREA MEMRANGES FORMAT"): both are understood. */
static void judge_chip(struct flash_card_info *const info)
{
    const struct lbp16_info *const space = &info->space[LBP16_SPACE_FLASH];
    const struct flash_chip *const chip = flash_chip_of_id((uint8_t)info->flash_id);
    const bool agrees = chip &&
                        (is_power(space->size_log2, chip->bytes) || is_power(space->size_log2, 8 * chip->bytes)) &&
                        is_power(space->erase_log2, chip->sector_bytes) && is_power(space->page_log2, chip->page_bytes);
    info->chip = chip && (space->cookie == 0 || agrees) ? chip : NULL;
}

static int read_first(struct flash_card *const card, struct hm2_diag *const diag)
{
    static const enum lbp16_space spaces[] = {LBP16_SPACE_HM2,   LBP16_SPACE_ETHERNET, LBP16_SPACE_EEPROM,
                                              LBP16_SPACE_FLASH, LBP16_SPACE_CONTROL,  LBP16_SPACE_INFO};
    struct flash_port *const port = &card->port;
    struct flash_card_info *const info = &card->info;
    size_t name_at, words_at, flash_at, id_at, area_at[sizeof spaces / sizeof spaces[0]];
    flash_port_begin(port);
    (void)lbp16_add_read16(&port->builder, LBP16_SPACE_INFO, LBP16_INFO_NAME, LBP16_INFO_NAME_BYTES / 2u, &name_at);
    (void)lbp16_add_read16(&port->builder, LBP16_SPACE_INFO, LBP16_INFO_LBP_VERSION, 3, &words_at);
    add_id(port, &flash_at);
    (void)lbp16_add_read_hm2(&port->builder, HM2_ADDR_COOKIE, ID_WORDS, &id_at);
    for (unsigned i = 0; i < sizeof spaces / sizeof spaces[0]; i++)
        (void)lbp16_add_read_info(&port->builder, spaces[i], &area_at[i]);
    const int err = flash_port_run(port, FLASH_WORK_READ, FIRST_TRIES);
    if (err < 0)
        return silent(diag);
    take_name(info, port->reply + name_at);
    info->lbp_version = hm2_get_le16(port->reply + words_at);
    info->firmware = hm2_get_le16(port->reply + words_at + 2);
    info->jumpers = hm2_get_le16(port->reply + words_at + 4);
    info->flash_id = hm2_get_le32(port->reply + flash_at);
    for (unsigned i = 0; i < ID_WORDS; i++)
        info->image.id[i] = hm2_get_le32(port->reply + id_at + 4u * i);
    info->cookie = info->image.id[0];
    for (unsigned i = 0; i < sizeof spaces / sizeof spaces[0]; i++)
        if (lbp16_info_decode(spaces[i], port->reply + area_at[i], LBP16_INFO_BYTES, &info->space[spaces[i]]) != 0)
            info->space[spaces[i]].cookie = 0;
    judge_chip(info);
    return 0;
}

/* ---- the rest: settings, IDROM, timer space -----------------------------------------------------------------------
 */

static void take_settings(struct flash_card_info *const info)
{
    const uint16_t *const words = info->eeprom;
    for (unsigned i = 0; i < 3; i++) {
        const uint16_t word = words[LBP16_EEPROM_MAC / 2 + 2 - i];
        info->mac[2 * i] = (uint8_t)(word >> 8);
        info->mac[2 * i + 1] = (uint8_t)word;
    }
    for (unsigned i = 0; i < 2; i++) {
        const uint16_t ip = words[LBP16_EEPROM_IP / 2 + 1 - i], mask = words[LBP16_EEPROM_NETMASK / 2 + 1 - i];
        info->ip[2 * i] = (uint8_t)(ip >> 8);
        info->ip[2 * i + 1] = (uint8_t)ip;
        info->netmask[2 * i] = (uint8_t)(mask >> 8);
        info->netmask[2 * i + 1] = (uint8_t)mask;
    }
}

/* Descriptors of the pins that are on no connector follow those that are (2.7, tag 0x40). */
static void take_local_pins(struct flash_card_info *const info)
{
    const uint32_t *const rom = info->image.rom;
    const uint32_t first = rom[2] / 4u, io_width = rom[8];
    info->local_pin_count = 0;
    if (first >= HM2_IDROM_WORDS || io_width >= HM2_IDROM_WORDS)
        return;
    for (uint32_t i = first + io_width; i < HM2_IDROM_WORDS && info->local_pin_count < HM2_MAX_PINS; i++) {
        if (rom[i] >> 24 != HM2_GTAG_LIOPORT)
            return;
        info->local_pins[info->local_pin_count++] = rom[i];
    }
}

static int read_rest(struct flash_card *const card, struct hm2_diag *const diag)
{
    struct flash_card_info *const info = &card->info;
    struct flash_port *const port = &card->port;
    size_t at;
    int err = flash_card_read16(card, LBP16_SPACE_EEPROM, 0, LBP16_EEPROM_BYTES / 2, info->eeprom, diag);
    if (err < 0)
        return err;
    take_settings(info);
    if (info->cookie == HM2_COOKIE)
        err = flash_card_read_hm2(card, (uint16_t)info->image.id[3], HM2_IDROM_WORDS, info->image.rom, diag);
    if (err < 0)
        return err;
    if (info->cookie == HM2_COOKIE)
        take_local_pins(info);
    if (info->lbp_version < TIMER_SPACE_IN)
        return 0;
    flash_port_begin(port);
    (void)lbp16_add_read_info(&port->builder, LBP16_SPACE_TIMER, &at);
    err = flash_port_run(port, FLASH_WORK_READ, FLASH_TRIES);
    if (err < 0)
        return flash_lost(diag, err, "reading its information areas");
    if (lbp16_info_decode(LBP16_SPACE_TIMER, port->reply + at, LBP16_INFO_BYTES, &info->space[LBP16_SPACE_TIMER]) != 0)
        info->space[LBP16_SPACE_TIMER].cookie = 0;
    return 0;
}

int flash_identify(struct flash_card *const card, struct hm2_diag *const diag)
{
    memset(&card->info, 0, sizeof card->info);
    const int err = read_first(card, diag);
    return err < 0 ? err : read_rest(card, diag);
}

int flash_card_new(struct flash_card **const card, struct link *const link, struct hm2_diag *const diag)
{
    struct flash_card *const made = calloc(1, sizeof *made);
    *card = NULL;
    if (!made)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for a card");
    flash_port_init(&made->port, link);
    made->port.counters.bytes_per_read = FLASH_READ_MOST;
    made->port.counters.pages_per_write = 1;
    made->port.counters.requests_ahead = 2; /* to begin with */
    const int err = flash_identify(made, diag);
    if (err < 0)
        free(made);
    else
        *card = made;
    return err;
}

void flash_card_free(struct flash_card *const card)
{
    free(card);
}

const struct flash_card_info *flash_card_info(const struct flash_card *const card)
{
    return &card->info;
}

struct link *flash_card_link(const struct flash_card *const card)
{
    return card->port.link;
}

struct flash_counters flash_card_counters(const struct flash_card *const card)
{
    return card->port.counters;
}

/* ---- is there anybody? ------------------------------------------------------------------------------------------ */

int flash_probe(struct link *const link)
{
    uint8_t request[16];
    struct lbp16_builder builder;
    lbp16_builder_init(&builder, request, sizeof request);
    const int err = lbp16_add_read_hm2(&builder, HM2_ADDR_COOKIE, 1, NULL);
    return err < 0 ? err : link_send(link, request, builder.used);
}

bool flash_probe_answered(struct link *const link, const int64_t deadline_ns)
{
    uint8_t reply[LBP16_MAX_REPLY_BYTES];
    return link_recv(link, reply, sizeof reply, deadline_ns) == 4 && hm2_get_le32(reply) == HM2_COOKIE;
}

/* ---- what is there now ------------------------------------------------------------------------------------------ */

int flash_card_survey(struct flash_card *const card, struct flash_survey *const survey, struct hm2_diag *const diag)
{
    const struct flash_chip *const chip = card->info.chip;
    if (!chip || !card->info.board)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED, "nothing is known about the flash of \"%s\" (chip ID 0x%02X)",
                            card->info.card_name, (unsigned)card->info.flash_id & 0xFFu);
    const enum flash_family family = card->info.board->family;
    const struct {
        uint32_t address;
        enum flash_content *content;
    } places[] = {{0, &survey->sector0},
                  {flash_area_range(family, chip, FLASH_FALLBACK).start, &survey->fallback},
                  {flash_area_range(family, chip, FLASH_USER).start, &survey->user}};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        uint8_t head[FLASH_HEAD_BYTES];
        const int err = flash_card_read(card, places[i].address, head, sizeof head, diag);
        if (err < 0)
            return err;
        *places[i].content = flash_content_of(chip, head);
    }
    return 0;
}

static int look(struct flash_card *const card, struct hm2_diag *const diag)
{
    flash_port_begin(&card->port);
    const int err = flash_port_run(&card->port, FLASH_WORK_READ, FLASH_TRIES);
    return err < 0 ? flash_lost(diag, err, "looking at its packet counters") : 0;
}

static bool nobody_since(const struct flash_card *const card, const uint64_t foreign, const uint64_t intruders)
{
    return card->port.counters.foreign == foreign && card->port.intruders == intruders;
}

/* A driver sends in every round; a datagram that the network repeated does so once. */
int flash_card_quiet(struct flash_card *const card, struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    uint64_t heard = 0;
    if (link_now_ns(port->link) < card->quiet_until_ns &&
        nobody_since(card, card->quiet_foreign, card->quiet_intruders))
        return 0;
    for (unsigned i = 0; i < QUIET_ROUNDS; i++) {
        int err = look(card, diag);
        if (err < 0)
            return err;
        const uint64_t foreign = port->counters.foreign, intruders = port->intruders;
        flash_port_wait(port, QUIET_NS);
        err = look(card, diag);
        if (err < 0)
            return err;
        if (nobody_since(card, foreign, intruders)) {
            card->quiet_foreign = foreign;
            card->quiet_intruders = intruders;
            card->quiet_until_ns = link_now_ns(port->link) + QUIET_FOR_NS;
            return 0;
        }
        heard += port->counters.foreign - foreign;
    }
    return hm2_diag_add(diag, HM2_ERR_STATE,
                        "another program talks to this card (%llu datagrams in %u ms%s). Stop LinuxCNC, hm2host or the "
                        "other tool first, and see that the machine stands still; nothing was changed",
                        (unsigned long long)heard, QUIET_ROUNDS * (unsigned)(QUIET_NS / 1000000),
                        card->port.intruders ? ", and it uses the scratch register as flash tools do" : "");
}

int flash_card_outputs(struct flash_card *const card, struct hm2_diag *const diag)
{
    enum { DDR = 1 }; /* register of the IOPort module: bit set = output */
    struct hm2_idrom idrom;
    struct hm2_diag ignored = {0};
    int outputs = 0;
    if (card->info.cookie != HM2_COOKIE || hm2_idrom_parse(&card->info.image, NULL, &idrom, &ignored) != 0)
        return 0;
    const struct hm2_md *const ports = hm2_idrom_find(&idrom, HM2_GTAG_IOPORT);
    for (unsigned i = 0; ports && i < ports->instances; i++) {
        uint32_t word = 0;
        const int err = flash_card_read_hm2(card, hm2_md_address(ports, DDR, i), 1, &word, diag);
        if (err < 0)
            return err;
        for (; word; word &= word - 1)
            outputs++;
    }
    return outputs;
}

/* ---- registers and settings ------------------------------------------------------------------------------------- */

int flash_card_read16(struct flash_card *const card, const enum lbp16_space space, uint16_t address, unsigned count,
                      uint16_t *words, struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    while (count > 0) {
        const unsigned part = count < LBP16_MAX_COUNT ? count : LBP16_MAX_COUNT;
        size_t at;
        flash_port_begin(port);
        (void)lbp16_add_read16(&port->builder, space, address, part, &at);
        const int err = flash_port_run(port, FLASH_WORK_READ, FLASH_TRIES);
        if (err < 0)
            return flash_lost(diag, err, "reading its registers");
        for (unsigned i = 0; i < part; i++)
            words[i] = hm2_get_le16(port->reply + at + 2u * (size_t)i);
        address = (uint16_t)(address + 2u * part);
        words += part;
        count -= part;
    }
    return 0;
}

int flash_card_read_hm2(struct flash_card *const card, uint16_t address, unsigned count, uint32_t *words,
                        struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    while (count > 0) {
        const unsigned part = count < LBP16_MAX_COUNT ? count : LBP16_MAX_COUNT;
        size_t at;
        flash_port_begin(port);
        (void)lbp16_add_read_hm2(&port->builder, address, part, &at);
        const int err = flash_port_run(port, FLASH_WORK_READ, FLASH_TRIES);
        if (err < 0)
            return flash_lost(diag, err, "reading HostMot2 registers");
        for (unsigned i = 0; i < part; i++)
            words[i] = hm2_get_le32(port->reply + at + 4u * (size_t)i);
        address = (uint16_t)(address + 4u * part);
        words += part;
        count -= part;
    }
    return 0;
}

int flash_card_write_hm2(struct flash_card *const card, const uint16_t address, const unsigned count,
                         const uint32_t *const words, struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    size_t at = 0;
    flash_port_begin(port);
    int err = lbp16_add_write_hm2(&port->builder, address, count, NULL, &at);
    if (err < 0)
        return hm2_diag_add(diag, err, "%u registers cannot be written in one datagram", count);
    for (unsigned i = 0; i < count; i++)
        hm2_put_le32(port->request + at + 4u * (size_t)i, words[i]);
    err = flash_port_run(port, FLASH_WORK_READ, FLASH_TRIES);
    return err < 0 ? flash_lost(diag, err, "writing HostMot2 registers") : 0;
}

int flash_card_write_eeprom(struct flash_card *const card, const uint16_t address, const unsigned count,
                            const uint16_t *const words, struct hm2_diag *const diag)
{
    enum { MOST = 16 };
    static const uint16_t key = 0x5A02;
    struct flash_port *const port = &card->port;
    uint16_t back[MOST] = {0};
    if (count > MOST || address < LBP16_EEPROM_IP || address + 2u * count > LBP16_EEPROM_BYTES)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "settings at 0x%02X to 0x%02X cannot be written", (unsigned)address,
                            (unsigned)(address + 2u * count));
    flash_port_begin(port);
    (void)lbp16_add_write16(&port->builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_WRITE_ENABLE, 1, &key, NULL);
    (void)lbp16_add_write16(&port->builder, LBP16_SPACE_EEPROM, address, count, words, NULL);
    (void)lbp16_add_read16(&port->builder, LBP16_SPACE_EEPROM, address, count, NULL);
    int err = flash_port_run(port, FLASH_WORK_READ, FLASH_TRIES);
    if (err < 0)
        return flash_lost(diag, err, "writing its settings");
    err = flash_card_read16(card, LBP16_SPACE_EEPROM, address, count, back, diag);
    if (err < 0)
        return err;
    for (unsigned i = 0; i < count; i++)
        if (back[i] != words[i])
            return hm2_diag_add(diag, HM2_ERR_IO,
                                "the settings memory holds 0x%04X at 0x%02X after 0x%04X was written; try again",
                                back[i], (unsigned)(address + 2u * i), words[i]);
    memcpy(card->info.eeprom + address / 2u, words, count * sizeof words[0]);
    take_settings(&card->info);
    return 0;
}
