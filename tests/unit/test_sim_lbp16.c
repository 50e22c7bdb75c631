/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The simulated LBP16 firmware against the recorded exchanges of the real one (tests/data/lbp16), and what they do
 * not cover. */
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>
#include <hm2/sim.h>
#include <hm2/sim_flash.h>

#include "hex.h"
#include "replay_csv.h"

#define US               1000
#define HEADER_BYTES     42u
#define MAX_FRAME        1600u
#define EXCHANGE_STEP_NS 100000

static const uint8_t recorded_mac[6] = {0x00, 0x60, 0x1B, 0x12, 0x34, 0x56};
static const uint8_t client_mac[6] = {0x02, 0x00, 0x00, 0x00, 0x00, 0x01};

/* The card of the recording: its EEPROM and flash models, and an undriven bus that the simulator showed as 0. */
static struct sim_card *recorded_card(void)
{
    struct sim_card_options options = {.profile = "7i80hd-16", .bus = SIM_BUS_ZEROS};
    memcpy(options.mac, recorded_mac, sizeof options.mac);
    struct sim_card *card = NULL;
    struct hm2_diag diag = {0};
    if (sim_card_new(&card, &options, &diag))
        fail_msg("%s", diag.text);
    size_t size;
    uint8_t *const flash = sim_card_flash(card, &size);
    for (size_t i = 0; i < size; i++)
        flash[i] = (uint8_t)(i ^ i >> 8);
    return card;
}

static struct sim_card *card_of(const char *const profile)
{
    const struct sim_card_options options = {.profile = profile, .seed = 7};
    struct sim_card *card = NULL;
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    return card;
}

/* ---- frames around the recorded payloads --------------------------------------------------------------------------
 */

struct flow {
    unsigned source_port, destination_port;
    uint8_t destination_ip[4];
};

static void put_be16(uint8_t *const p, const unsigned value)
{
    p[0] = (uint8_t)(value >> 8);
    p[1] = (uint8_t)value;
}

static size_t udp_frame(uint8_t *const frame, const struct flow *const flow, const uint8_t *const payload,
                        const size_t len)
{
    static const uint8_t client_ip[4] = {192, 168, 1, 1};
    memset(frame, 0, MAX_FRAME);
    memcpy(frame, recorded_mac, 6);
    memcpy(frame + 6, client_mac, 6);
    put_be16(frame + 12, 0x0800);
    put_be16(frame + 14, 0x4500);
    put_be16(frame + 16, (unsigned)len + 28);
    put_be16(frame + 22, 0x4011);
    memcpy(frame + 26, client_ip, 4);
    memcpy(frame + 30, flow->destination_ip, 4);
    put_be16(frame + 34, flow->source_port);
    put_be16(frame + 36, flow->destination_port);
    put_be16(frame + 38, (unsigned)len + 8);
    memcpy(frame + HEADER_BYTES, payload, len);
    return len + HEADER_BYTES < 60 ? 60 : len + HEADER_BYTES;
}

/* Source port, destination port and address of an exchange, where its description names one. */
static struct flow flow_of(const char *const description)
{
    struct flow flow = {27181, 27181, {192, 168, 1, 121}};
    unsigned a, b;
    if (sscanf(description, "source port %u", &a) == 1)
        flow.source_port = a;
    if (sscanf(description, "destination port %u", &a) == 1)
        flow.destination_port = a;
    if (sscanf(description, "destination IP 192.168.%u.%u", &a, &b) == 2) {
        flow.destination_ip[2] = (uint8_t)a;
        flow.destination_ip[3] = (uint8_t)b;
    }
    return flow;
}

static bool is_time(const struct lbp16_command *const c, const unsigned at)
{
    if (c->info)
        return false;
    if (c->space == LBP16_SPACE_TIMER)
        return at < LBP16_TIMER_WAIT_US || (at >= LBP16_TIMER_WAIT_REF && at < LBP16_TIMER_SCRATCH);
    return c->space == LBP16_SPACE_INFO && at >= LBP16_INFO_RECV_START;
}

/* Zero the words of a reply that depend on when the packet came (stamps of spaces 4 and 7, measured waits). */
static void mask_times(const uint8_t *const request, const size_t len, uint8_t *reply)
{
    struct lbp16_parser parser;
    struct lbp16_command c;
    const uint8_t *data;
    size_t data_len;
    bool cut;
    lbp16_parser_init(&parser, request, len);
    while (lbp16_parser_next(&parser, &c, &data, &data_len, &cut) == 1) {
        if (c.write)
            continue;
        for (unsigned i = 0; i < c.count; i++, reply += lbp16_item_bytes(c.size))
            if (is_time(&c, c.address + (c.increment ? 2 * i : 0)))
                memset(reply, 0, 2);
    }
}

/* ---- the recorded session -----------------------------------------------------------------------------------------
 */

struct row {
    const char *number, *kind, *description;
    uint8_t request[MAX_FRAME], expected[MAX_FRAME];
    size_t request_len, expected_len;
    double reply_us;
    unsigned reply_port;
};

struct answer {
    uint8_t frame[MAX_FRAME];
    size_t len;
    double us;
};

static void send_row(struct sim_card *const card, const struct row *const row, const int64_t now_ns,
                     struct answer *const answer)
{
    uint8_t frame[MAX_FRAME];
    size_t len = row->request_len;
    if (strcmp(row->kind, "udp") == 0) {
        const struct flow flow = flow_of(row->description);
        len = udp_frame(frame, &flow, row->request, row->request_len);
    } else {
        memcpy(frame, row->request, len);
    }
    int64_t reply_ns = now_ns;
    answer->len = sim_card_frame(card, now_ns, frame, len, answer->frame, sizeof answer->frame, &reply_ns);
    answer->us = (double)(reply_ns - now_ns) / US;
}

static void check_row(const struct row *const row, struct answer *const answer)
{
    const bool udp = strcmp(row->kind, "udp") == 0;
    const size_t headers = udp && answer->len > 0 ? HEADER_BYTES : 0;
    uint8_t expected[MAX_FRAME];
    if (answer->len - headers != row->expected_len)
        fail_msg("exchange %s (%s): %zu bytes, recorded %zu", row->number, row->description, answer->len - headers,
                 row->expected_len);
    if (answer->len == 0)
        return;
    memcpy(expected, row->expected, row->expected_len);
    if (udp) {
        assert_int_equal(answer->frame[36] << 8 | answer->frame[37], row->reply_port);
        mask_times(row->request, row->request_len, expected);
        mask_times(row->request, row->request_len, answer->frame + headers);
    }
    for (size_t i = 0; i < row->expected_len; i++)
        if (answer->frame[headers + i] != expected[i])
            fail_msg("exchange %s (%s): byte %zu is %02x, recorded %02x", row->number, row->description, i,
                     answer->frame[headers + i], expected[i]);
    /* Times depend on where in its polling loop a packet meets the processor. */
    const double tolerance = 0.5 + 0.02 * row->reply_us;
    if (answer->us < row->reply_us - tolerance || answer->us > row->reply_us + tolerance)
        fail_msg("exchange %s (%s): answered after %.2f us, recorded %.2f us", row->number, row->description,
                 answer->us, row->reply_us);
}

static char *load(const char *const path, size_t *const len)
{
    FILE *const file = fopen(path, "rb");
    assert_non_null(file);
    char *const text = malloc(1 << 20);
    assert_non_null(text);
    *len = fread(text, 1, (1 << 20) - 1, file);
    fclose(file);
    return text;
}

static void read_row(const struct replay_csv *const csv, struct row *const row)
{
    row->number = csv->field[0];
    row->kind = csv->field[1];
    row->description = csv->field[2];
    row->request_len = hex_bytes(csv->field[3], row->request, sizeof row->request);
    row->expected_len = hex_bytes(csv->field[4], row->expected, sizeof row->expected);
    row->reply_us = strtod(csv->field[5], NULL);
    row->reply_port = (unsigned)strtoul(csv->field[6], NULL, 10);
}

static void every_recorded_exchange_is_reproduced_in_order(void **state)
{
    (void)state;
    size_t len;
    char *const text = load(TEST_DATA "/lbp16/exchanges.csv", &len);
    struct replay_csv csv;
    struct hm2_diag diag = {0};
    assert_int_equal(replay_csv_open(&csv, "exchanges.csv", text, len, &diag), 0);
    struct sim_card *const card = recorded_card();
    static struct row row;
    static struct answer answer;
    unsigned rows = 0;
    for (int64_t now_ns = 0; replay_csv_row(&csv, &diag) == 1; now_ns += 20 * EXCHANGE_STEP_NS, rows++) {
        read_row(&csv, &row);
        send_row(card, &row, now_ns, &answer);
        check_row(&row, &answer);
    }
    assert_int_equal(rows, 102);
    sim_card_free(card);
    free(text);
}

/* ---- beyond the recording -----------------------------------------------------------------------------------------
 */

/* Send hex, expect hex ("" = no reply). */
static void exchange_at(struct sim_card *const card, const int64_t now_ns, const char *const request,
                        const char *const expected)
{
    uint8_t out[MAX_FRAME], in[MAX_FRAME], want[MAX_FRAME];
    const size_t out_len = hex_bytes(request, out, sizeof out);
    const size_t want_len = hex_bytes(expected, want, sizeof want);
    const size_t in_len = sim_card_packet(card, now_ns, out, out_len, in, sizeof in, NULL);
    if (in_len != want_len)
        fail_msg("%s: reply of %zu bytes instead of %zu", request, in_len, want_len);
    assert_memory_equal(in, want, want_len);
}

static void exchange(struct sim_card *const card, const char *const request, const char *const expected)
{
    exchange_at(card, 0, request, expected);
}

static void a_card_says_its_name_and_shows_its_idrom(void **state)
{
    (void)state;
    struct sim_card *card = card_of("7i96s");
    exchange(card, "01420001", "FECAAA55");
    exchange(card, "885D0000", "37493936530000000000000000000000");
    exchange(card, "014E0800", "14000000");
    exchange(card, "0542 0C04", "4D455341 4D455341 4D455341 4D455341 4D455341");
    exchange(card, "8242 0C04", "4D455341 37493936");
    sim_card_free(card);
    card = card_of("7i93");
    exchange(card, "885D0000", "37493933000000000000000000000000");
    exchange(card, "8242 0C04", "4D455341 37493933");
    sim_card_free(card);
}

static void registers_that_nobody_drives_rest_as_the_fpga_family_does(void **state)
{
    (void)state;
    struct sim_card *card = card_of("7i96s");
    exchange(card, "01420060", "00000000");
    sim_card_free(card);
    card = card_of("7i93");
    exchange(card, "01420060", "FFFFFFFF");
    sim_card_free(card);
}

static void eeprom_settings_survive_a_power_cycle_and_scratch_does_not(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    exchange(card, "01D91A00025A 82C92000 0705A8C0", "");
    exchange(card, "01D91800 3412 01591800", "3412");
    sim_card_power_cycle(card);
    exchange(card, "01591800", ""); /* still configuring */
    exchange_at(card, 2000000000, "01591800", "0000");
    exchange_at(card, 2000000000, "82492000", "0705A8C0");
    sim_card_free(card);
}

static void a_reset_makes_the_card_deaf_for_half_a_second(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i93");
    exchange(card, "01D91800 3412", "");
    exchange(card, "01D91C000100", "");
    exchange_at(card, 400000000, "01420001", "");
    exchange_at(card, 600000000, "01420001 01591800", "FECAAA55 0000");
    sim_card_free(card);
}

static void a_reload_through_the_icap_reconfigures_the_fpga(void **state)
{
    (void)state;
    struct sim_card *card = card_of("7i93");                  /* Spartan-6 words: flash tool reference 3.13 */
    exchange(card, "01C20008 01000000 01420008", "01000000"); /* IDROM write enable */
    exchange(card,
             "01D91E00FFFF 01D91E00FFFF 01D91E0099AA 01D91E006655 01D91E006132 01D91E000000 01D91E008132"
             "01D91E00000B 01D91E00A130 01D91E000E00 01D91E000020",
             "");
    exchange_at(card, 500000000, "01420001", "");
    exchange_at(card, 2000000000, "01420008", "00000000");
    sim_card_free(card);
    card = card_of("7i96s");
    exchange(card, "01D91E000500", "");
    exchange(card, "01420001", "FECAAA55");
    exchange(card, "01D91E000D00", "");
    exchange_at(card, 500000000, "01420001", "");
    exchange_at(card, 2000000000, "01420001", "FECAAA55");
    sim_card_free(card);
}

static void flash_pages_are_erased_written_and_read_as_the_manual_shows(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    exchange(card, "01D91A00035A 01CE000000001000 01CE0C0000000000 014E0000", "00001000");
    exchange(card, "01D91A00035A 01CE000000001000 02CE0400 12345678 ABCD8888 014E0000", "08001000");
    exchange(card, "01CE000000001000 034E0400", "12345678 ABCD8888 FFFFFFFF");
    /* bits only go from 1 to 0 */
    exchange(card, "01D91A00035A 01CE000000001000 01CE0400 F0F0F0F0 014E0000", "04001000");
    exchange(card, "01CE000000001000 014E0400", "10305070");
    exchange(card, "01CE000000001000 01CE0400 00000000 014E0000", ""); /* no write enable */
    exchange(card, "01CE000000001000 014E0400", "10305070");
    sim_card_free(card);
}

/* Seed 000, "FLASH MEMORY REGISTERS": what starts the write of a page that has been sent. */
static void a_page_is_written_when_anything_else_is_done_with_the_flash(void **state)
{
    static const struct {
        const char *what, *reply;
    } rows[] = {
        {"01CE000000000000", ""},         /* write the address */
        {"014E0000", "04001000"},         /* read it */
        {"014E0400", "FFFFFFFF"},         /* read data, which come from behind the page's */
        {"014E0800", "14000000"},         /* read the ID */
        {"01CE0C0000000000", "FFFFFFFF"}, /* erase the sector, the new page with it */
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_card *const card = card_of("7i96s");
        const bool erases = i == sizeof rows / sizeof rows[0] - 1;
        char request[128];
        snprintf(request, sizeof request, "01D91A00035A 01CE000000001000 01CE0400 12345678 %s", rows[i].what);
        exchange(card, request, erases ? "" : rows[i].reply);
        assert_int_equal(sim_card_flash_counts(card).programs, 1);
        assert_int_equal(sim_card_flash_counts(card).erases, erases);
        exchange(card, "01CE000000001000 014E0400", erases ? rows[i].reply : "12345678");
        sim_card_free(card);
    }
}

static void the_key_to_the_flash_is_gone_with_its_datagram(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    exchange(card, "01D91A00035A 01591A00", "035A");
    exchange(card, "01591A00", "0000");
    exchange(card, "01CE000000001000 01CE0C0000000000 014E0000", "");
    assert_int_equal(sim_card_flash_counts(card).operations, 0);
    sim_card_free(card);
}

static void addresses_of_the_flash_wrap_at_its_end(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    exchange(card, "01D91A00035A 01CE000000001F00 01CE0400 12345678 014E0000", "04001F00");
    exchange(card, "01CE000000003F00 014E0400", "12345678");
    exchange(card, "01D91A00035A 01CE000000003F00 01CE0C0000000000 014E0000", "00003F00");
    exchange(card, "01CE000000001F00 014E0400", "FFFFFFFF");
    assert_int_equal(sim_card_flash_counts(card).last_erase, 0x1F0000);
    sim_card_free(card);
}

static void a_page_write_wraps_within_its_page(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    exchange(card, "01D91A00035A 01CE0000FC001000 02CE0400 11111111 22222222 014E0000", "04011000");
    exchange(card, "01CE000000001000 014E0400", "22222222");
    exchange(card, "01CE0000FC001000 024E0400", "11111111 FFFFFFFF");
    sim_card_free(card);
}

static void a_truncated_write_takes_what_the_memory_holds(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    /* Four scratch words announced, one sent: the padding of a short frame is zero. */
    exchange(card, "84D91000 01000200 03000400 84591000", "0100 0200 0300 0400");
    exchange(card, "84D91000 0900", "");
    exchange(card, "84591000", "0900 0000 0000 0000");
    sim_card_free(card);
}

static void a_card_that_is_busy_takes_the_next_packet_afterwards(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    uint8_t request[8], reply[8];
    const size_t len = hex_bytes("01D10200E803", request, sizeof request); /* wait 1000 us */
    int64_t first_ns = 0, second_ns = 0;
    assert_int_equal(sim_card_packet(card, 0, request, len, reply, sizeof reply, &first_ns), 0);
    hex_bytes("01420001", request, sizeof request);
    assert_int_equal(sim_card_packet(card, 5000, request, 4, reply, sizeof reply, &second_ns), 4);
    assert_in_range(first_ns, 990 * US, 1010 * US);
    assert_in_range(second_ns, first_ns + 10 * US, first_ns + 14 * US);
    sim_card_free(card);
}

/* A DPLL at about 1 kHz: 2^42 / baserate * prescale clocks (register map 3.15). */
static void a_wait_for_the_dpll_ends_at_its_edge(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    uint8_t request[32], reply[8];
    int64_t reply_ns = 0;
    const int64_t period_ns = INT64_C(1000000);
    exchange(card, "01C20072 00000001", "");
    exchange(card, "01C20070 77BEA702", ""); /* 44547703: 2^42 / it = 98728 clocks, 0.987 ms */
    exchange(card, "01D90000 0000", "");
    const size_t len = hex_bytes("01D10400 D007 01510600 01590000", request, sizeof request); /* 2000 us at most */
    int64_t ends[4];
    for (unsigned i = 0; i < 4; i++) {
        const int64_t now_ns = 10 * period_ns + i * 2 * period_ns;
        assert_int_equal(sim_card_packet(card, now_ns, request, len, reply, sizeof reply, &reply_ns), 4);
        assert_int_equal(hm2_get_le16(reply + 2), 0); /* no time-out */
        ends[i] = reply_ns;
        const int64_t took_us = (reply_ns - now_ns) / US;
        assert_in_range(hm2_get_le16(reply), took_us > 20 ? took_us - 20 : 0, took_us);
        assert_in_range(took_us, 5, 1020);
    }
    for (unsigned i = 1; i < 4; i++) {
        const int64_t gap_ns = ends[i] - ends[i - 1];
        const int64_t periods = (gap_ns + 493640) / 987280;
        assert_in_range(gap_ns - periods * 987280 + 2000, 0, 4000);
    }
    sim_card_free(card);
}

static void a_udp_length_that_lies_ends_the_packet_early(void **state)
{
    (void)state;
    struct sim_card *const card = recorded_card();
    const struct flow flow = {5000, 27181, {192, 168, 1, 121}};
    uint8_t frame[MAX_FRAME], reply[MAX_FRAME], payload[8];
    hex_bytes("01420001 01420401", payload, sizeof payload);
    for (unsigned length = 0; length < 8; length++) {
        const size_t len = udp_frame(frame, &flow, payload, sizeof payload);
        put_be16(frame + 38, length);
        assert_int_equal(sim_card_frame(card, 0, frame, len, reply, sizeof reply, NULL), HEADER_BYTES + 4);
    }
    sim_card_free(card);
}

static void error_counters_stop_at_their_end(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    exchange(card, "01D90200FEFF", "");
    exchange(card, "0000", "");
    exchange(card, "01590200", "FFFF");
    exchange(card, "0000", "");
    exchange(card, "01590200", "FFFF");
    sim_card_free(card);
}

static void hostile_packets_are_survived(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i93");
    uint8_t request[2048], reply[64];
    uint32_t random = 1;
    for (unsigned round = 0; round < 20000; round++) {
        for (size_t i = 0; i < sizeof request; i++) {
            random = random * 1664525u + 1013904223u;
            request[i] = (uint8_t)(random >> 24);
        }
        request[1] &= 0xEFu; /* few packets that only wait */
        const size_t bytes = sim_card_packet(card, 0, request, round % sizeof request, reply, sizeof reply, NULL);
        assert_true(bytes <= sizeof reply);
    }
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_exchange_is_reproduced_in_order),
        cmocka_unit_test(a_card_says_its_name_and_shows_its_idrom),
        cmocka_unit_test(registers_that_nobody_drives_rest_as_the_fpga_family_does),
        cmocka_unit_test(eeprom_settings_survive_a_power_cycle_and_scratch_does_not),
        cmocka_unit_test(a_reset_makes_the_card_deaf_for_half_a_second),
        cmocka_unit_test(a_reload_through_the_icap_reconfigures_the_fpga),
        cmocka_unit_test(flash_pages_are_erased_written_and_read_as_the_manual_shows),
        cmocka_unit_test(a_page_is_written_when_anything_else_is_done_with_the_flash),
        cmocka_unit_test(the_key_to_the_flash_is_gone_with_its_datagram),
        cmocka_unit_test(addresses_of_the_flash_wrap_at_its_end),
        cmocka_unit_test(a_page_write_wraps_within_its_page),
        cmocka_unit_test(a_truncated_write_takes_what_the_memory_holds),
        cmocka_unit_test(a_card_that_is_busy_takes_the_next_packet_afterwards),
        cmocka_unit_test(a_wait_for_the_dpll_ends_at_its_edge),
        cmocka_unit_test(a_udp_length_that_lies_ends_the_packet_early),
        cmocka_unit_test(error_counters_stop_at_their_end),
        cmocka_unit_test(hostile_packets_are_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
