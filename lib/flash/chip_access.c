/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading, erasing and programming through space 3 (seed 000, "FLASH MEMORY REGISTERS"; flash tool reference 3.3 to
 * 3.7). Address, write enable, command and echo always travel in one datagram, so none can be lost without the others,
 * and repeating a datagram does no harm.
 */
#include <string.h>

#include <hm2/bytes.h>

#include "card.h"

#define WRITE_KEY  0x5A03u
#define WORD_BYTES 4u

static void add_address(struct lbp16_builder *const builder, const uint32_t address)
{
    const struct lbp16_command command = {
        .write = true, .has_address = true, .space = LBP16_SPACE_FLASH, .size = LBP16_SIZE_32, .count = 1};
    uint8_t bytes[WORD_BYTES];
    hm2_put_le32(bytes, address);
    (void)lbp16_add_write(builder, &command, bytes, NULL);
}

/* Reading the address register ends whatever the chip is doing (seed 000). */
static void add_echo(struct lbp16_builder *const builder, size_t *const at)
{
    const struct lbp16_command command = {
        .has_address = true, .space = LBP16_SPACE_FLASH, .size = LBP16_SIZE_32, .count = 1};
    (void)lbp16_add_read(builder, &command, at);
}

static void add_enable(struct lbp16_builder *const builder)
{
    const uint16_t key = WRITE_KEY;
    (void)lbp16_add_write16(builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_WRITE_ENABLE, 1, &key, NULL);
}

/* Data from the address register on; it counts by itself, so the increment bit stays clear. */
static void add_data_read(struct lbp16_builder *const builder, const size_t bytes, size_t *const at)
{
    size_t words = bytes / WORD_BYTES, *where = at;
    while (words > 0) {
        const unsigned count = words < LBP16_MAX_COUNT ? (unsigned)words : LBP16_MAX_COUNT;
        const struct lbp16_command command = {.has_address = true,
                                              .space = LBP16_SPACE_FLASH,
                                              .size = LBP16_SIZE_32,
                                              .count = count,
                                              .address = LBP16_FLASH_DATA};
        (void)lbp16_add_read(builder, &command, where);
        where = NULL;
        words -= count;
    }
}

static bool allowed(const struct flash_card *const card, const uint32_t address, const uint32_t bytes)
{
    const struct flash_range *const range = &card->writable;
    return address >= range->start && bytes <= range->bytes && address - range->start <= range->bytes - bytes;
}

static int outside(struct hm2_diag *const diag, const struct flash_card *const card, const uint32_t address)
{
    return hm2_diag_add(
        diag, HM2_ERR_RANGE, "0x%06X is outside the range 0x%06X to 0x%06X that was planned; nothing was sent",
        (unsigned)address, (unsigned)card->writable.start, (unsigned)(card->writable.start + card->writable.bytes));
}

int flash_erase(struct flash_card *const card, const uint32_t address, struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    const struct lbp16_command erase = {.write = true,
                                        .has_address = true,
                                        .space = LBP16_SPACE_FLASH,
                                        .size = LBP16_SIZE_32,
                                        .count = 1,
                                        .address = LBP16_FLASH_ERASE};
    size_t echo_at;
    if (address % FLASH_SECTOR_BYTES || !allowed(card, address, FLASH_SECTOR_BYTES))
        return outside(diag, card, address);
    flash_port_begin(port);
    add_enable(&port->builder);
    add_address(&port->builder, address);
    (void)lbp16_add_write(&port->builder, &erase, NULL, NULL);
    add_echo(&port->builder, &echo_at);
    const int err = flash_port_run(port, FLASH_WORK_ERASE, FLASH_TRIES);
    if (err < 0)
        return flash_lost(diag, err, "erasing a sector");
    const uint32_t echo = hm2_get_le32(port->reply + echo_at);
    if (echo != address)
        return hm2_diag_add(diag, HM2_ERR_IO, "the card erased at 0x%06X and not at 0x%06X as it was told",
                            (unsigned)echo, (unsigned)address);
    port->counters.erases++;
    return 0;
}

static bool all_erased(const uint8_t *const page)
{
    for (unsigned i = 0; i < FLASH_PAGE_BYTES; i++)
        if (page[i] != FLASH_ERASED)
            return false;
    return true;
}

static unsigned add_pages(struct flash_port *const port, const uint32_t address, const uint8_t *const bytes,
                          const unsigned pages)
{
    const struct lbp16_command data = {.write = true,
                                       .has_address = true,
                                       .space = LBP16_SPACE_FLASH,
                                       .size = LBP16_SIZE_32,
                                       .count = FLASH_PAGE_BYTES / WORD_BYTES,
                                       .address = LBP16_FLASH_DATA};
    unsigned written = 0;
    add_enable(&port->builder);
    for (unsigned i = 0; i < pages; i++) {
        if (all_erased(bytes + (size_t)i * FLASH_PAGE_BYTES))
            continue;
        add_address(&port->builder, address + i * FLASH_PAGE_BYTES);
        (void)lbp16_add_write(&port->builder, &data, bytes + (size_t)i * FLASH_PAGE_BYTES, NULL);
        written++;
    }
    return written;
}

int flash_program(struct flash_card *const card, const uint32_t address, const uint8_t *const bytes,
                  const unsigned pages, uint8_t *const back, struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    const uint32_t len = pages * FLASH_PAGE_BYTES;
    size_t data_at = 0, echo_at;
    if (address % FLASH_PAGE_BYTES || !allowed(card, address, len))
        return outside(diag, card, address);
    flash_port_begin(port);
    const unsigned written = add_pages(port, address, bytes, pages);
    add_echo(&port->builder, &echo_at);
    if (back) {
        add_address(&port->builder, address);
        add_data_read(&port->builder, len, &data_at);
    }
    const int err = flash_port_run(port, FLASH_WORK_PROGRAM, FLASH_TRIES);
    if (err < 0)
        return err; /* the caller may try with fewer pages */
    if (back)
        memcpy(back, port->reply + data_at, len);
    port->counters.pages += written;
    return 0;
}

/* A card that does not answer long requests may answer shorter ones. */
static bool read_less(struct flash_counters *const counters)
{
    if (counters->bytes_per_read <= FLASH_READ_LEAST)
        return false;
    counters->bytes_per_read =
        counters->bytes_per_read > 4 * FLASH_READ_LEAST ? 4 * FLASH_READ_LEAST : FLASH_READ_LEAST;
    return true;
}

int flash_read_some(struct flash_card *const card, const uint32_t address, uint8_t *const bytes, size_t *const count,
                    struct hm2_diag *const diag)
{
    struct flash_port *const port = &card->port;
    int err;
    size_t at = 0, len;
    do {
        const size_t most = port->counters.bytes_per_read;
        len = *count < most ? *count : most;
        flash_port_begin(port);
        add_address(&port->builder, address);
        add_data_read(&port->builder, len + (WORD_BYTES - 1), &at);
        err = flash_port_run(port, FLASH_WORK_READ, most > FLASH_READ_LEAST ? FLASH_TRIES / 2 : FLASH_TRIES);
    } while (err == HM2_ERR_TIMEOUT && read_less(&port->counters));
    if (err < 0)
        return flash_lost(diag, err, "reading the flash");
    memcpy(bytes, port->reply + at, len);
    *count = len;
    port->counters.bytes_read += len;
    return 0;
}

/* The next request of a batch that reads so many bytes altogether. */
static int send_part(struct flash_card *const card, struct flash_batch *const batch, const uint32_t address,
                     const size_t count, size_t *const data_at)
{
    struct flash_port *const port = &card->port;
    const size_t most = port->counters.bytes_per_read, done = batch->sent * most;
    flash_port_begin(port);
    add_address(&port->builder, address + (uint32_t)done);
    add_data_read(&port->builder, (count - done < most ? count - done : most) + (WORD_BYTES - 1), data_at);
    return flash_batch_send(port, batch);
}

/* Whole batch, or what of it came before the first gap. */
static size_t read_batch(struct flash_card *const card, const uint32_t address, uint8_t *const bytes,
                         const size_t count)
{
    struct flash_port *const port = &card->port;
    const size_t most = port->counters.bytes_per_read;
    const unsigned parts = (unsigned)((count + most - 1) / most);
    struct flash_batch batch;
    size_t data_at = 0; /* the same in all answers */
    int which = 0;
    flash_batch_begin(port, &batch);
    while (batch.answered < parts && which >= 0) {
        while (batch.sent < parts && batch.sent - batch.answered < port->counters.requests_ahead && which >= 0)
            which = send_part(card, &batch, address, count, &data_at);
        if (which >= 0)
            which = flash_batch_receive(port, &batch);
        if (which < 0)
            break;
        const size_t at = (unsigned)which * most;
        memcpy(bytes + at, port->reply + data_at, count - at < most ? count - at : most);
    }
    flash_batch_end(port, &batch);
    unsigned whole = 0;
    while (whole < parts && batch.part[whole].answered)
        whole++;
    return whole == parts ? count : whole * most;
}

int flash_read_ahead(struct flash_card *const card, const uint32_t address, uint8_t *const bytes, size_t *const count,
                     struct hm2_diag *const diag)
{
    struct flash_counters *const counters = &card->port.counters;
    const size_t most = (size_t)FLASH_BATCH_MOST * counters->bytes_per_read;
    const size_t wanted = *count < most ? *count : most;
    if (counters->requests_ahead <= 1 || wanted <= counters->bytes_per_read)
        return flash_read_some(card, address, bytes, count, diag);
    const size_t got = read_batch(card, address, bytes, wanted);
    if (got < wanted)
        counters->requests_ahead = 1;
    else if (counters->requests_ahead < FLASH_AHEAD_MOST)
        counters->requests_ahead++;
    if (got == 0)
        return flash_read_some(card, address, bytes, count, diag);
    counters->bytes_read += got;
    *count = got;
    return 0;
}

int flash_card_read(struct flash_card *const card, uint32_t address, uint8_t *bytes, size_t count,
                    struct hm2_diag *const diag)
{
    while (count > 0) {
        size_t part = count;
        const int err = flash_read_some(card, address, bytes, &part, diag);
        if (err < 0)
            return err;
        address += (uint32_t)part;
        bytes += part;
        count -= part;
    }
    return 0;
}
