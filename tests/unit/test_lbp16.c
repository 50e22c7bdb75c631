/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * LBP16 against every example of the 7I96S manual (seed 000) and the 7I93 manual (seed 001) and against the recorded
 * exchanges of the real firmware (tests/data/lbp16).
 *
 * Misprints of the manuals, corrected here: "AAAAAAAAA" and "BBBBBBBBB" have nine digits; "01CE00000000100" lacks one
 * (sector 0x00010000); 001 prints "01CE00000C00000" where 000 has the full "01CE000000C00000", and "Ispace 4 read NN21"
 * where the structure of the command word (and 000's own pattern) gives NN31.
 */
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>

#include "hex.h"

/* Space and item size that belong together. */
#define HM2    .space = LBP16_SPACE_HM2, .size = LBP16_SIZE_32
#define CHIP   .space = LBP16_SPACE_ETHERNET, .size = LBP16_SIZE_16
#define EEPROM .space = LBP16_SPACE_EEPROM, .size = LBP16_SIZE_16
#define FLASH  .space = LBP16_SPACE_FLASH, .size = LBP16_SIZE_32
#define TIMER  .space = LBP16_SPACE_TIMER, .size = LBP16_SIZE_16
#define CTRL   .space = LBP16_SPACE_CONTROL, .size = LBP16_SIZE_16
#define CARD   .space = LBP16_SPACE_INFO, .size = LBP16_SIZE_16

#define READ(where, inc, n)                     \
    {                                           \
        where, .increment = (inc), .count = (n) \
    }
#define READ_AT(where, inc, n, at)                                                    \
    {                                                                                 \
        where, .increment = (inc), .count = (n), .has_address = true, .address = (at) \
    }
#define WRITE_AT(where, inc, n, at)                                                                  \
    {                                                                                                \
        where, .increment = (inc), .count = (n), .has_address = true, .address = (at), .write = true \
    }

/* ---- the tables of codes: "Space 0 read with address NN42LLHH" ---------------------------------------------------*/

struct code {
    const char *manual; /* high byte of the command word, as printed */
    enum lbp16_space space;
    enum lbp16_size size;
    bool info, write, address;
};

static const struct code codes[] = {
    {"61", .space = LBP16_SPACE_HM2, .size = LBP16_SIZE_16, .info = true, .address = true},
    {"21", .space = LBP16_SPACE_HM2, .size = LBP16_SIZE_16, .info = true},
    {"65", .space = LBP16_SPACE_ETHERNET, .size = LBP16_SIZE_16, .info = true, .address = true},
    {"25", .space = LBP16_SPACE_ETHERNET, .size = LBP16_SIZE_16, .info = true},
    {"69", .space = LBP16_SPACE_EEPROM, .size = LBP16_SIZE_16, .info = true, .address = true},
    {"29", .space = LBP16_SPACE_EEPROM, .size = LBP16_SIZE_16, .info = true},
    {"6D", .space = LBP16_SPACE_FLASH, .size = LBP16_SIZE_16, .info = true, .address = true},
    {"2D", .space = LBP16_SPACE_FLASH, .size = LBP16_SIZE_16, .info = true},
    {"71", TIMER, .info = true, .address = true},
    {"31", TIMER, .info = true},
    {"79", .space = LBP16_SPACE_CONTROL, .size = LBP16_SIZE_16, .info = true, .address = true},
    {"39", .space = LBP16_SPACE_CONTROL, .size = LBP16_SIZE_16, .info = true},
    {"7D", CARD, .info = true, .address = true},
    {"3D", CARD, .info = true},
    {"42", HM2, .address = true},
    {"C2", HM2, .write = true, .address = true},
    {"02", HM2},
    {"82", HM2, .write = true},
    {"45", CHIP, .address = true},
    {"C5", CHIP, .write = true, .address = true},
    {"05", CHIP},
    {"85", CHIP, .write = true},
    {"49", EEPROM, .address = true},
    {"C9", EEPROM, .write = true, .address = true},
    {"09", EEPROM},
    {"89", EEPROM, .write = true},
    {"4E", FLASH, .address = true},
    {"CE", FLASH, .write = true, .address = true},
    {"0E", FLASH},
    {"8E", FLASH, .write = true},
    {"51", TIMER, .address = true},
    {"D1", TIMER, .write = true, .address = true},
    {"11", TIMER},
    {"91", TIMER, .write = true},
    {"59", CTRL, .address = true},
    {"D9", CTRL, .write = true, .address = true},
    {"19", CTRL},
    {"99", CTRL, .write = true},
    {"5D", CARD, .address = true},
    {"1D", CARD},
};

static void every_command_code_of_the_manuals_is_encoded_and_decoded(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        const struct code *const code = &codes[i];
        uint8_t high;
        assert_int_equal(hex_bytes(code->manual, &high, 1), 1);
        for (unsigned nn = 1; nn < 256; nn++) {
            if ((nn & 0x7Fu) == 0)
                continue;
            const struct lbp16_command command = {.write = code->write,
                                                  .has_address = code->address,
                                                  .info = code->info,
                                                  .increment = nn >= 0x80u,
                                                  .space = code->space,
                                                  .size = code->size,
                                                  .count = nn & 0x7Fu};
            const uint16_t expected = (uint16_t)((unsigned)high << 8 | nn);
            uint16_t word = 0;
            struct lbp16_command decoded;
            assert_int_equal(lbp16_encode(&command, &word), 0);
            assert_int_equal(word, expected);
            assert_int_equal(lbp16_decode(expected, &decoded), 0);
            assert_int_equal(decoded.space, command.space);
            assert_int_equal(decoded.size, command.size);
            assert_int_equal(decoded.info, command.info);
            assert_int_equal(decoded.write, command.write);
            assert_int_equal(decoded.has_address, command.has_address);
            assert_int_equal(decoded.increment, command.increment);
            assert_int_equal(decoded.count, command.count);
        }
    }
}

static void every_command_word_survives_a_round_trip_and_count_zero_is_refused(void **state)
{
    (void)state;
    for (unsigned word = 0; word <= 0xFFFFu; word++) {
        struct lbp16_command command;
        uint16_t again = 0;
        if ((word & 0x7Fu) == 0) {
            assert_int_equal(lbp16_decode((uint16_t)word, &command), HM2_ERR_MALFORMED);
            continue;
        }
        assert_int_equal(lbp16_decode((uint16_t)word, &command), 0);
        assert_int_equal(lbp16_encode(&command, &again), 0);
        assert_int_equal(again, word);
    }
}

static void fields_outside_their_width_are_refused(void **state)
{
    (void)state;
    static const unsigned bad_counts[] = {0, 128, 255, 0x10000u, UINT32_MAX};
    uint16_t word = 0xBEEF;
    struct lbp16_command command = READ(HM2, true, 1);
    for (size_t i = 0; i < sizeof bad_counts / sizeof bad_counts[0]; i++) {
        command.count = bad_counts[i];
        assert_int_equal(lbp16_encode(&command, &word), HM2_ERR_RANGE);
    }
    command.count = 127;
    assert_int_equal(lbp16_encode(&command, &word), 0);
    command.space = (enum lbp16_space)8;
    assert_int_equal(lbp16_encode(&command, &word), HM2_ERR_RANGE);
    command.space = LBP16_SPACE_HM2;
    command.size = (enum lbp16_size)4;
    assert_int_equal(lbp16_encode(&command, &word), HM2_ERR_RANGE);
}

/* ---- whole examples ----------------------------------------------------------------------------------------------*/

struct step {
    struct lbp16_command command;
    const char *data; /* of a write, as it stands in the packet */
};

struct example {
    const char *title, *hex;
    struct step steps[6];
    unsigned count;
};

#define PAGE_START                                                                                                 \
    "12345678 ABCD8888 00000001 00000002 00000003 00000004 00000005 00000006 00000007 00000008 00000009 0000000A " \
    "0000000B 0000000C 0000000D 0000000E "
#define PAGE_MIDDLE                                                                                                \
    "A5A5A5A5 5A5A5A5A 00FF00FF FF00FF00 0F0F0F0F F0F0F0F0 33333333 CCCCCCCC 01234567 89ABCDEF 76543210 FEDCBA98 " \
    "11111111 22222222 44444444 88888888 "
#define PAGE_END                                                                                                   \
    "00000010 00000020 00000030 00000040 00000050 00000060 00000070 00000080 00000090 000000A0 000000B0 000000C0 " \
    "000000D0 000000E0 000000F0 FFFFFFFF "
#define PAGE PAGE_START PAGE_MIDDLE PAGE_MIDDLE PAGE_END

static const struct example examples[] = {
    {"000, 001: read first 5 entries of the IDROM", "85420004", {{READ_AT(HM2, true, 5, 0x0400), NULL}}, 1},
    {"000: write 4 GPIO ports at 0x1000",
     "84C20010 AAAAAAAA BBBBBBBB CCCCCCCC DDDDDDDD",
     {{WRITE_AT(HM2, true, 4, 0x1000), "AAAAAAAA BBBBBBBB CCCCCCCC DDDDDDDD"}},
     1},
    {"001: write 3 GPIO ports at 0x1000",
     "83C20010 AAAAAAAA BBBBBBBB CCCCCCCC",
     {{WRITE_AT(HM2, true, 3, 0x1000), "AAAAAAAA BBBBBBBB CCCCCCCC"}},
     1},
    {"000, 001: read Ethernet chip CIDER register", "0145C000", {{READ_AT(CHIP, false, 1, 0x00C0), NULL}}, 1},
    {"000, 001: write EEPROM IP address 192.168.0.32",
     "01D91A00025A 82C920002000A8C0",
     {{WRITE_AT(CTRL, false, 1, LBP16_CONTROL_WRITE_ENABLE), "025A"},
      {WRITE_AT(EEPROM, true, 2, LBP16_EEPROM_IP), "2000A8C0"}},
     2},
    {"000, 001: read 1024 bytes of flash at 0x123456",
     "01CE000056341200 404E0400 400E 400E 400E",
     {{WRITE_AT(FLASH, false, 1, LBP16_FLASH_ADDRESS), "56341200"},
      {READ_AT(FLASH, false, 64, LBP16_FLASH_DATA), NULL},
      {READ(FLASH, false, 64), NULL},
      {READ(FLASH, false, 64), NULL},
      {READ(FLASH, false, 64), NULL}},
     5},
    {"000, 001: write a 256 byte page of flash at 0xC000",
     "01D91A00035A 01CE000000C00000 40CE0400" PAGE "014E0000",
     {{WRITE_AT(CTRL, false, 1, LBP16_CONTROL_WRITE_ENABLE), "035A"},
      {WRITE_AT(FLASH, false, 1, LBP16_FLASH_ADDRESS), "00C00000"},
      {WRITE_AT(FLASH, false, 64, LBP16_FLASH_DATA), PAGE},
      {READ_AT(FLASH, false, 1, LBP16_FLASH_ADDRESS), NULL}},
     4},
    {"000, 001: erase flash sector 0x00010000",
     "01D91A00035A 01CE000000000100 01CE0C0000000000 014E0000",
     {{WRITE_AT(CTRL, false, 1, LBP16_CONTROL_WRITE_ENABLE), "035A"},
      {WRITE_AT(FLASH, false, 1, LBP16_FLASH_ADDRESS), "00000100"},
      {WRITE_AT(FLASH, false, 1, LBP16_FLASH_ERASE), "00000000"},
      {READ_AT(FLASH, false, 1, LBP16_FLASH_ADDRESS), NULL}},
     4},
    {"000, 001: ELBPCOM, read hostmot2 cookie", "01420001", {{READ_AT(HM2, false, 1, 0x0100), NULL}}, 1},
    {"000, 001: ELBPCOM, read EEPROM IP address", "82492000", {{READ_AT(EEPROM, true, 2, LBP16_EEPROM_IP), NULL}}, 1},
    {"000, 001: ELBPCOM, write EEPROM IP address 192.168.0.1",
     "01D91A00025A 82C920000100a8c0",
     {{WRITE_AT(CTRL, false, 1, LBP16_CONTROL_WRITE_ENABLE), "025A"},
      {WRITE_AT(EEPROM, true, 2, LBP16_EEPROM_IP), "0100a8c0"}},
     2},
};

static void every_example_of_the_manuals_is_built_byte_for_byte(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof examples / sizeof examples[0]; i++) {
        const struct example *const example = &examples[i];
        uint8_t golden[LBP16_MAX_REQUEST_BYTES], built[LBP16_MAX_REQUEST_BYTES], data[512];
        const size_t len = hex_bytes(example->hex, golden, sizeof golden);
        struct lbp16_builder builder;
        size_t reads = 0;
        lbp16_builder_init(&builder, built, sizeof built);
        for (unsigned s = 0; s < example->count; s++) {
            const struct step *const step = &example->steps[s];
            size_t offset = SIZE_MAX;
            if (step->command.write) {
                assert_int_equal(hex_bytes(step->data, data, sizeof data), lbp16_data_bytes(&step->command));
                assert_int_equal(lbp16_add_write(&builder, &step->command, data, &offset), 0);
                assert_memory_equal(built + offset, data, lbp16_data_bytes(&step->command));
            } else {
                assert_int_equal(lbp16_add_read(&builder, &step->command, &offset), 0);
                assert_int_equal(offset, reads);
                reads += lbp16_data_bytes(&step->command);
            }
        }
        if (builder.used != len || memcmp(built, golden, len) != 0)
            fail_msg("%s: %zu bytes built, %zu expected, or other bytes", example->title, builder.used, len);
        assert_int_equal(builder.reply_bytes, reads);
    }
}

static void every_example_of_the_manuals_is_parsed_into_its_commands(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof examples / sizeof examples[0]; i++) {
        const struct example *const example = &examples[i];
        uint8_t golden[LBP16_MAX_REQUEST_BYTES], data[512];
        struct lbp16_parser parser;
        struct lbp16_command command;
        const uint8_t *payload;
        size_t payload_len;
        bool truncated;
        lbp16_parser_init(&parser, golden, hex_bytes(example->hex, golden, sizeof golden));
        for (unsigned s = 0; s < example->count; s++) {
            const struct lbp16_command *const expected = &example->steps[s].command;
            assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 1);
            assert_false(truncated);
            assert_int_equal(command.write, expected->write);
            assert_int_equal(command.has_address, expected->has_address);
            assert_int_equal(command.increment, expected->increment);
            assert_int_equal(command.space, expected->space);
            assert_int_equal(command.size, expected->size);
            assert_int_equal(command.count, expected->count);
            assert_int_equal(command.address, expected->address);
            if (expected->write) {
                assert_int_equal(payload_len, hex_bytes(example->steps[s].data, data, sizeof data));
                assert_memory_equal(payload, data, payload_len);
            } else {
                assert_null(payload);
                assert_int_equal(payload_len, 0);
            }
        }
        assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 0);
    }
}

static void replies_of_the_sample_run_are_little_endian(void **state)
{
    (void)state;
    uint8_t reply[4];
    hex_bytes("fecaaa55", reply, sizeof reply);
    assert_int_equal(hm2_get_le32(reply), 0x55AACAFEu);
    hex_bytes("450a5863", reply, sizeof reply);
    assert_int_equal(hm2_get_le16(reply), 0x0A45);     /* low word: 10.69 */
    assert_int_equal(hm2_get_le16(reply + 2), 0x6358); /* high word: 99.88 */
}

/* ---- the builder's limits ----------------------------------------------------------------------------------------*/

static void short_forms_build_the_documented_commands(void **state)
{
    (void)state;
    uint8_t built[128], golden[128];
    struct lbp16_builder builder;
    const uint16_t values[] = {0x1234, 0x5678};
    size_t offset;
    lbp16_builder_init(&builder, built, sizeof built);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0x3000, 2, &offset), 0);
    assert_int_equal(offset, 0);
    assert_int_equal(lbp16_add_write_hm2(&builder, 0x1000, 1, NULL, &offset), 0);
    assert_int_equal(offset, 8);
    assert_int_equal(lbp16_add_read16(&builder, LBP16_SPACE_CONTROL, 0x000A, 1, &offset), 0);
    assert_int_equal(offset, 8);
    assert_int_equal(lbp16_add_write16(&builder, LBP16_SPACE_TIMER, 0x0010, 2, values, &offset), 0);
    assert_int_equal(offset, 20);
    assert_int_equal(lbp16_add_read_info(&builder, LBP16_SPACE_FLASH, &offset), 0);
    assert_int_equal(offset, 10);
    const size_t len = hex_bytes("82420030 81C2001000000000 81590A00 82D1100034127856 886D0000", golden, sizeof golden);
    assert_int_equal(builder.used, len);
    assert_memory_equal(built, golden, len);
    assert_int_equal(builder.reply_bytes, 8 + 2 + 16);
}

static void the_first_error_of_a_builder_sticks_and_appends_nothing(void **state)
{
    (void)state;
    uint8_t built[8];
    struct lbp16_builder builder;
    size_t offset = 77;
    lbp16_builder_init(&builder, built, sizeof built);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0x0100, 1, NULL), 0);
    assert_int_equal(lbp16_add_write_hm2(&builder, 0x0100, 1, NULL, &offset), HM2_ERR_NOSPACE);
    assert_int_equal(offset, 77);
    assert_int_equal(builder.used, 4);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0x0100, 1, &offset), HM2_ERR_NOSPACE);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0x0100, 0, NULL), HM2_ERR_NOSPACE);
    assert_int_equal(builder.error, HM2_ERR_NOSPACE);
    assert_int_equal(offset, 77);
    assert_int_equal(builder.used, 4);
    assert_int_equal(builder.reply_bytes, 4);
}

static void counts_outside_1_to_127_are_refused_by_every_builder_call(void **state)
{
    (void)state;
    static const unsigned counts[] = {0, 128, 1000000, UINT32_MAX};
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        uint8_t built[LBP16_MAX_REQUEST_BYTES];
        struct lbp16_builder builder;
        lbp16_builder_init(&builder, built, sizeof built);
        assert_int_equal(lbp16_add_read_hm2(&builder, 0, counts[i], NULL), HM2_ERR_RANGE);
        lbp16_builder_init(&builder, built, sizeof built);
        assert_int_equal(lbp16_add_write_hm2(&builder, 0, counts[i], NULL, NULL), HM2_ERR_RANGE);
        lbp16_builder_init(&builder, built, sizeof built);
        assert_int_equal(lbp16_add_read16(&builder, LBP16_SPACE_TIMER, 0, counts[i], NULL), HM2_ERR_RANGE);
        lbp16_builder_init(&builder, built, sizeof built);
        assert_int_equal(lbp16_add_write16(&builder, LBP16_SPACE_TIMER, 0, counts[i], NULL, NULL), HM2_ERR_RANGE);
        assert_int_equal(builder.used, 0);
    }
}

static void a_read_is_no_write_and_a_write_no_read(void **state)
{
    (void)state;
    uint8_t built[64];
    struct lbp16_builder builder;
    const struct lbp16_command read = READ(HM2, true, 1), write = WRITE_AT(HM2, true, 1, 0);
    lbp16_builder_init(&builder, built, sizeof built);
    assert_int_equal(lbp16_add_write(&builder, &read, NULL, NULL), HM2_ERR_INVALID);
    lbp16_builder_init(&builder, built, sizeof built);
    assert_int_equal(lbp16_add_read(&builder, &write, NULL), HM2_ERR_INVALID);
}

static void a_request_or_reply_longer_than_a_datagram_is_refused(void **state)
{
    (void)state;
    uint8_t built[4096];
    struct lbp16_builder builder;
    /* reply: 2 * 508 + 456 = 1472 fits, one byte more does not */
    lbp16_builder_init(&builder, built, sizeof built);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0, 127, NULL), 0);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0, 127, NULL), 0);
    assert_int_equal(lbp16_add_read_hm2(&builder, 0, 114, NULL), 0);
    assert_int_equal(builder.reply_bytes, LBP16_MAX_REPLY_BYTES);
    const struct lbp16_command byte = {.space = LBP16_SPACE_HM2, .size = LBP16_SIZE_8, .count = 1};
    assert_int_equal(lbp16_add_read(&builder, &byte, NULL), HM2_ERR_NOSPACE);
    assert_int_equal(builder.reply_bytes, LBP16_MAX_REPLY_BYTES);
    /* request: 2 * (4 + 508) + 4 + 444 = 1472, whatever the buffer has */
    lbp16_builder_init(&builder, built, sizeof built);
    assert_int_equal(lbp16_add_write_hm2(&builder, 0, 127, NULL, NULL), 0);
    assert_int_equal(lbp16_add_write_hm2(&builder, 0, 127, NULL, NULL), 0);
    assert_int_equal(lbp16_add_write_hm2(&builder, 0, 111, NULL, NULL), 0);
    assert_int_equal(builder.used, LBP16_MAX_REQUEST_BYTES);
    const struct lbp16_command next = READ(HM2, true, 1);
    assert_int_equal(lbp16_add_read(&builder, &next, NULL), HM2_ERR_NOSPACE);
}

/* ---- the parser on what the firmware was sent --------------------------------------------------------------------*/

static void a_missing_address_reads_as_zero_and_is_reported(void **state)
{
    (void)state;
    static const char *const requests[] = {"0142", "014200", "01C2", "01C2FF"};
    for (size_t i = 0; i < sizeof requests / sizeof requests[0]; i++) {
        uint8_t data[8];
        struct lbp16_parser parser;
        struct lbp16_command command;
        const uint8_t *payload;
        size_t payload_len;
        bool truncated;
        lbp16_parser_init(&parser, data, hex_bytes(requests[i], data, sizeof data));
        assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 1);
        assert_true(truncated);
        assert_int_equal(command.address, 0);
        assert_int_equal(payload_len, 0);
        assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 0);
    }
}

static void a_write_with_data_missing_yields_what_is_there(void **state)
{
    (void)state;
    uint8_t data[16];
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    lbp16_parser_init(&parser, data, hex_bytes("83C20010 77000000 55", data, sizeof data));
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 1);
    assert_true(truncated);
    assert_int_equal(command.count, 3);
    assert_ptr_equal(payload, data + 4);
    assert_int_equal(payload_len, 5);
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 0);
}

static void a_stray_byte_is_ignored_and_zero_padding_is_an_error(void **state)
{
    (void)state;
    uint8_t data[16];
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    lbp16_parser_init(&parser, data, hex_bytes("01420001 55", data, sizeof data));
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 1);
    assert_false(truncated);
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 0);
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 0);
    lbp16_parser_init(&parser, data, hex_bytes("01420001 0000", data, sizeof data));
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 1);
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), HM2_ERR_MALFORMED);
}

static void an_empty_datagram_has_no_commands(void **state)
{
    (void)state;
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    lbp16_parser_init(&parser, NULL, 0);
    assert_int_equal(lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated), 0);
}

/* ---- recorded exchanges ------------------------------------------------------------------------------------------*/

/* Field number `which` (0..) of a line of exchanges.csv, in place; quotes may hide commas. */
static char *csv_field(char *line, const unsigned which)
{
    bool quoted = false;
    unsigned field = 0;
    char *start = line;
    for (char *p = line;; p++) {
        if (*p == '"')
            quoted = !quoted;
        if ((*p == ',' && !quoted) || *p == '\0' || *p == '\n') {
            const bool last = *p != ',';
            if (field == which) {
                *p = '\0';
                return start;
            }
            if (last)
                return NULL;
            field++;
            start = p + 1;
        }
    }
}

struct exchange {
    uint8_t request[2048], reply[2048];
    size_t request_len, reply_len;
};

static void check_parsed_reply_length(const unsigned line, const struct exchange *const exchange)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len, reply_bytes = 0;
    bool truncated;
    int result;
    lbp16_parser_init(&parser, exchange->request, exchange->request_len);
    while ((result = lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated)) == 1)
        reply_bytes += command.write ? 0 : lbp16_data_bytes(&command);
    /* An error of any kind drops the whole reply, so only answered requests tell the length. */
    if (exchange->reply_len > 0 && (result != 0 || reply_bytes != exchange->reply_len))
        fail_msg("line %u: parser gives %d and %zu reply bytes, the firmware sent %zu", line, result, reply_bytes,
                 exchange->reply_len);
}

/* What the parser takes apart, the builder puts together again: same bytes for every complete request. */
static void check_rebuilt_request(const unsigned line, const struct exchange *const exchange)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    uint8_t built[LBP16_MAX_REQUEST_BYTES];
    struct lbp16_builder builder;
    lbp16_builder_init(&builder, built, sizeof built);
    lbp16_parser_init(&parser, exchange->request, exchange->request_len);
    while (lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated) == 1) {
        if (truncated)
            return;
        (void)(command.write ? lbp16_add_write(&builder, &command, payload, NULL)
                             : lbp16_add_read(&builder, &command, NULL));
    }
    if (builder.error == HM2_ERR_NOSPACE) { /* the requests for 1524 and 2032 bytes of reply, which the card refused */
        assert_int_equal(exchange->reply_len, 0);
        return;
    }
    assert_int_equal(builder.error, 0);
    if (memcmp(built, exchange->request, builder.used) != 0)
        fail_msg("line %u: rebuilt request differs", line);
}

static void recorded_requests_parse_to_replies_of_the_recorded_length(void **state)
{
    (void)state;
    FILE *const file = fopen(TEST_DATA "/lbp16/exchanges.csv", "r");
    assert_non_null(file);
    static char line[8192], copy[8192];
    unsigned number = 0, checked = 0;
    while (fgets(line, sizeof line, file)) {
        struct exchange exchange;
        number++;
        memcpy(copy, line, sizeof copy);
        const char *const kind = csv_field(copy, 1);
        if (!kind || strcmp(kind, "udp") != 0)
            continue;
        memcpy(copy, line, sizeof copy);
        exchange.request_len = hex_bytes(csv_field(copy, 3), exchange.request, sizeof exchange.request);
        memcpy(copy, line, sizeof copy);
        exchange.reply_len = hex_bytes(csv_field(copy, 4), exchange.reply, sizeof exchange.reply);
        check_parsed_reply_length(number, &exchange);
        check_rebuilt_request(number, &exchange);
        checked++;
    }
    (void)fclose(file);
    assert_int_equal(checked, 96);
}

/* ---- information areas -------------------------------------------------------------------------------------------*/

struct area {
    enum lbp16_space space;
    const char *hex; /* as the firmware sent it: exchanges.csv, rows 28..35 */
    unsigned type;
    bool writable;
    unsigned access, erase_log2, page_log2, size_log2;
    uint16_t pointer;
    const char *name;
};

static const struct area areas[] = {
    {LBP16_SPACE_HM2, "005a048110000810486f73744d6f7432", LBP16_TYPE_REGISTER, true, 4, 0, 0, 16, 0x1008, "HostMot2"},
    {LBP16_SPACE_ETHERNET, "015a0281080000004b535a3838353100", LBP16_TYPE_REGISTER, true, 2, 0, 0, 8, 0, "KSZ8851"},
    {LBP16_SPACE_EEPROM, "025a028e070000004574686572454550", LBP16_TYPE_EEPROM, true, 2, 0, 0, 7, 0, "EtherEEP"},
    {LBP16_SPACE_FLASH, "035a048f1882000046504741466c7368", LBP16_TYPE_FLASH, true, 4, 16, 8, 24, 0, "FPGAFlsh"},
    {LBP16_SPACE_TIMER, "045a02820400000054696d6572730000", LBP16_TYPE_MEMORY, true, 2, 0, 0, 4, 0, "Timers"},
    {LBP16_SPACE_CONTROL, "065a0282040008004c42503136525700", LBP16_TYPE_MEMORY, true, 2, 0, 0, 4, 8, "LBP16RW"},
    {LBP16_SPACE_INFO, "075a0202040000004c42503136524f00", LBP16_TYPE_MEMORY, false, 2, 0, 0, 4, 0, "LBP16RO"},
};

static void recorded_information_areas_decode_and_encode_again(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof areas / sizeof areas[0]; i++) {
        const struct area *const area = &areas[i];
        uint8_t golden[LBP16_INFO_BYTES], again[LBP16_INFO_BYTES];
        struct lbp16_info info;
        assert_int_equal(hex_bytes(area->hex, golden, sizeof golden), sizeof golden);
        assert_int_equal(lbp16_info_decode(area->space, golden, sizeof golden, &info), 0);
        assert_int_equal(info.cookie, 0x5A00 + (int)area->space);
        assert_int_equal(info.writable, area->writable);
        assert_int_equal(info.type, area->type);
        for (unsigned bit = 0; bit < 4; bit++)
            assert_int_equal(info.access[bit], area->access >> bit & 1u);
        assert_int_equal(info.erase_log2, area->erase_log2);
        assert_int_equal(info.page_log2, area->page_log2);
        assert_int_equal(info.size_log2, area->size_log2);
        assert_int_equal(info.pointer, area->pointer);
        assert_string_equal(info.name, area->name);
        lbp16_info_encode(&info, again);
        assert_memory_equal(again, golden, sizeof golden);
    }
}

static void an_information_area_of_another_space_or_cut_short_is_refused(void **state)
{
    (void)state;
    uint8_t golden[LBP16_INFO_BYTES];
    struct lbp16_info info;
    hex_bytes(areas[0].hex, golden, sizeof golden);
    assert_int_equal(lbp16_info_decode(LBP16_SPACE_ETHERNET, golden, sizeof golden, &info), HM2_ERR_MISMATCH);
    assert_int_equal(lbp16_info_decode(LBP16_SPACE_HM2, golden, sizeof golden - 1, &info), HM2_ERR_MALFORMED);
    assert_int_equal(lbp16_info_decode(LBP16_SPACE_HM2, NULL, 0, &info), HM2_ERR_MALFORMED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_command_code_of_the_manuals_is_encoded_and_decoded),
        cmocka_unit_test(every_command_word_survives_a_round_trip_and_count_zero_is_refused),
        cmocka_unit_test(fields_outside_their_width_are_refused),
        cmocka_unit_test(every_example_of_the_manuals_is_built_byte_for_byte),
        cmocka_unit_test(every_example_of_the_manuals_is_parsed_into_its_commands),
        cmocka_unit_test(replies_of_the_sample_run_are_little_endian),
        cmocka_unit_test(short_forms_build_the_documented_commands),
        cmocka_unit_test(the_first_error_of_a_builder_sticks_and_appends_nothing),
        cmocka_unit_test(counts_outside_1_to_127_are_refused_by_every_builder_call),
        cmocka_unit_test(a_read_is_no_write_and_a_write_no_read),
        cmocka_unit_test(a_request_or_reply_longer_than_a_datagram_is_refused),
        cmocka_unit_test(a_missing_address_reads_as_zero_and_is_reported),
        cmocka_unit_test(a_write_with_data_missing_yields_what_is_there),
        cmocka_unit_test(a_stray_byte_is_ignored_and_zero_padding_is_an_error),
        cmocka_unit_test(an_empty_datagram_has_no_commands),
        cmocka_unit_test(recorded_requests_parse_to_replies_of_the_recorded_length),
        cmocka_unit_test(recorded_information_areas_decode_and_encode_again),
        cmocka_unit_test(an_information_area_of_another_space_or_cut_short_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
