/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <hm2/config.h>

static struct hm2_config parse(const char *const text)
{
    struct hm2_config config;
    struct hm2_diag diag = {0};
    if (hm2_config_parse(text, &config, &diag) != 0)
        fail_msg("\"%s\": %s", text, diag.text);
    return config;
}

static void nothing_given_takes_everything_the_firmware_has(void **state)
{
    (void)state;
    static const char *const empty[] = {NULL, "", "  \t\r\n "};
    for (size_t k = 0; k < 3; k++) {
        const struct hm2_config config = parse(empty[k]);
        for (unsigned i = 0; i < HM2_CFG_COUNTS; i++)
            assert_int_equal(config.count[i], HM2_CFG_ALL);
        assert_int_equal(config.stepgen_width, 2);
        assert_false(config.enable_raw);
        assert_false(config.sserial_given);
        assert_memory_equal(config.sserial_mode[3], "00000000", 8);
        assert_int_equal(hm2_config_sserial_ports(&config, 3), 3);
        assert_int_equal(config.sserial_baudrate, -1);
        assert_false(config.use_serial_numbers);
        assert_int_equal(config.pipelined, 0);
        assert_false(config.adaptive_timeout || config.second_request);
        assert_string_equal(config.ssi_format[31], "");
    }
}

static void every_count_has_its_key(void **state)
{
    (void)state;
    for (unsigned i = 0; i < HM2_CFG_COUNTS; i++) {
        char text[64];
        (void)snprintf(text, sizeof text, "%s=%u", hm2_config_key((enum hm2_config_count)i), i + 3);
        const struct hm2_config config = parse(text);
        for (unsigned k = 0; k < HM2_CFG_COUNTS; k++)
            assert_int_equal(config.count[k], k == i ? (int)i + 3 : HM2_CFG_ALL);
    }
    assert_string_equal(hm2_config_key(HM2_CFG_3PWMGENS), "num_3pwmgens");
    assert_string_equal(hm2_config_key(HM2_CFG_COUNTS), "");
}

static void numbers_follow_strtol_with_base_0(void **state)
{
    (void)state;
    assert_int_equal(parse("num_encoders=0x10").count[HM2_CFG_ENCODERS], 16);
    assert_int_equal(parse("num_encoders=010").count[HM2_CFG_ENCODERS], 8);
    assert_int_equal(parse("num_encoders=-1").count[HM2_CFG_ENCODERS], HM2_CFG_ALL);
    assert_int_equal(parse("num_encoders=0").count[HM2_CFG_ENCODERS], 0);
    assert_int_equal(parse("num_encoders=5 num_encoders=2").count[HM2_CFG_ENCODERS], 2);
}

static void a_whole_line_of_a_machine_is_read(void **state)
{
    (void)state;
    const struct hm2_config config = parse(" num_encoders=1\tnum_stepgens=5  stepgen_width=4 sserial_port_1=0x3\n"
                                           "enable_raw firmware=hm2/7i96/sv.bit ssi_chan_3=nul%1bmpos%24ge\v"
                                           "fanuc_chan_31=AA64 biss_chan_0=e%32Ml%32L pipelined=3");
    assert_int_equal(config.pipelined, 3);
    assert_int_equal(config.count[HM2_CFG_ENCODERS], 1);
    assert_int_equal(config.count[HM2_CFG_STEPGENS], 5);
    assert_int_equal(config.stepgen_width, 4);
    assert_true(config.enable_raw);
    assert_true(config.sserial_given);
    assert_false(config.sserial_port_given[0]);
    assert_true(config.sserial_port_given[1]);
    assert_memory_equal(config.sserial_mode[1], "0x300000", 8);
    assert_int_equal(config.sserial_named[1], 3);
    assert_memory_equal(config.sserial_mode[0], "00000000", 8);
    assert_string_equal(config.ssi_format[3], "nul%1bmpos%24ge");
    assert_string_equal(config.fanuc_format[31], "AA64");
    assert_string_equal(config.biss_format[0], "e%32Ml%32L");
    assert_string_equal(config.ssi_format[31], "");
}

static void a_second_request_needs_the_adaptive_deadline(void **state)
{
    (void)state;
    const struct hm2_config one = parse("adaptive_timeout"), both = parse("second_request");
    assert_true(one.adaptive_timeout && !one.second_request);
    assert_true(both.adaptive_timeout && both.second_request);
}

static void smart_serial_ports_are_counted_up_to_the_highest_digit(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        unsigned available, ports;
    } rows[] = {
        {"sserial_port_0=00000000", 2, 1},
        {"sserial_port_0=xxxxxxxx", 2, 0},
        {"sserial_port_1=00", 2, 2},
        {"sserial_port_1=00", 1, 1},
        {"sserial_port_1=0 sserial_port_0=xx", 4, 2},
        {"sserial_port_3=2 sserial_port_0=1", 4, 4},
        {"sserial_port_0=0 sserial_port_1=xxxx", 4, 1},
        {"num_encoders=1", 4, 4},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_config config = parse(rows[i].text);
        assert_int_equal(hm2_config_sserial_ports(&config, rows[i].available), rows[i].ports);
    }
}

static void what_is_not_exactly_right_is_refused_with_the_token(void **state)
{
    (void)state;
    static const struct {
        const char *text, *sentence;
    } cases[] = {
        {"num_encoders=3x", "config: \"num_encoders=3x\": a whole number from -1 to 1000 is expected after \"=\", "
                            "\"3x\" found"},
        {"pipelined=5", "\"pipelined=5\": a whole number from 0 to 4 is expected"},
        {"pipelined", "\"=\" and a value are expected"},
        {"dbname0=7I48", "\"dbname0=7I48\": connectors count from 1"},
        {"dbname5=7I48", "a number from 0 to 4 is expected after \"dbname\", \"5\" found"},
        {"dbname1=7I00", "the terminals of a daughter board \"7I00\" are not known"},
        {"dbname2", "\"=\" and a value are expected"},
        {"num_encoders=", "\"num_encoders=\": a whole number"},
        {"num_encoders", "\"num_encoders\": a whole number"},
        {"num_encoders=-2", "\"-2\" found"},
        {"num_encoders=1001", "\"1001\" found"},
        {"num_encoders=99999999999999999999", "\"99999999999999999999\" found"},
        {"num_encoders=08", "\"08\" found"},
        {"num_absencs=1", "\"num_absencs=1\" is not known; expected num_<modules>=N"},
        {"enable_adc", "\"enable_adc\" is not known"},
        {"enable_rawest", "\"enable_rawest\" is not known"},
        {"enable_raw=1", "\"enable_raw=1\": no value is expected"},
        {"firmware", "\"firmware\": \"=\" and a value are expected"},
        {"stepgen_width=0", "a whole number from 1 to 8"},
        {"stepgen_width=9", "a whole number from 1 to 8"},
        {"stepgen_width_=2", "\"stepgen_width_=2\" is not known"},
        {"sserial_port_4=00", "a number from 0 to 3 is expected after \"sserial_port_\", \"4\" found"},
        {"sserial_port_=00", "a number from 0 to 3"},
        {"sserial_port_0", "\"=\" and a value are expected"},
        {"sserial_port_0 =00", "\"sserial_port_0\": \"=\" and a value are expected"},
        {"sserial_port_0=", "1 to 8 characters are expected"},
        {"sserial_port_0=000000000", "1 to 8 characters are expected"},
        {"sserial_port_0=00-0", "1 to 8 characters are expected"},
        {"sserial_port_0=X", "1 to 8 characters are expected"},
        {"ssi_chan_32=a%1b", "a number from 0 to 31 is expected after \"ssi_chan_\", \"32\" found"},
        {"ssi_chan_1=", "fields name%<length><modifiers><type> are expected"},
        {"ssi_chan_1=pos%33u", "lengths from 1 to 32 and at most 96 bits"},
        {"ssi_chan_1=pos%0u", "fields name%"},
        {"ssi_chan_1=pos%5z", "fields name%"},
        {"ssi_chan_1=pos%5u,x", "fields name%"},
        {"ssi_chan_1=a%32ub%32uc%32ud%1b", "at most 96 bits in all"},
        {"ssi_chan_1=AA64", "fields name%"},
        {"fanuc_chan_1=AA65", "or AA64"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct hm2_config config;
        struct hm2_diag diag = {0};
        assert_int_equal(hm2_config_parse(cases[i].text, &config, &diag), HM2_ERR_INVALID);
        if (!strstr(diag.text, cases[i].sentence))
            fail_msg("\"%s\": \"%s\" is missing in: %s", cases[i].text, cases[i].sentence, diag.text);
    }
}

static void every_problem_of_a_string_is_reported(void **state)
{
    (void)state;
    char text[600] = "bogus num_pwmgens=z num_stepgens=2 sserial_port_9=0 ";
    memset(text + strlen(text), 'y', 300);
    struct hm2_config config;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_config_parse(text, &config, &diag), HM2_ERR_INVALID);
    assert_int_equal(diag.problems, 4);
    assert_non_null(strstr(diag.text, "has 300 characters, at most 255 are expected"));
    assert_int_equal(config.count[HM2_CFG_STEPGENS], 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_given_takes_everything_the_firmware_has),
        cmocka_unit_test(every_count_has_its_key),
        cmocka_unit_test(numbers_follow_strtol_with_base_0),
        cmocka_unit_test(a_whole_line_of_a_machine_is_read),
        cmocka_unit_test(a_second_request_needs_the_adaptive_deadline),
        cmocka_unit_test(smart_serial_ports_are_counted_up_to_the_highest_digit),
        cmocka_unit_test(what_is_not_exactly_right_is_refused_with_the_token),
        cmocka_unit_test(every_problem_of_a_string_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
