/* SPDX-License-Identifier: GPL-2.0-or-later */
/* DBC files and their signals, against what cantools makes of them (tests/data/can). */
#include "unit.h"

#include <math.h>

#include <hm2/dbc.h>

#include "hex.h"
#include "text_file.h"

static struct hm2_dbc *golden(void)
{
    struct hm2_dbc *dbc;
    struct hm2_diag diag = {0};
    size_t len;
    char *const text = text_file("can/golden.dbc", &len);
    if (hm2_dbc_read(text, len, "golden.dbc", &dbc, &diag) != 0 || diag.warnings)
        fail_msg("%s", diag.text);
    free(text); /* nothing points into it */
    return dbc;
}

static const struct hm2_dbc_message *message(const struct hm2_dbc *const dbc, const char *const name)
{
    for (uint32_t i = 0; i < dbc->message_count; i++)
        if (strcmp(dbc->messages[i].name, name) == 0)
            return &dbc->messages[i];
    fail_msg("no message %s", name);
    return NULL;
}

static const struct hm2_dbc_signal *signal_of(const struct hm2_dbc *const dbc, const char *const name,
                                              const char *const signal)
{
    const struct hm2_dbc_message *const m = message(dbc, name);
    for (uint32_t i = 0; i < m->signal_count; i++)
        if (strcmp(dbc->signals[m->first_signal + i].name, signal) == 0)
            return &dbc->signals[m->first_signal + i];
    fail_msg("no signal %s.%s", name, signal);
    return NULL;
}

/* ---- golden frames -------------------------------------------------------------------------------------------------
 */

/* The next "signal=value" of a line. */
static bool next_value(char **const at, const char **const name, double *const value)
{
    char *const equal = strchr(*at, '=');
    if (!equal)
        return false;
    *equal = '\0';
    *name = *at + strspn(*at, " ");
    *value = strtod(equal + 1, at);
    return true;
}

static void check_decoded(const struct hm2_dbc *const dbc, const struct hm2_dbc_message *const m,
                          const uint8_t *const data, char *at)
{
    const char *name;
    double value;
    unsigned named = 0, present = 0;
    while (next_value(&at, &name, &value)) {
        const struct hm2_dbc_signal *const s = signal_of(dbc, m->name, name);
        const double got = hm2_dbc_value(s, data);
        if (!hm2_dbc_present(dbc, s, data) || fabs(got - value) > 1e-12 * fabs(value))
            fail_msg("%s.%s: %.17g, cantools has %.17g", m->name, name, got, value);
        named++;
    }
    for (uint32_t i = 0; i < m->signal_count; i++)
        present += hm2_dbc_present(dbc, &dbc->signals[m->first_signal + i], data);
    assert_int_equal(present, named);
}

static void check_encoded(const struct hm2_dbc *const dbc, const struct hm2_dbc_message *const m,
                          const uint8_t *const data, char *at)
{
    uint8_t bytes[HM2_CAN_MAX_BYTES] = {0};
    const char *name;
    double value;
    bool exact = true;
    while (next_value(&at, &name, &value)) {
        const struct hm2_dbc_signal *const s = signal_of(dbc, m->name, name);
        assert_true(hm2_dbc_put_value(s, bytes, value));
        exact = exact && fabs(value) < 9007199254740992.0; /* what a double holds */
    }
    if (exact && memcmp(bytes, data, m->bytes) != 0)
        fail_msg("%s: encoded in another way", m->name);
}

static void frames_are_those_of_cantools(void **state)
{
    (void)state;
    size_t len;
    unsigned lines = 0;
    struct hm2_dbc *const dbc = golden();
    char *const text = text_file("can/golden.txt", &len), *rest = NULL;
    for (char *line = strtok_r(text, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest), lines++) {
        char *words = NULL;
        uint8_t data[HM2_CAN_MAX_BYTES];
        const bool encode = strcmp(strtok_r(line, " ", &words), "encode") == 0;
        const struct hm2_dbc_message *const m = message(dbc, strtok_r(NULL, " ", &words));
        assert_int_equal(hex_bytes(strtok_r(NULL, " ", &words), data, sizeof data), m->bytes);
        (encode ? check_encoded : check_decoded)(dbc, m, data, words);
    }
    assert_true(lines > 200);
    free(text);
    hm2_dbc_free(dbc);
}

/* ---- what a file says ----------------------------------------------------------------------------------------------
 */

static void messages_have_what_the_file_says(void **state)
{
    (void)state;
    struct hm2_dbc *const dbc = golden();
    assert_int_equal(dbc->message_count, 8); /* without the one that has no home */
    assert_int_equal(dbc->node_count, 3);
    const struct hm2_dbc_message *const m = message(dbc, "Intel"), *const wide = message(dbc, "Wide");
    assert_int_equal(m->id, 256);
    assert_true(m->on_change);
    assert_int_equal(m->cycle_ms, 0);
    assert_true(hm2_dbc_has(dbc, m->senders, 0) && !hm2_dbc_has(dbc, m->senders, 1) && hm2_dbc_has(dbc, m->senders, 2));
    assert_int_equal(message(dbc, "Motorola")->cycle_ms, 20);
    assert_true(wide->extended && !m->extended);
    assert_int_equal(wide->id, 0x18FEF100);
    assert_true(message(dbc, "Floats")->fd && message(dbc, "Long")->fd && !m->fd);
    const struct hm2_dbc_signal *const s = signal_of(dbc, "Intel", "u12"), *const s7 = signal_of(dbc, "Intel", "s7");
    assert_string_equal(s->unit, "degC");
    assert_true(fabs(s->start_value - 10.0) < 1e-9);
    assert_true(hm2_dbc_has(dbc, s->receivers, 1) && hm2_dbc_has(dbc, s->receivers, 2) &&
                !hm2_dbc_has(dbc, s->receivers, 0));
    assert_true(hm2_dbc_has(dbc, signal_of(dbc, "Wide", "u64")->receivers, HM2_DBC_ANYBODY));
    assert_int_equal(s7->values, 2);
    assert_int_equal(dbc->values[s7->first_value].raw, -1);
    assert_string_equal(dbc->values[s7->first_value].text, "minus one");
    assert_int_equal(hm2_dbc_node(dbc, "PANEL"), 2);
    assert_int_equal(hm2_dbc_node(dbc, "nobody"), HM2_ERR_NOTFOUND);
    hm2_dbc_free(dbc);
}

/* ---- values at the edges -------------------------------------------------------------------------------------------
 */

static void values_outside_become_the_nearest_inside(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        struct hm2_dbc_signal signal;
        double value, back;
    } rows[] = {
        {"unsigned above", {.bits = 8, .scale = 1}, 1e30, 255},
        {"unsigned below", {.bits = 8, .scale = 1}, -1, 0},
        {"infinity", {.bits = 64, .scale = 1}, INFINITY, 18446744073709551615.0},
        {"signed above", {.bits = 12, .scale = 1, .kind = HM2_DBC_SIGNED}, 5000, 2047},
        {"signed below", {.bits = 12, .scale = 1, .kind = HM2_DBC_SIGNED}, -5000, -2048},
        {"one signed bit", {.bits = 1, .scale = 1, .kind = HM2_DBC_SIGNED}, -1, -1},
        {"64 signed bits", {.bits = 64, .scale = 1, .kind = HM2_DBC_SIGNED}, -INFINITY, -9223372036854775808.0},
        {"limits of the file", {.bits = 16, .scale = 1, .min = 10, .max = 20}, 300, 20},
        {"half is rounded away", {.bits = 16, .scale = 1, .kind = HM2_DBC_SIGNED}, -2.5, -3},
        {"negative scale", {.bits = 8, .scale = -2, .offset = 10}, -1000, -500},
        {"float above", {.bits = 32, .scale = 1, .kind = HM2_DBC_FLOAT32}, 1e300, 3.4028234663852886e38},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        uint8_t data[8] = {0};
        double low, high;
        assert_true(hm2_dbc_put_value(&rows[i].signal, data, rows[i].value));
        const double back = hm2_dbc_value(&rows[i].signal, data);
        hm2_dbc_range(&rows[i].signal, &low, &high);
        if (fabs(back - rows[i].back) > 0 || back < low || back > high)
            fail_msg("%s: %.17g, expected %.17g", rows[i].name, back, rows[i].back);
        assert_false(hm2_dbc_put_value(&rows[i].signal, data, NAN));
    }
}

/* ---- files that are wrong ------------------------------------------------------------------------------------------
 */

#define HEAD "VERSION \"\"\nBU_: A B\nBO_ 1 M: 8 A\n"

static void what_is_wrong_is_said_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int err;
        const char *sentence;
    } rows[] = {
        {HEAD " SG_ s : 0|8@1+ (1,0) [0|0] \"\n", HM2_ERR_MALFORMED, "x.dbc:4: expected a text in quotes"},
        {HEAD " SG_ s : 60|8@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_RANGE, "x.dbc:4: M.s (start 60, 8 bits, Intel) reaches"},
        {HEAD " SG_ s : 56|2@0+ (1,0) [0|0] \"\" B\n", HM2_ERR_RANGE,
         "x.dbc:4: M.s (start 56, 2 bits, Motorola) reaches"},
        {HEAD " SG_ s : 511|64@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_RANGE, "x.dbc:4: M.s (start 511"},
        {HEAD " SG_ s : 0|65@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_RANGE, "x.dbc:4: a number of bits is 65"},
        {HEAD " SG_ s : 0|8@1+ (0,0) [0|0] \"\" B\n", HM2_ERR_RANGE, "x.dbc:4: the scale of s is 0"},
        {HEAD " SG_ s : 0|8@1+ (1e999,0) [0|0] \"\" B\n", HM2_ERR_MALFORMED, "x.dbc:4: expected a number"},
        {HEAD " SG_ s : 0|8@1+ (1,0) [0|0] \"\" C\n", HM2_ERR_INVALID, "x.dbc:4: no node is named C"},
        {HEAD " SG_ s m1 : 0|8@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_INVALID, "x.dbc:4: M.s is multiplexed, and M has 0"},
        {HEAD " SG_ s q : 0|8@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_MALFORMED, "x.dbc:4: expected M, m and a number"},
        {HEAD " SG_ s : 0|8@1+ (1,0) [0|0] \"\" B\n SG_ s : 8|8@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_INVALID,
         "x.dbc:5: M has a signal s in line 4"},
        {HEAD "BO_ 1 N: 8 A\n", HM2_ERR_INVALID, "x.dbc:4: the identifier 1 is that of M in line 3"},
        {HEAD "BO_ 2048 N: 8 A\n", HM2_ERR_RANGE, "x.dbc:4: 2048 is no identifier"},
        {HEAD "BO_ 2 N: 9 A\n", HM2_ERR_RANGE, "x.dbc:4: N has 9 bytes"},
        {HEAD "BO_ 2 N: 65 A\n", HM2_ERR_RANGE, "x.dbc:4: a length is 65"},
        {HEAD "SIG_VALTYPE_ 1 s : 1;\n", HM2_ERR_INVALID, "x.dbc:4: the message M has no signal s"},
        {HEAD " SG_ s : 0|8@1- (1,0) [0|0] \"\" B\nSIG_VALTYPE_ 1 s : 1;\n", HM2_ERR_RANGE, "x.dbc:5: M.s has 8 bits"},
        {HEAD "SG_MUL_VAL_ 5 s m 1-1;\n", HM2_ERR_INVALID, "x.dbc:4: no message has the identifier 5"},
        {HEAD " SG_ s m1M : 0|8@1+ (1,0) [0|0] \"\" B\nSG_MUL_VAL_ 1 s s 1-1;\n", HM2_ERR_INVALID,
         "x.dbc:4: M.s has more than 8 multiplexors"},
        {HEAD "BA_ \"GenMsgCycleTime\" BO_ 7 1;\n", HM2_ERR_INVALID, "x.dbc:4: no message of the identifier 7"},
        {"SG_ s : 0|8@1+ (1,0) [0|0] \"\" B\n", HM2_ERR_MALFORMED, "x.dbc:1: SG_ before"},
        {"rubbish\n", HM2_ERR_MALFORMED, "x.dbc:1: expected a keyword"},
        {HEAD "CM_ \"never ends", HM2_ERR_MALFORMED, "x.dbc:4: expected \";\", found the end"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_dbc *dbc;
        struct hm2_diag diag = {0};
        const int err = hm2_dbc_read(rows[i].text, strlen(rows[i].text), "x.dbc", &dbc, &diag);
        if (err != rows[i].err || dbc || !strstr(diag.text, rows[i].sentence))
            fail_msg("row %zu: %d \"%s\", expected %d \"%s\"", i, err, diag.text, rows[i].err, rows[i].sentence);
    }
}

static void problems_are_collected(void **state)
{
    (void)state;
    static const char text[] = HEAD " SG_ s : 0|0@1+ (1,0) [0|0] \"\" B\nBO_ 2 N: 8 C\nBO_ 3 O: 8 A\n SG_ t : x\n";
    struct hm2_dbc *dbc;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_dbc_read(text, strlen(text), "x", &dbc, &diag), HM2_ERR_RANGE);
    assert_int_equal(diag.problems, 3);
}

static void shared_bits_are_a_warning(void **state)
{
    (void)state;
    static const char text[] = HEAD " SG_ a : 0|8@1+ (1,0) [0|0] \"\" B\n SG_ b : 0|4@0+ (1,0) [0|0] \"\" B\n";
    struct hm2_dbc *dbc;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_dbc_read(text, strlen(text), "x", &dbc, &diag), 0);
    assert_int_equal(diag.warnings, 1);
    assert_non_null(strstr(diag.text, "x:5: M.b shares bits"));
    hm2_dbc_free(dbc);
}

static void tables_have_limits(void **state)
{
    (void)state;
    const size_t size = 64u * (HM2_DBC_MAX_MESSAGES + 1u);
    char *const text = malloc(size);
    struct hm2_dbc *dbc;
    struct hm2_diag diag = {0};
    assert_non_null(text);
    size_t len = (size_t)snprintf(text, size, "BU_: A\n");
    for (unsigned i = 0; i <= HM2_DBC_MAX_MESSAGES; i++)
        len += (size_t)snprintf(text + len, size - len, "BO_ %u M%u: 8 A\n", i + 0x80000000u, i);
    assert_int_equal(hm2_dbc_read(text, len, "x", &dbc, &diag), HM2_ERR_NOSPACE);
    assert_non_null(strstr(diag.text, "more than 2048 messages"));
    assert_int_equal(hm2_dbc_read(text, HM2_DBC_MAX_TEXT + 1u, "x", &dbc, &diag), HM2_ERR_NOSPACE);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_are_those_of_cantools),
        cmocka_unit_test(messages_have_what_the_file_says),
        cmocka_unit_test(values_outside_become_the_nearest_inside),
        cmocka_unit_test(what_is_wrong_is_said_with_its_line),
        cmocka_unit_test(problems_are_collected),
        cmocka_unit_test(shared_bits_are_a_warning),
        cmocka_unit_test(tables_have_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
