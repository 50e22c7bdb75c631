/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The tram folder: byte accesses on an EPP bus, one row each. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay.h"
#include "replay_csv.h"
#include "replay_trace.h"
#include "tram.h"

#define ADDRESS_BITS 0x7FFFu
#define COUNT_UP     0x8000u /* of an address */
#define MAX_ADDRESS  0xFFFFu
#define FIRST_CLK    100

enum { COL_TEST, COL_SEQ, COL_EV, COL_ADDR, COL_BYTES, COLUMNS };
static const char *const columns[COLUMNS] = {"test", "seq", "ev", "addr", "bytes"};

struct playing {
    struct sim_card *card;
    struct sim_tram tram;
    char test[64]; /* "" = none yet */
    bool wanted;
    char difference[REPLAY_TEXT]; /* the first one */
};

static int begin_test(struct playing *const p, const char *const test, const struct replay_kind *const kind,
                      const struct replay_options *const options, struct hm2_diag *const diag)
{
    struct hm2_image image;
    if (!replay_firmware(kind->firmware, &image))
        return HM2_ERR_NOTFOUND;
    const struct sim_card_options card = {.profile = kind->profile, .image = &image};
    sim_card_free(p->card);
    const int err = sim_card_new(&p->card, &card, diag);
    p->tram = (struct sim_tram){.card = p->card, .clk = FIRST_CLK};
    p->difference[0] = '\0';
    p->wanted = replay_wanted(options, test);
    (void)snprintf(p->test, sizeof p->test, "%s", test);
    return err;
}

static void end_test(const struct playing *const p, const struct replay_options *const options,
                     struct replay_totals *const totals)
{
    if (p->test[0] && p->wanted)
        replay_report(options, totals, p->test, p->difference);
}

static void compare(struct playing *const p, const char *const seq, const char *const expected, const uint16_t address)
{
    uint8_t undriven;
    char got[3] = "XX";
    const uint8_t byte = sim_tram_read(&p->tram, address, &undriven);
    if (!undriven)
        (void)snprintf(got, sizeof got, "%02X", byte);
    if (!p->difference[0] && strncmp(expected, got, 2) != 0)
        (void)snprintf(p->difference, sizeof p->difference, "access %.16s, address %04X: expected %.2s, got %s", seq,
                       address, expected, got);
}

/* Bit 15 of an address makes it count up. The table leaves it out where all do: of the reads only those of the test
 * "autoincrement" have their addresses as they were on the bus. */
static bool counts_up(const struct playing *const p, const bool write, const uint32_t address)
{
    return write || strcmp(p->test, "autoincrement") != 0 || (address & COUNT_UP);
}

static int play_row(struct playing *const p, const struct replay_csv *const csv, const int column[COLUMNS],
                    struct hm2_diag *const diag)
{
    const char *const bytes = csv->field[column[COL_BYTES]];
    const bool write = strcmp(csv->field[column[COL_EV]], "W") == 0;
    uint32_t address, byte = 0;
    int err = replay_hex32(csv->field[column[COL_ADDR]], &address);
    if (err || address > MAX_ADDRESS || (!write && strcmp(csv->field[column[COL_EV]], "R") != 0))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: expected W or R and an address of 16 bits.",
                            csv->file, csv->line);
    const bool up = counts_up(p, write, address);
    for (const char *at = bytes; *at; at += at[2] ? 3 : 2) {
        char text[3] = "";
        (void)snprintf(text, sizeof text, "%.2s", at);
        err = strcmp(text, "XX") == 0 && !write ? 0 : replay_hex32(text, &byte);
        if (err || strlen(text) != 2 || (at[2] != ' ' && at[2] != '\0'))
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: expected bytes as \"0A XX\" between blanks.",
                                csv->file, csv->line);
        if (write)
            sim_tram_write(&p->tram, address & ADDRESS_BITS, (uint8_t)byte);
        else
            compare(p, csv->field[column[COL_SEQ]], text, address & ADDRESS_BITS);
        address += up;
    }
    return 0;
}

static int play_rows(struct playing *const p, struct replay_csv *const csv, const struct replay_kind *const kind,
                     const struct replay_options *const options, struct replay_totals *const totals,
                     struct hm2_diag *const diag)
{
    int column[COLUMNS], got = 0;
    for (unsigned i = 0; i < COLUMNS; i++) {
        column[i] = replay_csv_need(csv, columns[i], diag);
        if (column[i] < 0)
            return column[i];
    }
    while ((got = replay_csv_row(csv, diag)) > 0) {
        const char *const test = csv->field[column[COL_TEST]];
        int err = 0;
        if (strncmp(test, p->test, sizeof p->test - 1) != 0) {
            end_test(p, options, totals);
            err = begin_test(p, test, kind, options, diag);
        }
        if (!err)
            err = play_row(p, csv, column, diag);
        if (err)
            return err;
    }
    if (got == 0)
        end_test(p, options, totals);
    return got;
}

int replay_tram(const struct replay_kind *const kind, const struct replay_files *const files,
                const struct replay_options *const options, struct replay_totals *const totals,
                struct hm2_diag *const diag)
{
    char *text = NULL;
    size_t len = 0;
    struct replay_csv csv;
    struct playing p = {.card = NULL};
    int err = files->load(files->context, "events.csv", &text, &len, diag);
    if (err == HM2_ERR_NOTFOUND)
        return hm2_diag_add(diag, err, "There is no events.csv in the folder.");
    if (!err)
        err = replay_csv_open(&csv, "events.csv", text, len, diag);
    if (!err)
        err = play_rows(&p, &csv, kind, options, totals, diag);
    sim_card_free(p.card);
    free(text);
    return err;
}
