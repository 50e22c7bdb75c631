/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

struct word {
    const char *text;
    double value;
};

static const struct word link_types[] = {{"tcp", LINK_TCP}, {"serial", LINK_SERIAL}, {NULL, 0}};
static const struct word parities[] = {{"none", 'N'}, {"even", 'E'}, {"odd", 'O'}, {NULL, 0}};
static const struct word rts_words[] = {
    {"none", HM2_MODBUS_RTS_NONE}, {"up", HM2_MODBUS_RTS_UP}, {"down", HM2_MODBUS_RTS_DOWN}, {NULL, 0}};
static const struct word orders[] = {{"high-first", 0}, {"low-first", 1}, {NULL, 0}};
static const struct word write_modes[] = {{"always", 0}, {"change", 1}, {NULL, 0}};
static const struct word functions[] = {{"fnct_01_read_coils", HM2_MODBUS_READ_COILS},
                                        {"fnct_02_read_discrete_inputs", HM2_MODBUS_READ_DISCRETE_INPUTS},
                                        {"fnct_03_read_holding_registers", HM2_MODBUS_READ_HOLDING_REGISTERS},
                                        {"fnct_04_read_input_registers", HM2_MODBUS_READ_INPUT_REGISTERS},
                                        {"fnct_05_write_single_coil", HM2_MODBUS_WRITE_SINGLE_COIL},
                                        {"fnct_06_write_single_register", HM2_MODBUS_WRITE_SINGLE_REGISTER},
                                        {"fnct_15_write_multiple_coils", HM2_MODBUS_WRITE_MULTIPLE_COILS},
                                        {"fnct_16_write_multiple_registers", HM2_MODBUS_WRITE_MULTIPLE_REGISTERS},
                                        {NULL, 0}};

enum kind { INTEGER, REAL, WORD, TEXT };

struct key {
    const char *name;
    enum kind kind;
    size_t offset; /* in struct settings */
    double min, max;
    const struct word *words;
    size_t size; /* of a text, with its end */
};

#define AT(field) offsetof(struct settings, field)

#define MS_MAX 3600000.0

static const struct key keys[] = {
    {"TCP_IP", TEXT, AT(host), 0, 0, NULL, 64},
    {"TCP_PORT", INTEGER, AT(port), 1, 65535, NULL, 0},
    {"SERIAL_PORT", TEXT, AT(device), 0, 0, NULL, 128},
    {"SERIAL_BAUD", INTEGER, AT(baud), 50, 4000000, NULL, 0},
    {"SERIAL_BITS", INTEGER, AT(data_bits), 5, 8, NULL, 0},
    {"SERIAL_PARITY", WORD, AT(parity), 0, 0, parities, 0},
    {"SERIAL_STOP", INTEGER, AT(stop_bits), 1, 2, NULL, 0},
    {"SERIAL_DELAY_MS", INTEGER, AT(delay_ms), 0, MS_MAX, NULL, 0},
    {"SERIAL_RS485", INTEGER, AT(rs485), 0, 1, NULL, 0},
    {"SERIAL_RTS", WORD, AT(rts), 0, 0, rts_words, 0},
    {"MB_SLAVE_ID", INTEGER, AT(unit), 0, 255, NULL, 0},
    {"MAX_UPDATE_RATE", REAL, AT(rate_hz), 0, 1e6, NULL, 0},
    {"MB_RESPONSE_TIMEOUT_MS", INTEGER, AT(response_timeout_ms), 1, MS_MAX, NULL, 0},
    {"MB_BYTE_TIMEOUT_MS", INTEGER, AT(byte_timeout_ms), 0, MS_MAX, NULL, 0},
    {"DEBUG", INTEGER, AT(debug), 0, 4, NULL, 0},
    {"RETRIES", INTEGER, AT(retries), 0, 100, NULL, 0},
    {"WORD_ORDER", WORD, AT(low_word_first), 0, 0, orders, 0},
    {"WRITE_MODE", WORD, AT(on_change), 0, 0, write_modes, 0},
    {"REFRESH_S", REAL, AT(refresh_s), 0, 1e6, NULL, 0},
    {"FIRST_ELEMENT", INTEGER, AT(first), 0, 65535, NULL, 0},
    {"NELEMENTS", INTEGER, AT(count), 1, HM2_MODBUS_MAX_COILS, NULL, 0},
    {"MB_TX_CODE", WORD, AT(function), 0, 0, functions, 0},
    {"ENABLE_PIN", INTEGER, AT(enable_pin), 0, 1, NULL, 0},
    {"HAL_TX_NAME", TEXT, AT(name), 0, 0, NULL, 29}, /* 28 characters: mb2hal's limit */
};

static const struct key link_type_key = {"LINK_TYPE", WORD, AT(link_type), 0, 0, link_types, 0};

static void read_word(struct ini *const ini, const struct ini_entry *const entry, const struct word *const words,
                      double *const value)
{
    char known[300];
    size_t length = 0;
    for (const struct word *word = words; word->text; word++) {
        if (strcasecmp(word->text, entry->value) == 0) {
            *value = word->value;
            return;
        }
        length += (size_t)snprintf(known + length, sizeof known - length, "%s%s", length ? ", " : "", word->text);
    }
    (void)ini_problem(ini, HM2_ERR_INVALID, entry->line, "%s: '%.40s' is none of %s", entry->name, entry->value, known);
}

static void read_text(struct ini *const ini, const struct ini_entry *const entry, const size_t size, char *const text)
{
    const size_t length = strlen(entry->value);
    if (length == 0 || length >= size)
        (void)ini_problem(ini, HM2_ERR_RANGE, entry->line, "%s: has %zu characters, expected 1 to %zu", entry->name,
                          length, size - 1);
    else if (strpbrk(entry->value, " \t"))
        (void)ini_problem(ini, HM2_ERR_INVALID, entry->line, "%s: '%.40s' has a blank in it", entry->name,
                          entry->value);
    else
        memcpy(text, entry->value, length + 1);
}

static void read_key(struct ini *const ini, const char *const section, const struct key *const key,
                     struct settings *const settings)
{
    const struct ini_entry *const entry = ini_find(ini, section, key->name);
    void *const field = (char *)settings + key->offset;
    if (!entry)
        return;
    switch (key->kind) {
    case INTEGER:
    case REAL:
        (void)ini_number(ini, entry, entry->value, key->min, key->max, key->kind == INTEGER, field);
        break;
    case WORD:
        read_word(ini, entry, key->words, field);
        break;
    case TEXT:
        read_text(ini, entry, key->size, field);
        break;
    }
}

static const struct settings defaults = {.link_type = NOT_GIVEN,
                                         .port = 502,
                                         .baud = NOT_GIVEN,
                                         .data_bits = NOT_GIVEN,
                                         .parity = NOT_GIVEN,
                                         .stop_bits = NOT_GIVEN,
                                         .unit = NOT_GIVEN,
                                         .response_timeout_ms = 500,
                                         .byte_timeout_ms = 500,
                                         .debug = 1};

void settings_read(struct ini *const ini, const char *const section, const unsigned number,
                   const struct settings *const before, struct settings *const settings)
{
    *settings = before ? *before : defaults;
    read_key(ini, section, &link_type_key, settings);
    if (before && settings->link_type - before->link_type != 0.0) {
        const double link_type = settings->link_type;
        *settings = defaults;
        settings->link_type = link_type;
    }
    settings->first = settings->count = settings->function = NOT_GIVEN;
    settings->enable_pin = 0.0;
    (void)snprintf(settings->name, sizeof settings->name, "%02u", number);
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        read_key(ini, section, &keys[i], settings);
}
