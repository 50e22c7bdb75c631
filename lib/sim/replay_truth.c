/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * truth.csv of an ioport folder: what one pin with a pull-up outside shows for every setting of its port bits and of
 * the module output behind it (step generator 0, output 0, in table mode).
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"

#define PAD         24u /* SVST4_4_48: first pad of port 1 carries step generator 0, output 0 */
#define TABLE_DEPTH 16u
#define MODE_TABLE  3u

enum { ALTDATA, ALTSRC, INVERT, OPENDRAIN, DDR, OUTREG, INPUTS };

struct truth_row {
    uint32_t bits[INPUTS];
    char pin;
    uint32_t read;
};

static int parse_row(const struct replay_csv *const csv, struct truth_row *const row, struct hm2_diag *const diag)
{
    static const char *const names[INPUTS + 2] = {"altdata", "altsrc", "invert", "opendrain",
                                                  "ddr",     "outreg", "pin",    "port_read_bit"};
    const char *fields[INPUTS + 2];
    bool valid = true;
    for (unsigned i = 0; i < INPUTS + 2; i++) {
        const int column = replay_csv_need(csv, names[i], diag);
        if (column < 0)
            return column;
        fields[i] = csv->field[column];
        valid = valid && strlen(fields[i]) == 1;
    }
    for (unsigned i = 0; i < INPUTS && valid; i++)
        valid = replay_hex32(fields[i], &row->bits[i]) == 0 && row->bits[i] <= 1;
    row->pin = fields[INPUTS][0];
    if (!valid || !strchr("01HZ", row->pin) || replay_hex32(fields[INPUTS + 1], &row->read) || row->read > 1)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "truth.csv line %u: a field is not 0, 1 or (pin) H.", csv->line);
    return 0;
}

static int64_t set_up(struct sim_card *const card, const struct truth_row *const row)
{
    static const struct {
        unsigned input;
        uint16_t address;
    } ports[] = {{OUTREG, 0x1004}, {DDR, 0x1104}, {ALTSRC, 0x1204}, {OPENDRAIN, 0x1304}, {INVERT, 0x1404}};
    int64_t clk = 10;
    sim_card_write(card, clk++, 0x2200, MODE_TABLE);
    for (unsigned i = 0; i < TABLE_DEPTH; i++)
        sim_card_write(card, clk++, 0x2700, row->bits[ALTDATA]);
    for (unsigned i = 0; i < sizeof(ports) / sizeof(ports[0]); i++)
        sim_card_write(card, clk++, ports[i].address, row->bits[ports[i].input]);
    return clk + 10;
}

static int play_row(const struct replay_kind *const kind, const struct truth_row *const row, char *const difference,
                    struct hm2_diag *const diag)
{
    struct hm2_image image;
    struct sim_card *card = NULL;
    if (!replay_firmware(kind->firmware, &image))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "No firmware image %s.", kind->firmware);
    const struct sim_card_options options = {.profile = kind->profile, .image = &image};
    const int err = sim_card_new(&card, &options, diag);
    if (err)
        return err;
    const int64_t clk = set_up(card, row);
    sim_card_advance(card, clk);
    const enum sim_level level = sim_card_pad(card, PAD);
    const char pin = level == SIM_LOW ? '0' : level == SIM_HIGH ? '1' : 'H';
    const uint32_t read = sim_card_read(card, clk, 0x1004, NULL) & 1u;
    if (pin != row->pin)
        snprintf(difference, REPLAY_TEXT, "clk %lld: pin expected %c, got %c", (long long)clk, row->pin, pin);
    else if (read != row->read)
        snprintf(difference, REPLAY_TEXT, "clk %lld: port_read_bit expected %u, got %u", (long long)clk,
                 (unsigned)row->read, (unsigned)read);
    sim_card_free(card);
    return 0;
}

int replay_pin_truth(const struct replay_kind *const kind, const struct replay_files *const files,
                     const struct replay_options *const options, struct replay_totals *const totals,
                     struct hm2_diag *const diag)
{
    char *text = NULL;
    size_t len = 0;
    struct replay_csv csv;
    int err = files->load(files->context, "truth.csv", &text, &len, diag);
    if (err)
        return err == HM2_ERR_NOTFOUND ? 0 : err;
    err = replay_csv_open(&csv, "truth.csv", text, len, diag);
    while (!err) {
        const int got = replay_csv_row(&csv, diag);
        if (got <= 0) {
            err = got;
            break;
        }
        struct truth_row row;
        char name[40], difference[REPLAY_TEXT] = "";
        err = parse_row(&csv, &row, diag);
        snprintf(name, sizeof(name), "truth_%03u", csv.line);
        if (err || !replay_wanted(options, name))
            continue;
        err = play_row(kind, &row, difference, diag);
        if (!err)
            replay_report(options, totals, name, difference);
    }
    free(text);
    return err;
}
