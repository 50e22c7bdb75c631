/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Serial LBP: examples of the manual, every byte that the real firmware was recorded to send, framing, and a client
 * against scripted answers. */
#include "unit.h"

#include <hm2/lbp.h>

#include "hex.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define NS_PER_CLK   10
#define GAP_NS       16000 /* four characters at 2.5 Mbaud, as recorded */
#define OUTPUT_BYTES 9u

/* ---- codec ------------------------------------------------------------------------------------------------------- */

static const struct {
    const char *name;
    struct lbp_command command;
    uint8_t bytes[12];
    int len; /* without the CRC, which the manual does not print */
} examples[] = {
    {"write 4 bytes at 0x010, increment",
     {.code = LBP_DATA | LBP_WRITE | LBP_INCREMENT | LBP_ADDRESS | 2,
      .address = 0x010,
      .len = 4,
      .data = {0xAA, 0xBB, 0xCC, 0xDD}},
     {0x6E, 0x10, 0x00, 0xAA, 0xBB, 0xCC, 0xDD},
     7},
    {"write 2 more bytes", {.code = LBP_DATA | LBP_WRITE | 1, .len = 2, .data = {0xEE, 0xFF}}, {0x61, 0xEE, 0xFF}, 3},
    {"read 8 bytes at 0x010", {.code = LBP_DATA | LBP_ADDRESS | 3, .address = 0x010}, {0x47, 0x10, 0x00}, 3},
    {"RPC 5 with two bytes", {.code = LBP_RPC | 5, .len = 2, .data = {0x55, 0xCC}}, {0x85, 0x55, 0xCC}, 3},
    {"get cookie", {.code = LBP_GET_COOKIE}, {0xDF}, 1},
    {"clear status", {.code = LBP_SET_STATUS, .len = 1, .data = {0}}, {0xE1, 0x00}, 2},
    {"reset", {.code = LBP_RESET, .len = 1, .data = {LBP_COOKIE}}, {0xFE, 0x5A}, 2},
    {"reset parser", {.code = LBP_RESET_PARSER}, {0xFF}, 1},
};

static void the_examples_of_the_manual_are_encoded_as_printed(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(examples); i++) {
        uint8_t message[LBP_MESSAGE_BYTES];
        const int len = lbp_encode(&examples[i].command, message, sizeof message);
        if (len != examples[i].len + 1 || memcmp(message, examples[i].bytes, (size_t)examples[i].len) != 0 ||
            lbp_crc8(0, message, (size_t)len) != 0)
            fail_msg("%s: %d bytes", examples[i].name, len);
        assert_int_equal(lbp_encode(&examples[i].command, message, (size_t)len - 1), HM2_ERR_NOSPACE);
    }
}

static void what_no_remote_could_take_apart_is_not_encoded(void **state)
{
    static const struct lbp_command wrong[] = {
        {.code = 0x00},
        {.code = 0x3F},
        {.code = LBP_DATA | LBP_ADDRESS, .len = 1},
        {.code = LBP_DATA | LBP_WRITE | 2, .len = 3},
        {.code = LBP_SET_STATUS},
        {.code = LBP_GET_COOKIE, .len = 1},
        {.code = LBP_RESET_PARSER, .len = 1},
        {.code = LBP_RPC_PROCESS, .len = LBP_MAX_DATA + 1},
    };
    uint8_t message[LBP_MESSAGE_BYTES];
    (void)state;
    for (size_t i = 0; i < COUNT(wrong); i++)
        assert_int_equal(lbp_encode(&wrong[i], message, sizeof message), HM2_ERR_RANGE);
}

static void sizes_follow_from_the_code(void **state)
{
    (void)state;
    assert_int_equal(lbp_data_code(1), 0x44);
    assert_int_equal(lbp_data_code(2), 0x45);
    assert_int_equal(lbp_data_code(4), 0x46);
    assert_int_equal(lbp_data_code(8), 0x47);
    assert_int_equal(lbp_data_code(0), 0);
    assert_int_equal(lbp_data_code(3), 0);
    assert_int_equal(lbp_data_code(16), 0);
    assert_int_equal(lbp_returned_bytes(0x47), 8);
    assert_int_equal(lbp_returned_bytes(0x67), 0);
    assert_int_equal(lbp_sent_bytes(0x67), 10);
    assert_int_equal(lbp_sent_bytes(0x63), 8);
    assert_int_equal(lbp_returned_bytes(LBP_GET_STATUS), 1);
    assert_int_equal(lbp_returned_bytes(0x00), 0);
    assert_int_equal(lbp_gap_ns(40, 2500000), 16000);           /* the manual's 16 us */
    assert_in_range(lbp_gap_ns(255, 115200), 2100000, 2250000); /* and its 2.1 ms */
    assert_int_equal(lbp_gap_ns(255, 0), 0);
}

static void an_answer_is_judged_by_length_and_crc(void **state)
{
    static const uint8_t name[] = {0x37, 0x3D}, unit[] = {0x78, 0x56, 0x34, 0x12, 0x29}, nothing[] = {0}, bad[] = {1};
    (void)state;
    assert_int_equal(lbp_check_reply(name, 2, 1), 0);
    assert_int_equal(lbp_check_reply(unit, 5, 4), 0);
    assert_int_equal(lbp_check_reply(unit, 4, 4), HM2_ERR_MALFORMED);
    assert_int_equal(lbp_check_reply(unit, 5, 5), HM2_ERR_MALFORMED);
    assert_int_equal(lbp_check_reply(nothing, 1, 0), 0);
    assert_int_equal(lbp_check_reply(bad, 1, 0), HM2_ERR_MALFORMED);
    assert_int_equal(lbp_check_reply(nothing, 0, 0), HM2_ERR_MALFORMED);
}

/* ---- the recording ----------------------------------------------------------------------------------------------- */

/* Commands and answers in turn, from the recorded bytes. */
struct wire {
    struct lbp_parser parser;
    struct lbp_command command;
    uint8_t sent[LBP_MESSAGE_BYTES], answer[LBP_MESSAGE_BYTES];
    size_t sent_len, answer_len;
    unsigned commands, answers;
};

static size_t answer_bytes(const struct lbp_command *const command)
{
    static const struct {
        uint8_t code;
        size_t bytes;
    } rpcs[] = {{LBP_RPC_UNIT, 4}, {LBP_RPC_DISCOVERY, 6}, {LBP_RPC_PROCESS, OUTPUT_BYTES + 1}};
    for (size_t i = 0; i < COUNT(rpcs); i++)
        if (rpcs[i].code == command->code)
            return rpcs[i].bytes;
    return lbp_returned_bytes(command->code);
}

static void take_sent(struct wire *const wire, const uint8_t byte, const int64_t ns)
{
    uint8_t encoded[LBP_MESSAGE_BYTES];
    wire->sent[wire->sent_len++] = byte;
    const int taken = lbp_parser_take(&wire->parser, byte, ns, &wire->command);
    if (taken == 0)
        return;
    if (taken != 1)
        fail_msg("%d for byte %zu of 0x%02X at %lld ns", taken, wire->sent_len, wire->sent[0], (long long)ns);
    assert_int_equal(lbp_encode(&wire->command, encoded, sizeof encoded), wire->sent_len);
    assert_memory_equal(encoded, wire->sent, wire->sent_len);
    wire->commands++;
    wire->sent_len = wire->answer_len = 0;
}

static void take_answer(struct wire *const wire, const uint8_t byte)
{
    const size_t bytes = answer_bytes(&wire->command);
    wire->answer[wire->answer_len++] = byte;
    if (wire->answer_len <= bytes)
        return;
    if (lbp_check_reply(wire->answer, wire->answer_len, bytes) != 0)
        fail_msg("answer %u, to 0x%02X: %zu bytes, the last 0x%02X", wire->answers, wire->command.code,
                 wire->answer_len, byte);
    wire->answers++;
}

static void every_recorded_message_is_understood(void **state)
{
    static struct wire wire;
    char line[256], direction[16];
    long clk;
    unsigned byte;
    (void)state;
    FILE *const file = fopen(TEST_DATA "/lbp/wire.csv", "r");
    assert_non_null(file);
    lbp_parser_init(&wire.parser, GAP_NS);
    wire.parser.rpc_bytes[LBP_RPC_PROCESS % LBP_RPCS] = OUTPUT_BYTES;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "%ld,%15[^,],%x", &clk, direction, &byte) != 3)
            continue;
        if (strcmp(direction, "host>remote") == 0)
            take_sent(&wire, (uint8_t)byte, clk * NS_PER_CLK);
        else if (strcmp(direction, "remote>host") == 0)
            take_answer(&wire, (uint8_t)byte);
    }
    (void)fclose(file);
    assert_int_equal(wire.commands, 34);
    assert_int_equal(wire.answers, wire.commands);
}

/* ---- framing ------------------------------------------------------------------------------------------------------
 */

static struct lbp_parser parser;
static struct lbp_command got;

/* The last result of taking these bytes, 1 us each from at_ns on; all before it must be 0. */
static int feed(const char *const hex, const int64_t at_ns)
{
    uint8_t bytes[64];
    const size_t len = hex_bytes(hex, bytes, sizeof bytes);
    int result = 0;
    for (size_t i = 0; i < len; i++) {
        assert_int_equal(result, 0);
        result = lbp_parser_take(&parser, bytes[i], at_ns + 1000 * (int64_t)i, &got);
    }
    return result;
}

static void commands_may_follow_each_other_without_a_gap(void **state)
{
    (void)state;
    lbp_parser_init(&parser, GAP_NS);
    assert_int_equal(feed("DF 16", 0), 1);
    assert_int_equal(feed("64 00 06 A5 A4", 2000), 1);
    assert_int_equal(got.code, 0x64);
    assert_int_equal(got.address, 0x0600);
    assert_int_equal(got.len, 1);
    assert_int_equal(got.data[0], 0xA5);
}

static void a_gap_ends_a_broken_command(void **state)
{
    (void)state;
    lbp_parser_init(&parser, GAP_NS);
    assert_int_equal(feed("64 00", 0), 0);
    assert_int_equal(feed("DF", 100000), HM2_ERR_TIMEOUT);
    assert_int_equal(feed("16", 101000), 1);
    assert_int_equal(got.code, LBP_GET_COOKIE);
    assert_int_equal(feed("64", 200000), 0);
    assert_int_equal(feed("00", 200000 + GAP_NS), 0); /* just in time */
    assert_int_equal(feed("06 A5 A4", 200000 + GAP_NS + 1000), 1);
}

static void after_an_error_nothing_is_taken_before_a_gap(void **state)
{
    static const char *const errors[] = {"DF 17", "00", "3F", "BD"};
    (void)state;
    for (size_t i = 0; i < COUNT(errors); i++) {
        lbp_parser_init(&parser, GAP_NS);
        parser.rpc_bytes[LBP_RPC_PROCESS % LBP_RPCS] = LBP_MAX_DATA + 1;
        assert_int_equal(feed(errors[i], 100000), HM2_ERR_MALFORMED);
        assert_int_equal(feed("DF 16", 102000), 0);
        assert_int_equal(feed("DF 16", 104000 + 2 * GAP_NS), 1);
    }
}

/* ---- client -------------------------------------------------------------------------------------------------------
 */

static struct hm2_diag diag;
static struct link *mock;

static struct lbp_client client_of(const char *const script)
{
    struct lbp_client client;
    hm2_diag_clear(&diag);
    if (link_mock_script(&mock, script, &diag))
        fail_msg("%s", diag.text);
    lbp_client_init(&client, mock, "line", LBP_SETUP_BAUD, &diag);
    return client;
}

static void finish(void)
{
    if (link_mock_finish(mock, &diag))
        fail_msg("%s", diag.text);
    link_close(mock);
}

static void memory_is_read_and_written(void **state)
{
    (void)state;
    struct lbp_client client = client_of("> 45 00 02 B8\n< 80 02 93\n"
                                         "> 47 00 03 A9\n< A0 18 01 00\n< 00 00 00 00 07\n" /* in pieces */
                                         "> 64 00 06 A5 A4\n< 00\n");
    uint64_t value;
    assert_int_equal(lbp_client_read(&client, 0x0200, 2, &value), 0);
    assert_int_equal(value, 0x0280);
    assert_int_equal(lbp_client_read(&client, 0x0300, 8, &value), 0);
    assert_int_equal(value, 0x000118A0);
    assert_int_equal(lbp_client_write(&client, 0x0600, 1, 0xA5), 0);
    assert_int_equal(lbp_client_read(&client, 0x0600, 3, &value), HM2_ERR_RANGE);
    assert_int_equal(lbp_client_write(&client, 0x0600, 0, 0), HM2_ERR_RANGE);
    assert_int_equal(client.repeated, 0);
    finish();
}

static void what_failed_is_repeated_after_a_silence(void **state)
{
    (void)state;
    struct lbp_client client = client_of("> DF 16\n! lose\n< 5A A5\n"
                                         "> DF 16\n! garble 0\n< 5A A5\n"
                                         "> DF 16\n< 5A A5\n"
                                         "> C1 94\n! delay 260000000\n< 00 00\n" /* answers the first time too late */
                                         "> C1 94\n< 08 C2\n");
    uint8_t value;
    const uint8_t status[] = {0x08};
    assert_int_equal(lbp_crc8(0, status, 1), 0xC2);
    assert_int_equal(lbp_client_get(&client, LBP_GET_COOKIE, &value), 0);
    assert_int_equal(value, LBP_COOKIE);
    assert_int_equal(client.repeated, 2);
    client.gap_ns = 20000000;
    assert_int_equal(lbp_client_get(&client, LBP_GET_STATUS, &value), 0);
    assert_int_equal(value, LBP_STATUS_WATCHDOG);
    finish();
}

static void failure_is_told_after_three_tries(void **state)
{
    (void)state;
    struct lbp_client client = client_of("> DF 16\n> DF 16\n> DF 16\n> 44 00 03 4D\n< A0 AE\n> 44 00 03 4D\n"
                                         "> 44 00 03 4D\n< A0 AE\n> DF 16\n< 00 00\n");
    uint8_t value;
    uint64_t wide;
    struct lbp_identity identity;
    assert_int_equal(lbp_client_get(&client, LBP_GET_COOKIE, &value), HM2_ERR_TIMEOUT);
    assert_non_null(strstr(diag.text, "line: LBP command 0xDF: no remote answers"));
    hm2_diag_clear(&diag);
    assert_int_equal(lbp_client_read(&client, 0x0300, 1, &wide), HM2_ERR_MALFORMED);
    assert_non_null(strstr(diag.text, "at address 0x0300: the CRC"));
    hm2_diag_clear(&diag);
    assert_int_equal(lbp_client_identify(&client, 0, &identity), HM2_ERR_MISMATCH);
    assert_non_null(strstr(diag.text, "cookie 0x00 found"));
    finish();
}

static void a_command_that_moves_the_pointer_is_not_repeated(void **state)
{
    (void)state;
    struct lbp_client client = client_of("> 4C 00 03 68\n! lose\n< A0 AF\n");
    const struct lbp_command command = {.code = 0x4C, .address = 0x0300};
    uint8_t reply[8], message[LBP_MESSAGE_BYTES];
    assert_int_equal(lbp_encode(&command, message, sizeof message), 4);
    assert_int_equal(message[3], 0x68);
    assert_int_equal(lbp_client_exchange(&client, &command, reply, 1), HM2_ERR_TIMEOUT);
    assert_int_equal(client.repeated, 0);
    finish();
}

static void a_remote_is_identified_as_the_recorded_master_does_it(void **state)
{
    (void)state;
    struct lbp_client client = client_of("> DF 16\n< 5A A5\n> EB FF 63\n< 00\n> E1 00 B1\n< 00\n> C1 94\n< 00 00\n"
                                         "> BC 91\n< 78 56 34 12 29\n> D0 57\n< 37 3D\n> D1 09\n< 49 DA\n"
                                         "> D2 EB\n< 39 22\n> D3 B5\n< 30 BE\n> E6 00 DF\n< 00\n"
                                         "> BB 12\n< 0A 09 00 02 20 02 0E\n");
    struct lbp_identity identity;
    if (lbp_client_identify(&client, 0, &identity))
        fail_msg("%s", diag.text);
    assert_int_equal(identity.unit, 0x12345678);
    assert_string_equal(identity.name, "7I90");
    assert_int_equal(identity.in_bytes, 10);
    assert_int_equal(identity.out_bytes, 9);
    assert_int_equal(identity.ptoc, 0x0200);
    assert_int_equal(identity.gtoc, 0x0220);
    finish();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_examples_of_the_manual_are_encoded_as_printed),
        cmocka_unit_test(what_no_remote_could_take_apart_is_not_encoded),
        cmocka_unit_test(sizes_follow_from_the_code),
        cmocka_unit_test(an_answer_is_judged_by_length_and_crc),
        cmocka_unit_test(every_recorded_message_is_understood),
        cmocka_unit_test(commands_may_follow_each_other_without_a_gap),
        cmocka_unit_test(a_gap_ends_a_broken_command),
        cmocka_unit_test(after_an_error_nothing_is_taken_before_a_gap),
        cmocka_unit_test(memory_is_read_and_written),
        cmocka_unit_test(what_failed_is_repeated_after_a_silence),
        cmocka_unit_test(failure_is_told_after_three_tries),
        cmocka_unit_test(a_command_that_moves_the_pointer_is_not_repeated),
        cmocka_unit_test(a_remote_is_identified_as_the_recorded_master_does_it),
    };
    return cmocka_run_group_tests_name("lbp", tests, NULL, NULL);
}
