/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From the text of a file to a map. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/modbus.h>

#include "elements.h"
#include "settings.h"

#define MAX_TRANSACTIONS 999

static void read_names(struct ini *const ini, struct hm2_modbus_map *const map)
{
    const struct ini_entry *const name = ini_find(ini, "MB2HAL_INIT", "HAL_MODULE_NAME");
    const struct ini_entry *const version = ini_find(ini, "MB2HAL_INIT", "VERSION");
    const char *const component = name ? name->value : "mb2hal";
    if (component[0] == '\0' || strlen(component) >= sizeof map->component || strpbrk(component, " \t"))
        (void)ini_problem(ini, HM2_ERR_INVALID, name ? name->line : 0,
                          "HAL_MODULE_NAME: expected a name of 1 to %zu characters without blanks",
                          sizeof map->component - 1);
    else
        memcpy(map->component, component, strlen(component) + 1);
    map->short_names = !version || strcmp(version->value, "1.0") == 0;
    if (version && !map->short_names && strcmp(version->value, "1.1") != 0)
        (void)ini_problem(ini, HM2_ERR_UNSUPPORTED, version->line, "VERSION: '%.20s' is neither 1.0 nor 1.1",
                          version->value);
}

static unsigned read_head(struct ini *const ini, struct hm2_modbus_map *const map)
{
    static const char head[] = "MB2HAL_INIT";
    double number = 0.0;
    read_names(ini, map);
    const struct ini_entry *const debug = ini_find(ini, head, "INIT_DEBUG");
    if (debug)
        (void)ini_number(ini, debug, debug->value, 0, 4, true, &number);
    const struct ini_entry *const slowdown = ini_find(ini, head, "SLOWDOWN");
    if (slowdown)
        (void)ini_number(ini, slowdown, slowdown->value, 0, 3600, false, &map->slowdown_s);
    const struct ini_entry *const total = ini_find(ini, head, "TOTAL_TRANSACTIONS");
    number = 0.0;
    if (!total)
        (void)ini_problem(ini, HM2_ERR_NOTFOUND, 0, "[MB2HAL_INIT] TOTAL_TRANSACTIONS is missing");
    else
        (void)ini_number(ini, total, total->value, 1, MAX_TRANSACTIONS, true, &number);
    return (unsigned)number;
}

static void require(struct ini *const ini, const char *const section, const char *const key, const bool given)
{
    if (!given)
        (void)ini_problem(ini, HM2_ERR_NOTFOUND, 0, "[%s] %s is missing", section, key);
}

static void check_settings(struct ini *const ini, const char *const section, const struct settings *const settings)
{
    const bool tcp = settings->link_type <= LINK_TCP;
    if (settings->link_type < 0) {
        require(ini, section, "LINK_TYPE", false);
        return;
    }
    require(ini, section, "TCP_IP", !tcp || settings->host[0]);
    require(ini, section, "SERIAL_PORT", tcp || settings->device[0]);
    require(ini, section, "SERIAL_BAUD", tcp || settings->baud >= 0);
    require(ini, section, "SERIAL_BITS", tcp || settings->data_bits >= 0);
    require(ini, section, "SERIAL_PARITY", tcp || settings->parity >= 0);
    require(ini, section, "SERIAL_STOP", tcp || settings->stop_bits >= 0);
    require(ini, section, "MB_SLAVE_ID", settings->unit >= 0);
    require(ini, section, "FIRST_ELEMENT", settings->first >= 0);
    require(ini, section, "MB_TX_CODE", settings->function >= 0);
    if (!tcp && settings->unit > 247)
        (void)ini_problem(ini, HM2_ERR_RANGE, 0, "[%s] MB_SLAVE_ID: on a serial line 247 is the highest", section);
}

static bool same_place(const struct hm2_modbus_link *const a, const struct hm2_modbus_link *const b)
{
    if (a->tcp != b->tcp)
        return false;
    return a->tcp ? a->port == b->port && strcmp(a->host, b->host) == 0 : strcmp(a->device, b->device) == 0;
}

static bool same_line(const struct hm2_modbus_link *const a, const struct hm2_modbus_link *const b)
{
    return a->tcp || (a->baud == b->baud && a->data_bits == b->data_bits && a->parity == b->parity &&
                      a->stop_bits == b->stop_bits && a->rs485 == b->rs485 && a->rts == b->rts);
}

/* The link of a transaction: one that an earlier one has already, or a new one. */
static unsigned find_link(struct ini *const ini, const char *const section, struct hm2_modbus_map *const map,
                          const struct settings *const s)
{
    struct hm2_modbus_link link = {.tcp = s->link_type <= LINK_TCP};
    if (link.tcp) {
        memcpy(link.host, s->host, sizeof link.host);
        link.port = (unsigned)s->port;
    } else {
        memcpy(link.device, s->device, sizeof link.device);
        link.baud = (unsigned)s->baud;
        link.data_bits = (unsigned)s->data_bits;
        link.stop_bits = (unsigned)s->stop_bits;
        link.parity = (char)s->parity;
        link.rs485 = s->rs485 > 0;
        link.rts = (enum hm2_modbus_rts)s->rts;
    }
    for (unsigned i = 0; i < map->link_count; i++) {
        if (!same_place(&map->links[i], &link))
            continue;
        if (!same_line(&map->links[i], &link))
            (void)ini_problem(ini, HM2_ERR_INVALID, 0, "[%s] %s has other settings in a transaction before", section,
                              link.device);
        return i;
    }
    map->links[map->link_count] = link;
    return map->link_count++;
}

/* Limits of the protocol's frames (specification chapter 6). */
static unsigned max_words(const enum hm2_modbus_function function)
{
    static const unsigned limits[] = {[HM2_MODBUS_READ_COILS] = 2000,
                                      [HM2_MODBUS_READ_DISCRETE_INPUTS] = 2000,
                                      [HM2_MODBUS_READ_HOLDING_REGISTERS] = 125,
                                      [HM2_MODBUS_READ_INPUT_REGISTERS] = 125,
                                      [HM2_MODBUS_WRITE_SINGLE_COIL] = 1,
                                      [HM2_MODBUS_WRITE_SINGLE_REGISTER] = 1,
                                      [HM2_MODBUS_WRITE_MULTIPLE_COILS] = 1968,
                                      [HM2_MODBUS_WRITE_MULTIPLE_REGISTERS] = 123};
    return limits[function];
}

static void check_extent(struct ini *const ini, const char *const section,
                         const struct hm2_modbus_transaction *const tx)
{
    if (tx->words > max_words(tx->function))
        (void)ini_problem(ini, HM2_ERR_RANGE, 0, "[%s] moves %u coils or registers; this MB_TX_CODE can move %u",
                          section, tx->words, max_words(tx->function));
    if (tx->first + tx->words > 65536)
        (void)ini_problem(ini, HM2_ERR_RANGE, 0, "[%s] goes beyond the last address, 65535", section);
}

static void check_names(struct ini *const ini, const char *const section, const struct hm2_modbus_map *const map,
                        const struct hm2_modbus_transaction *const tx)
{
    static const char *const ours[] = {"num_errors", "errors", "connected", "stale", "age", "enable"};
    for (const struct hm2_modbus_transaction *other = map->transactions; other < tx; other++)
        if (strcmp(other->name, tx->name) == 0)
            (void)ini_problem(ini, HM2_ERR_INVALID, 0, "[%s] HAL_TX_NAME: '%s' is another transaction's name, too",
                              section, tx->name);
    for (unsigned i = 0; map->short_names && i < tx->element_count; i++)
        for (size_t k = 0; k < sizeof ours / sizeof ours[0]; k++)
            if (strcmp(tx->elements[i].name, ours[k]) == 0)
                (void)ini_problem(ini, HM2_ERR_INVALID, 0,
                                  "[%s] PIN_NAMES: '%s' is a pin of every transaction; give it another name", section,
                                  ours[k]);
}

static void read_transaction(struct ini *const ini, const char *const section, struct hm2_modbus_map *const map,
                             const struct settings *const s)
{
    struct hm2_modbus_transaction *const tx = &map->transactions[map->transaction_count++];
    memcpy(tx->name, s->name, sizeof tx->name);
    tx->link = find_link(ini, section, map, s);
    tx->function = (enum hm2_modbus_function)s->function;
    tx->unit = (unsigned)s->unit;
    tx->first = (unsigned)s->first;
    tx->low_word_first = s->low_word_first > 0;
    tx->rate_hz = s->rate_hz;
    tx->response_timeout_ms = (unsigned)s->response_timeout_ms;
    tx->byte_timeout_ms = (unsigned)s->byte_timeout_ms;
    tx->delay_ms = map->links[tx->link].tcp ? 0 : (unsigned)s->delay_ms;
    tx->retries = (unsigned)s->retries;
    tx->on_change = s->on_change > 0;
    tx->refresh_s = s->refresh_s;
    tx->enable_pin = s->enable_pin > 0;
    elements_read(ini, section, s->count > 0 ? (unsigned)s->count : 0, tx);
    check_extent(ini, section, tx);
    check_names(ini, section, map, tx);
}

static void read_sections(struct ini *const ini, struct hm2_modbus_map *const map, const unsigned total)
{
    struct settings settings[2];
    for (unsigned i = 0; i < total && !ini->err; i++) {
        char section[24];
        (void)snprintf(section, sizeof section, "TRANSACTION_%02u", i);
        if (!ini_has_section(ini, section)) {
            (void)ini_problem(ini, HM2_ERR_NOTFOUND, 0, "[%s] is missing, TOTAL_TRANSACTIONS says %u", section, total);
            return;
        }
        settings_read(ini, section, i, i ? &settings[(i + 1) % 2] : NULL, &settings[i % 2]);
        check_settings(ini, section, &settings[i % 2]);
        if (!ini->err)
            read_transaction(ini, section, map, &settings[i % 2]);
    }
}

static int parse(struct ini *const ini, struct hm2_modbus_map *const map)
{
    const unsigned total = read_head(ini, map);
    if (ini->err)
        return ini->err;
    map->transactions = calloc(total, sizeof *map->transactions);
    map->links = calloc(total, sizeof *map->links);
    if (!map->transactions || !map->links)
        return ini_problem(ini, HM2_ERR_NOMEM, 0, "no memory for %u transactions", total);
    read_sections(ini, map, total);
    if (!ini->err)
        ini_warn_unused(ini);
    return ini->err;
}

int hm2_modbus_parse(const char *const text, const size_t length, const char *const file_name,
                     struct hm2_modbus_map **const map, struct hm2_diag *const diag)
{
    struct ini ini;
    *map = NULL;
    if (length > HM2_MODBUS_FILE_BYTES)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "%s: has more than %u bytes", file_name, HM2_MODBUS_FILE_BYTES);
    struct hm2_modbus_map *const made = calloc(1, sizeof *made);
    if (!made)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory", file_name);
    int err = ini_parse(&ini, text, length, file_name, diag);
    if (!err)
        err = parse(&ini, made);
    ini_free(&ini);
    if (err)
        hm2_modbus_free(made);
    else
        *map = made;
    return err;
}

void hm2_modbus_free(struct hm2_modbus_map *const map)
{
    if (!map)
        return;
    for (unsigned i = 0; map->transactions && i < map->transaction_count; i++)
        free(map->transactions[i].elements);
    free(map->transactions);
    free(map->links);
    free(map);
}
