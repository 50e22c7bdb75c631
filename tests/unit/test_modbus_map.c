/* SPDX-License-Identifier: GPL-2.0-or-later */
/* mb2hal's file format, and the numbers of its elements. */
#include "unit.h"

#include <math.h>

#include <hm2/modbus.h>

#define TCP_HEAD "[MB2HAL_INIT]\nVERSION=1.1\nTOTAL_TRANSACTIONS=1\n[TRANSACTION_00]\nLINK_TYPE=tcp\nTCP_IP=10.0.0.9\n"
#define SERIAL_LINK                                                                                    \
    "LINK_TYPE=serial\nSERIAL_PORT=/dev/ttyS0\nSERIAL_BAUD=19200\nSERIAL_BITS=8\nSERIAL_PARITY=even\n" \
    "SERIAL_STOP=1\n"
#define READ_3 "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=0\n"
#define UNIT_1 "MB_SLAVE_ID=1\n"

static struct hm2_diag diag;

static int parse(const char *const text, struct hm2_modbus_map **const map)
{
    hm2_diag_clear(&diag);
    return hm2_modbus_parse(text, strlen(text), "x.ini", map, &diag);
}

static struct hm2_modbus_map *good(const char *const text)
{
    struct hm2_modbus_map *map;
    if (parse(text, &map))
        fail_msg("%s", diag.text);
    assert_int_equal(diag.warnings, 0);
    return map;
}

static void a_transaction_has_mb2hals_defaults(void **state)
{
    (void)state;
    struct hm2_modbus_map *const map = good(TCP_HEAD UNIT_1 READ_3 "NELEMENTS=3\n");
    const struct hm2_modbus_transaction *const tx = &map->transactions[0];
    assert_string_equal(map->component, "mb2hal");
    assert_false(map->short_names);
    assert_int_equal(map->link_count, 1);
    assert_true(map->links[0].tcp);
    assert_string_equal(map->links[0].host, "10.0.0.9");
    assert_int_equal(map->links[0].port, 502);
    assert_string_equal(tx->name, "00");
    assert_int_equal(tx->response_timeout_ms, 500);
    assert_int_equal(tx->byte_timeout_ms, 500);
    assert_int_equal(tx->words, 3);
    assert_string_equal(tx->elements[2].name, "02");
    assert_int_equal(tx->elements[2].type, HM2_MODBUS_REGISTER);
    assert_true(tx->rate_hz == 0.0 && !tx->on_change && !tx->enable_pin && tx->retries == 0);
    hm2_modbus_free(map);
}

static void every_transaction_type_is_known_by_its_name_in_any_case(void **state)
{
    static const struct {
        const char *name;
        int code;
    } rows[] = {{"fnct_01_read_coils", 1},
                {"fnct_02_read_discrete_inputs", 2},
                {"FNCT_03_read_holding_registers", 3},
                {"fnct_04_read_input_registers", 4},
                {"fnct_05_write_single_coil", 5},
                {"fnct_06_WRITE_single_register", 6},
                {"fnct_15_write_multiple_coils", 15},
                {"fnct_16_write_multiple_registers", 16}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[500];
        snprintf(text, sizeof text, TCP_HEAD UNIT_1 "FIRST_ELEMENT=5\nNELEMENTS=1\nMB_TX_CODE=%s\n", rows[i].name);
        struct hm2_modbus_map *const map = good(text);
        assert_int_equal(map->transactions[0].function, rows[i].code);
        assert_int_equal(hm2_modbus_writes(map->transactions[0].function), rows[i].code >= 5);
        assert_int_equal(map->transactions[0].elements[0].type == HM2_MODBUS_COIL,
                         rows[i].code < 3 || rows[i].code == 5 || rows[i].code == 15);
        hm2_modbus_free(map);
    }
}

static void what_is_not_given_comes_from_the_transaction_before_on_a_link_of_the_same_type(void **state)
{
    (void)state;
    struct hm2_modbus_map *const map =
        good("[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=4\nHAL_MODULE_NAME=plc\nSLOWDOWN=0.5\nINIT_DEBUG=3\n"
             "# a comment\n; another\n"
             "[TRANSACTION_00]\nLINK_TYPE=tcp\nTCP_IP=10.0.0.9\nTCP_PORT=1502\nMB_SLAVE_ID=7\nMAX_UPDATE_RATE=10.5\n"
             "MB_RESPONSE_TIMEOUT_MS=200\nMB_BYTE_TIMEOUT_MS=100\nDEBUG=4\nHAL_TX_NAME=first\nENABLE_PIN=1\n"
             "FIRST_ELEMENT=1\nNELEMENTS=2\nMB_TX_CODE=fnct_02_read_discrete_inputs\n"
             "[TRANSACTION_01]\n" READ_3 "PIN_NAMES=a,b\n"
             "[TRANSACTION_02]\n" SERIAL_LINK "SERIAL_DELAY_MS=20\nMB_SLAVE_ID=3\n" READ_3 "NELEMENTS=1\n"
             "[TRANSACTION_03]\nMB_SLAVE_ID=4\n" READ_3 "NELEMENTS=1\n");
    const struct hm2_modbus_transaction *const tx = map->transactions;
    assert_true(map->short_names);
    assert_string_equal(map->component, "plc");
    assert_true(map->slowdown_s - 0.5 == 0.0);
    assert_int_equal(map->link_count, 2);
    assert_int_equal(tx[1].link, 0);
    assert_int_equal(tx[1].unit, 7);
    assert_true(tx[1].rate_hz - 10.5 == 0.0);
    assert_int_equal(tx[1].response_timeout_ms, 200);
    assert_int_equal(tx[1].byte_timeout_ms, 100);
    assert_string_equal(tx[1].name, "01");
    assert_false(tx[1].enable_pin);
    assert_string_equal(tx[1].elements[1].name, "b");
    assert_int_equal(tx[2].response_timeout_ms, 500);
    assert_true(tx[2].rate_hz == 0.0);
    assert_int_equal(tx[3].link, 1);
    assert_int_equal(tx[3].delay_ms, 20);
    assert_int_equal(map->links[1].baud, 19200);
    assert_int_equal(map->links[1].parity, 'E');
    hm2_modbus_free(map);
}

static void types_take_their_words_and_names_carry_scale_and_offset(void **state)
{
    (void)state;
    struct hm2_modbus_map *const map =
        good(TCP_HEAD UNIT_1
             "FIRST_ELEMENT=100\nMB_TX_CODE=fnct_16_write_multiple_registers\n"
             "PIN_NAMES=speed[*0.1+5],torque[-2],power[*2],on,raw\nELEMENT_TYPES=f32,s16,u32,bits,u16\n"
             "WORD_ORDER=low-first\nWRITE_MODE=change\nREFRESH_S=2.5\nRETRIES=3\nINITIAL=1.5\nENABLE_PIN=1\n");
    const struct hm2_modbus_transaction *const tx = map->transactions;
    const unsigned places[] = {0, 2, 3, 5, 6};
    for (unsigned i = 0; i < 5; i++)
        assert_int_equal(tx->elements[i].word, places[i]);
    assert_int_equal(tx->words, 7);
    assert_string_equal(tx->elements[0].name, "speed");
    assert_true(tx->elements[0].scale - 0.1 == 0.0 && tx->elements[0].offset - 5.0 == 0.0);
    assert_true(tx->elements[1].scale - 1.0 == 0.0 && tx->elements[1].offset + 2.0 == 0.0);
    assert_true(tx->elements[4].initial - 1.5 == 0.0);
    assert_true(tx->low_word_first && tx->on_change && tx->enable_pin && tx->retries == 3);
    assert_true(tx->refresh_s - 2.5 == 0.0);
    hm2_modbus_free(map);
}

static void what_is_wrong_is_named_with_file_and_line(void **state)
{
    static const struct {
        const char *text, *sentence;
    } rows[] = {
        {"", "x.ini: [MB2HAL_INIT] TOTAL_TRANSACTIONS is missing"},
        {"[MB2HAL_INIT", "x.ini:1: a section name has no ']'"},
        {"\nnonsense", "x.ini:2: 'nonsense' is neither"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=0\n", "x.ini:2: TOTAL_TRANSACTIONS: 0 is outside of 1 to 999"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=1\nVERSION=2\n", "x.ini:3: VERSION: '2' is neither 1.0 nor 1.1"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=1\n", "x.ini: [TRANSACTION_00] is missing, TOTAL_TRANSACTIONS says 1"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=1\n[TRANSACTION_00]\nMB_SLAVE_ID=1\n",
         "[TRANSACTION_00] LINK_TYPE is missing"},
        {TCP_HEAD "MB_SLAVE_ID=x\n" READ_3 "NELEMENTS=1\n", "x.ini:7: MB_SLAVE_ID: 'x' is not a whole decimal number"},
        {TCP_HEAD "MB_SLAVE_ID=0x1\n" READ_3 "NELEMENTS=1\n", "x.ini:7: MB_SLAVE_ID: '0x1' is not a whole decimal"},
        {TCP_HEAD "MB_SLAVE_ID=256\n" READ_3 "NELEMENTS=1\n", "x.ini:7: MB_SLAVE_ID: 256 is outside of 0 to 255"},
        {TCP_HEAD READ_3 "NELEMENTS=1\n", "[TRANSACTION_00] MB_SLAVE_ID is missing"},
        {TCP_HEAD UNIT_1 READ_3, "[TRANSACTION_00] has 0 elements; give NELEMENTS or PIN_NAMES"},
        {TCP_HEAD UNIT_1 READ_3 "NELEMENTS=126\n", "moves 126 coils or registers; this MB_TX_CODE can move 125"},
        {TCP_HEAD UNIT_1 "MB_TX_CODE=fnct_05_write_single_coil\nFIRST_ELEMENT=0\nNELEMENTS=2\n", "can move 1"},
        {TCP_HEAD UNIT_1 "MB_TX_CODE=fnct_7\nFIRST_ELEMENT=0\n", "x.ini:8: MB_TX_CODE: 'fnct_7' is none of fnct_01"},
        {TCP_HEAD UNIT_1 "MB_TX_CODE=fnct_01_read_coils\nFIRST_ELEMENT=65535\nNELEMENTS=2\n",
         "beyond the last address"},
        {TCP_HEAD UNIT_1 READ_3 "PIN_NAMES=a,,b\n", "x.ini:10: PIN_NAMES: the name '' has 0 characters"},
        {TCP_HEAD UNIT_1 READ_3 "PIN_NAMES=a,b,a\n", "x.ini:10: PIN_NAMES: 'a' is there twice"},
        {TCP_HEAD UNIT_1 READ_3 "PIN_NAMES=a[*0]\n", "the scale must be finite and not 0"},
        {TCP_HEAD UNIT_1 READ_3 "PIN_NAMES=a[*nan]\n", "the scale must be finite and not 0"},
        {TCP_HEAD UNIT_1 READ_3 "PIN_NAMES=a[2]\n", "x.ini:10: PIN_NAMES: '[2]' is not [*SCALE+OFFSET]"},
        {TCP_HEAD UNIT_1 READ_3 "PIN_NAMES=a[*2]\nELEMENT_TYPES=bits\n", "a is a bit and has no scale"},
        {TCP_HEAD UNIT_1 READ_3 "NELEMENTS=3\nELEMENT_TYPES=u16,u16\n", "has 2 items for 3 elements"},
        {TCP_HEAD UNIT_1 READ_3 "NELEMENTS=1\nELEMENT_TYPES=u8\n", "x.ini:11: ELEMENT_TYPES: 'u8' is none of u16"},
        {TCP_HEAD UNIT_1 READ_3 "NELEMENTS=1\nINITIAL=1\n", "INITIAL: only for what is written"},
        {TCP_HEAD UNIT_1 "MB_TX_CODE=fnct_01_read_coils\nFIRST_ELEMENT=0\nNELEMENTS=1\nELEMENT_TYPES=u16\n",
         "ELEMENT_TYPES: only for registers"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=1\n[TRANSACTION_00]\nLINK_TYPE=usb\n",
         "LINK_TYPE: 'usb' is none of tcp, serial"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=1\n[TRANSACTION_00]\n" SERIAL_LINK "MB_SLAVE_ID=248\n" READ_3
         "NELEMENTS=1\n",
         "247 is the highest"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=2\n[TRANSACTION_00]\n" SERIAL_LINK UNIT_1 READ_3
         "NELEMENTS=1\n[TRANSACTION_01]\nSERIAL_BAUD=9600\n" READ_3 "NELEMENTS=1\n",
         "[TRANSACTION_01] /dev/ttyS0 has other settings"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=2\n[TRANSACTION_00]\nHAL_TX_NAME=01\n" SERIAL_LINK UNIT_1 READ_3
         "NELEMENTS=1\n[TRANSACTION_01]\n" READ_3 "NELEMENTS=1\n",
         "'01' is another transaction's name"},
        {"[MB2HAL_INIT]\nTOTAL_TRANSACTIONS=1\n[TRANSACTION_00]\n" SERIAL_LINK UNIT_1
         "MB_TX_CODE=fnct_15_write_multiple_coils\nFIRST_ELEMENT=0\nPIN_NAMES=enable\n",
         "'enable' is a pin of every transaction"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_modbus_map *map = NULL;
        assert_true(parse(rows[i].text, &map) < 0);
        assert_null(map);
        if (!strstr(diag.text, rows[i].sentence))
            fail_msg("row %zu: expected '%s' in '%s'", i, rows[i].sentence, diag.text);
    }
}

static void keys_without_effect_are_told(void **state)
{
    (void)state;
    struct hm2_modbus_map *map = NULL;
    assert_int_equal(parse(TCP_HEAD UNIT_1 READ_3 "NELEMENTS=1\nMAX_UPDATE_RAET=3\nNELEMENTS=2\n", &map), 0);
    assert_int_equal(diag.warnings, 2);
    assert_non_null(strstr(diag.text, "x.ini:11: [TRANSACTION_00] MAX_UPDATE_RAET has no effect"));
    assert_int_equal(map->transactions[0].element_count, 1);
    hm2_modbus_free(map);
}

static void bytes_that_are_no_text_are_refused(void **state)
{
    (void)state;
    struct hm2_modbus_map *map;
    hm2_diag_clear(&diag);
    assert_int_equal(hm2_modbus_parse("[A]\0b", 5, "x.ini", &map, &diag), HM2_ERR_MALFORMED);
    assert_int_equal(hm2_modbus_parse("", HM2_MODBUS_FILE_BYTES + 1, "x.ini", &map, &diag), HM2_ERR_RANGE);
}

static void numbers_convert_in_every_type_and_word_order(void **state)
{
    static const struct {
        enum hm2_modbus_type type;
        bool low_first;
        double scale, offset, number;
        int32_t whole;
        uint16_t words[2];
    } rows[] = {
        {HM2_MODBUS_COIL, false, 1, 0, 1, 0, {1, 0}},
        {HM2_MODBUS_COIL, false, 1, 0, 0, 0, {0, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, 1234.9, 0, {1234, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, 1234, 6, {1240, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, 65530, 100, {65535, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, -5, 0, {0xFFFB, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, 0, -1, {0xFFFF, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, -1e9, 0, {0x8000, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, NAN, 0, {0, 0}},
        {HM2_MODBUS_REGISTER, false, 1, 0, INFINITY, 0, {65535, 0}},
        {HM2_MODBUS_REGISTER, false, 0.01, 0, 50, 0, {5000, 0}},
        {HM2_MODBUS_U16, false, 0.1, 5, 15, 0, {100, 0}},
        {HM2_MODBUS_U16, false, 1, 0, -1, 0, {0, 0}},
        {HM2_MODBUS_U16, false, 1, 0, 0.5, 0, {1, 0}},
        {HM2_MODBUS_S16, false, 1, 0, -2, 0, {0xFFFE, 0}},
        {HM2_MODBUS_S16, false, 1, 0, 40000, 0, {0x7FFF, 0}},
        {HM2_MODBUS_S16, false, 1, 0, -40000, 0, {0x8000, 0}},
        {HM2_MODBUS_U32, false, 1, 0, 4294967295.0, 0, {0xFFFF, 0xFFFF}},
        {HM2_MODBUS_U32, false, 1, 0, 65538, 0, {1, 2}},
        {HM2_MODBUS_U32, true, 1, 0, 65538, 0, {2, 1}},
        {HM2_MODBUS_U32, true, 1, 0, 1e12, 0, {0xFFFF, 0xFFFF}},
        {HM2_MODBUS_U32, true, 1, 0, NAN, 0, {0, 0}},
        {HM2_MODBUS_S32, false, 1, 0, -2, 0, {0xFFFF, 0xFFFE}},
        {HM2_MODBUS_S32, true, 1, 0, -65536, 0, {0, 0xFFFF}},
        {HM2_MODBUS_S32, false, 1, 0, -1e12, 0, {0x8000, 0}},
        {HM2_MODBUS_F32, false, 1, 0, 1.5, 0, {0x3FC0, 0}},
        {HM2_MODBUS_F32, true, 1, 0, -2.0, 0, {0, 0xC000}},
        {HM2_MODBUS_F32, false, 1, 0, 1e300, 0, {0x7F7F, 0xFFFF}},
        {HM2_MODBUS_F32, false, 1, 0, NAN, 0, {0, 0}},
        {HM2_MODBUS_F32, false, 2, 1, 4, 1, {0x4020, 0}},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_modbus_element element = {
            .type = rows[i].type, .scale = rows[i].scale, .offset = rows[i].offset};
        uint16_t words[2] = {0, 0};
        hm2_modbus_encode(&element, rows[i].low_first, rows[i].number, rows[i].whole, words);
        if (words[0] != rows[i].words[0] || words[1] != rows[i].words[1])
            fail_msg("row %zu: %04x %04x, expected %04x %04x", i, words[0], words[1], rows[i].words[0],
                     rows[i].words[1]);
    }
}

static void words_are_read_in_every_type_and_word_order(void **state)
{
    static const struct {
        enum hm2_modbus_type type;
        bool low_first;
        uint16_t words[2];
        double number;
        int32_t whole;
    } rows[] = {
        {HM2_MODBUS_COIL, false, {1, 0}, 2 * 1 + 1, 1},
        {HM2_MODBUS_REGISTER, false, {0xFFFF, 0}, 2.0 * 65535 + 1, 65535},
        {HM2_MODBUS_U16, false, {0x8000, 0}, 65537, 32768},
        {HM2_MODBUS_S16, false, {0x8000, 0}, -65535, -32768},
        {HM2_MODBUS_U32, false, {0xFFFF, 0xFFFF}, 2 * 4294967295.0 + 1, INT32_MAX},
        {HM2_MODBUS_U32, true, {2, 1}, 2 * 65538 + 1, 65538},
        {HM2_MODBUS_S32, false, {0xFFFF, 0xFFFE}, -3, -2},
        {HM2_MODBUS_F32, false, {0x3FC0, 0}, 4, 1},
        {HM2_MODBUS_F32, true, {0, 0xC000}, -3, -2},
        {HM2_MODBUS_F32, false, {0x7F7F, 0xFFFF}, 2 * 3.4028234663852886e38 + 1, INT32_MAX},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_modbus_element element = {.type = rows[i].type, .scale = 2, .offset = 1};
        const double number = hm2_modbus_decode(&element, rows[i].low_first, rows[i].words);
        if (number - rows[i].number != 0.0)
            fail_msg("row %zu: %.17g, expected %.17g", i, number, rows[i].number);
        assert_int_equal(hm2_modbus_decode_int(&element, rows[i].low_first, rows[i].words), rows[i].whole);
    }
    const struct hm2_modbus_element single = {.type = HM2_MODBUS_F32, .scale = 1};
    assert_true(isnan(hm2_modbus_decode(&single, false, (const uint16_t[2]){0x7FC0, 0})));
    assert_int_equal(hm2_modbus_decode_int(&single, false, (const uint16_t[2]){0x7FC0, 0}), 0);
}

/* Addresses as the drives' documents write them; from 0 where these count from 1. */
static const struct {
    const char *file;
    unsigned first[5];
} examples[] = {
    {"vfd-delta.ini", {0x2100, 0x2001, 0x2000}},
    {"vfd-gs2.ini", {0x2100, 0x91A, 0x91C, 0x91B, 0x91E}},
    {"vfd-vfs11.ini", {0xFD01, 0xFD00, 0xFC90, 0xFA01, 0xFA00}},
    {"vfd-wj200.ini", {0x000F - 1, 0x1001 - 1, 0x0002 - 1, 0x0002 - 1, 0x0001 - 1}},
};

static void the_examples_have_the_addresses_of_their_drives(void **state)
{
    static char text[8192];
    (void)state;
    for (size_t i = 0; i < sizeof examples / sizeof examples[0]; i++) {
        char path[512];
        (void)snprintf(path, sizeof path, "%s/examples/%s", TEST_SOURCE, examples[i].file);
        FILE *const file = fopen(path, "re");
        assert_non_null(file);
        const size_t length = fread(text, 1, sizeof text - 1, file);
        (void)fclose(file);
        text[length] = '\0';
        struct hm2_modbus_map *const map = good(text);
        for (unsigned k = 0; k < map->transaction_count; k++)
            assert_int_equal(map->transactions[k].first, examples[i].first[k]);
        hm2_modbus_free(map);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_transaction_has_mb2hals_defaults),
        cmocka_unit_test(every_transaction_type_is_known_by_its_name_in_any_case),
        cmocka_unit_test(what_is_not_given_comes_from_the_transaction_before_on_a_link_of_the_same_type),
        cmocka_unit_test(types_take_their_words_and_names_carry_scale_and_offset),
        cmocka_unit_test(what_is_wrong_is_named_with_file_and_line),
        cmocka_unit_test(keys_without_effect_are_told),
        cmocka_unit_test(bytes_that_are_no_text_are_refused),
        cmocka_unit_test(numbers_convert_in_every_type_and_word_order),
        cmocka_unit_test(the_examples_have_the_addresses_of_their_drives),
        cmocka_unit_test(words_are_read_in_every_type_and_word_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
