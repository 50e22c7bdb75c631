/* SPDX-License-Identifier: GPL-2.0-or-later */
/* lib/sslbp alone: status words, process data, tables, the port at load and the engine, fed with words in virtual time.
 */
#include "unit.h"

#include <math.h>

#include <hm2/bytes.h>
#include <hm2/sslbp.h>

#define MS INT64_C(1000000)

/* ---- CS register --------------------------------------------------------------------------------------------------
 */

static void sticky_faults_count_only_with_a_communication_error(void **state)
{
    (void)state;
    const struct sslbp_status good = sslbp_status(0x0042008B, 43, true);
    assert_int_equal(good.local, 0x8B);
    assert_int_equal(good.live, 0);
    assert_int_equal(good.state, 0x42);
    const struct sslbp_status bad = sslbp_status(0x00422088, 43, true);
    assert_int_equal(bad.live, SSLBP_TIMEOUT);
}

static void faults_of_the_remote_count_when_its_bit_is_set_and_before_a_doit_from_firmware_29_on(void **state)
{
    (void)state;
    static const struct {
        uint32_t cs;
        unsigned minor;
        bool after_doit;
        uint8_t remote;
    } rows[] = {
        {0x01420100, 43, true, 0x01}, {0x01420000, 43, true, 0},    {0x213A0100, 29, false, 0x21},
        {0x213A0100, 28, false, 0},   {0x21420100, 28, true, 0x21},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(sslbp_status(rows[i].cs, rows[i].minor, rows[i].after_doit).remote, rows[i].remote);
}

static void a_status_is_told_in_words_and_never_past_the_buffer(void **state)
{
    (void)state;
    char text[200];
    /* As recorded from an empty channel. */
    struct sslbp_status status = sslbp_status(0x0000E188, 43, false);
    assert_string_equal(sslbp_status_text(&status, text, sizeof text),
                        "time-out, too many errors; remote fault, communication error, no remote answers, not ready");
    status = sslbp_status(0x01420100, 43, true);
    assert_string_equal(sslbp_status_text(&status, text, sizeof text), "remote fault; remote: watchdog has bitten");
    status = sslbp_status(0, 43, true);
    assert_string_equal(sslbp_status_text(&status, text, sizeof text), "no fault");
    status = sslbp_status(0xFFFFFFFF, 43, true);
    for (size_t size = 0; size < sizeof text; size++) {
        memset(text, '#', sizeof text);
        (void)sslbp_status_text(&status, text, size);
        assert_true(size == 0 || memchr(text, 0, size));
        assert_int_equal(text[size], '#');
    }
}

/* ---- process data -------------------------------------------------------------------------------------------------
 */

static void fields_cross_words_and_leave_their_neighbours_alone(void **state)
{
    (void)state;
    for (unsigned at = 0; at < 96; at++)
        for (unsigned bits = 1; bits <= 64 && at + bits <= 96; bits++) {
            uint32_t ones[4] = {UINT32_MAX, UINT32_MAX, UINT32_MAX, 0x5A5A5A5A}, zeros[4] = {0, 0, 0, 0x5A5A5A5A};
            const uint64_t mask = bits == 64 ? UINT64_MAX : (UINT64_C(1) << bits) - 1u;
            const uint64_t value = UINT64_C(0x9E3779B97F4A7C15) * (at + 1u) + bits;
            sslbp_put_bits(ones, at, bits, value);
            sslbp_put_bits(zeros, at, bits, value);
            assert_true(sslbp_get_bits(ones, at, bits) == (value & mask));
            assert_true(sslbp_get_bits(zeros, at, bits) == (value & mask));
            for (unsigned bit = 0; bit < 96; bit++)
                if (bit < at || bit >= at + bits) {
                    assert_int_equal(ones[bit / 32] >> bit % 32 & 1u, 1);
                    assert_int_equal(zeros[bit / 32] >> bit % 32 & 1u, 0);
                }
            assert_int_equal(ones[3], 0x5A5A5A5A);
            assert_int_equal(zeros[3], 0x5A5A5A5A);
        }
}

/* Values that LinuxCNC's driver was seen to send (hal-interface 2.19 and 7.5). */
static void numbers_are_scaled_as_linuxcnc_scales(void **state)
{
    (void)state;
    assert_true(sslbp_to_signed(5, 16, 10) == 0x3FFF);
    assert_true(sslbp_to_unsigned(50, 12, 100) == 0x7FF);
    assert_true(sslbp_to_signed(-10, 16, 10) == 0x8000);
    assert_true(sslbp_to_signed(10, 16, 10) == 0x7FFF);
    assert_true(sslbp_to_unsigned(-1, 8, 10) == 0);
    assert_true(sslbp_to_unsigned(11, 8, 10) == 0xFF);
    assert_true(fabs(sslbp_from_unsigned(255, 8, 36.3) - 36.3) < 1e-12);
    assert_true(fabs(sslbp_from_signed(0x7FFF, 16, 10) - 9.9997) < 1e-3);
    assert_true(fabs(sslbp_from_signed(0x8000, 16, 10) + 10) < 1e-6);
    assert_true(fabs(sslbp_from_unsigned(UINT32_MAX, 32, 7) - 7) < 1e-12);
    assert_true(fabs(sslbp_from_signed(sslbp_to_signed(-3.25, 48, 10), 48, 10) + 3.25) < 1e-9);
}

static void nothing_that_a_pin_may_hold_breaks_a_conversion(void **state)
{
    (void)state;
    static const double values[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 0, 1, -1, 5e-324};
    for (size_t v = 0; v < sizeof values / sizeof values[0]; v++)
        for (size_t s = 0; s < sizeof values / sizeof values[0]; s++)
            for (unsigned bits = 2; bits <= 64; bits++) {
                const uint64_t mask = bits == 64 ? UINT64_MAX : (UINT64_C(1) << bits) - 1u;
                assert_true((sslbp_to_unsigned(values[v], bits, values[s]) & ~mask) == 0);
                assert_true((sslbp_to_signed(values[v], bits, values[s]) & ~mask) == 0);
            }
    assert_true(sslbp_to_unsigned(NAN, 8, 1) == 0);
    assert_true(sslbp_to_signed(5, 8, 0) == 0);
    assert_true(isfinite(sslbp_from_float(sslbp_to_float(1e300, 32), 32)));
    assert_true(sslbp_from_float(sslbp_to_float(1.5, 32), 32) == 1.5);
    assert_true(sslbp_from_float(sslbp_to_float(-1e300, 64), 64) == -1e300);
}

/* ---- tables -------------------------------------------------------------------------------------------------------
 */

struct memory {
    uint8_t bytes[0x10000];
    unsigned reads;
};

static int read_memory(void *const access, const uint16_t address, const unsigned bytes, uint32_t *const value)
{
    struct memory *const memory = access;
    *value = 0;
    memory->reads++;
    for (unsigned i = 0; i < bytes; i++)
        *value |= (uint32_t)memory->bytes[(uint16_t)(address + i)] << 8u * i;
    return 0;
}

static void put_single(uint8_t *const at, const float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    hm2_put_le32(at, word);
}

struct record {
    uint8_t bits, type, direction;
    float min, max;
    uint16_t address;
    const char *unit, *name;
};

static uint16_t put_record(struct memory *const memory, const uint16_t at, const struct record *const record)
{
    uint8_t *const bytes = memory->bytes + at;
    const size_t unit = strlen(record->unit) + 1;
    bytes[0] = 0xA0;
    bytes[1] = record->bits;
    bytes[2] = record->type;
    bytes[3] = record->direction;
    put_single(bytes + 4, record->min);
    put_single(bytes + 8, record->max);
    hm2_put_le16(bytes + 12, record->address);
    memcpy(bytes + 14, record->unit, unit);
    memcpy(bytes + 14 + unit, record->name, strlen(record->name) + 1);
    return (uint16_t)(at + 14 + unit + strlen(record->name) + 1);
}

#define PTOC 0x100
#define GTOC 0x200

/* Process records, then a mode in the PTOC, all of them and `globals` in the GTOC. */
static struct memory *make_memory(const struct record *const process, const unsigned process_count,
                                  const struct record *const globals, const unsigned global_count)
{
    struct memory *const memory = calloc(1, sizeof *memory);
    assert_non_null(memory);
    uint16_t at = 0x400;
    unsigned toc = 0;
    for (unsigned i = 0; i < process_count; i++, toc++) {
        hm2_put_le16(memory->bytes + PTOC + 2 * i, at);
        hm2_put_le16(memory->bytes + GTOC + 2 * toc, at);
        at = put_record(memory, at, &process[i]);
    }
    hm2_put_le16(memory->bytes + PTOC + 2 * process_count, at);
    memcpy(memory->bytes + at, "\xB0\x02\x01\x00IO_Ana", 11);
    at = (uint16_t)(at + 16);
    for (unsigned i = 0; i < global_count; i++, toc++) {
        hm2_put_le16(memory->bytes + GTOC + 2 * toc, at);
        at = put_record(memory, at, &globals[i]);
    }
    return memory;
}

static const struct sslbp_identity identity = {0x12345678, 0x37374937, PTOC, GTOC};

static int read_tables(struct memory *const memory, struct sslbp_tables *const tables, struct hm2_diag *const diag)
{
    const struct sslbp_memory access = {memory, read_memory};
    return sslbp_read_tables(&access, &identity, 96, "remote", tables, diag);
}

static void tables_become_fields_parameters_and_modes(void **state)
{
    (void)state;
    static const struct record process[] = {
        {8, SSLBP_BITS, SSLBP_INPUT, 0, 0, 0x600, "", "Input"},
        {16, SSLBP_SIGNED, SSLBP_OUTPUT, -10, 10, 0x640, "Volts", "Analog Out#0"},
        {3, SSLBP_PAD, SSLBP_BOTH, 0, 0, 0, "", ""},
        {12, SSLBP_UNSIGNED, SSLBP_BOTH, NAN, INFINITY, 0x642, "", "Both"},
    };
    static const struct record globals[] = {
        {16, SSLBP_NV_SIGNED, SSLBP_BOTH, 0, 0, 0x700, "ms", "NVTrim"},
        {8, SSLBP_STREAM, SSLBP_INPUT, 0, 0, 0x710, "", "Hidden"},
    };
    struct memory *const memory = make_memory(process, 4, globals, 2);
    struct sslbp_tables tables;
    struct hm2_diag diag = {0};
    if (read_tables(memory, &tables, &diag) != 0)
        fail_msg("%s", diag.text);
    assert_int_equal(tables.process_count, 4);
    assert_int_equal(tables.in_bits, 8 + 3 + 12);
    assert_int_equal(tables.out_bits, 16 + 3 + 12);
    assert_string_equal(tables.process[0].name, "input");
    assert_string_equal(tables.process[1].name, "analog-out-0");
    assert_string_equal(tables.process[1].unit, "volts");
    assert_true(tables.process[1].min == -10 && tables.process[1].max == 10);
    assert_true(tables.process[0].min == 0 && tables.process[0].max == 1);
    assert_true(tables.process[3].min == 0 && tables.process[3].max == 1);
    assert_int_equal(tables.global_count, 1);
    assert_string_equal(tables.global[0].name, "nvtrim");
    assert_int_equal(sslbp_field_bytes(&tables.global[0]), 2);
    assert_true(sslbp_is_nonvolatile(&tables.global[0]) && sslbp_is_signed(&tables.global[0]));
    assert_int_equal(tables.mode_count, 1);
    assert_string_equal(tables.mode[0].name, "io_ana");
    assert_int_equal(tables.mode[0].index, 2);
    free(memory);
}

static void records_that_make_no_sense_are_refused_with_their_place(void **state)
{
    (void)state;
    static const struct record bad[] = {
        {0, SSLBP_BITS, SSLBP_INPUT, 0, 0, 0x600, "", "Zero"},
        {97, SSLBP_BITS, SSLBP_INPUT, 0, 0, 0x600, "", "Wide"},
        {65, SSLBP_UNSIGNED, SSLBP_INPUT, 0, 0, 0x600, "", "Wide"},
        {8, SSLBP_NV_UNSIGNED, SSLBP_INPUT, 0, 0, 0x600, "", "NV"},
        {8, 0x77, SSLBP_INPUT, 0, 0, 0x600, "", "Unknown"},
        {8, SSLBP_BITS, 0x20, 0, 0, 0x600, "", "Direction"},
        {8, SSLBP_BITS, 0xC0, 0, 0, 0x600, "", "Direction"},
        {8, SSLBP_ENCODER, SSLBP_OUTPUT, 0, 0, 0x600, "", "Encoder"},
        {16, SSLBP_FLOAT, SSLBP_INPUT, 0, 0, 0x600, "", "Half"},
        {8, SSLBP_BITS, SSLBP_INPUT, 0, 0, 0x600, "", ""},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct memory *const memory = make_memory(&bad[i], 1, NULL, 0);
        struct sslbp_tables tables;
        struct hm2_diag diag = {0};
        assert_int_equal(read_tables(memory, &tables, &diag), HM2_ERR_MALFORMED);
        assert_int_equal(diag.problems, 1);
        free(memory);
    }
}

static void a_table_without_an_end_ends(void **state)
{
    (void)state;
    struct memory *const memory = calloc(1, sizeof *memory);
    assert_non_null(memory);
    memset(memory->bytes, 0x55, sizeof memory->bytes);
    struct sslbp_tables tables;
    struct hm2_diag diag = {0};
    assert_int_equal(read_tables(memory, &tables, &diag), HM2_ERR_MALFORMED);
    assert_non_null(strstr(diag.text, "the PTOC at 0x0100 has no end within 256 entries"));
    assert_true(memory->reads < 1000);
    free(memory);
}

static void a_name_without_an_end_is_cut(void **state)
{
    (void)state;
    static const struct record process[] = {
        {8, SSLBP_BITS, SSLBP_INPUT, 0, 0, 0x600, "", "ANameOfFarMoreThanFortyEightCharactersThatNobodyWouldEverUse"}};
    struct memory *const memory = make_memory(process, 1, NULL, 0);
    struct sslbp_tables tables;
    assert_int_equal(read_tables(memory, &tables, NULL), 0);
    assert_string_equal(tables.process[0].name, "anameoffarmorethanfortyeightcharactersthatnobody");
    free(memory);
}

/* ---- a scripted port ----------------------------------------------------------------------------------------------
 */

/* Registers of a port whose firmware answers a command after so many looks at it. */
struct fake_port {
    uint32_t command, data, cs[8], user[3][8];
    uint32_t data_out, local[0x400];
    unsigned looks, latency;
    unsigned result; /* data register after START and DOIT */
    bool deaf;
    int64_t now_ns;
    uint32_t log[64];
    unsigned logged;
    struct memory *memory;
};

enum { COMMAND = 0x5B00, DATA = 0x5C00, CS = 0x5D00, USER = 0x5E00 };

static void carry_out(struct fake_port *const fake)
{
    const uint32_t command = fake->command;
    fake->command = 0;
    if (command & 0x2000u && command & 0x8000u)
        fake->local[command & 0x3FFu] = fake->data_out & 0xFFu;
    else if (command & 0x2000u)
        fake->data = fake->local[command & 0x3FFu];
    else if (command & 0x1000u || command & 0x700u)
        fake->data = fake->result;
    if (command & 0x1000u && fake->memory) {
        const unsigned size = 1u << (fake->cs[0] >> 24 & 3u);
        (void)read_memory(fake->memory, (uint16_t)fake->cs[0], size > 4 ? 4 : size, &fake->user[0][0]);
    }
}

static int fake_read(void *const access, const uint16_t address, const unsigned words, uint32_t *const values)
{
    struct fake_port *const fake = access;
    fake->now_ns += 50000;
    assert_int_equal(words, 1);
    if (address == COMMAND) {
        if (fake->command && !fake->deaf && fake->looks++ >= fake->latency)
            carry_out(fake);
        *values = fake->command;
    } else if (address == DATA) {
        *values = fake->data;
    } else if (address < USER) {
        *values = 0; /* a CS register: no fault */
    } else {
        *values = fake->user[(address - USER) / 0x100][(address & 0x1F) / 4];
    }
    return 0;
}

static int fake_write(void *const access, const uint16_t address, const unsigned words, const uint32_t *const values)
{
    struct fake_port *const fake = access;
    fake->now_ns += 50000;
    assert_int_equal(words, 1);
    if (address == COMMAND) {
        /* The rule of the manual: never while it is not clear, but for a reset or STOP ALL. */
        if (fake->command && values[0] != SSLBP_RELEASE && values[0] != SSLBP_STOP && values[0] != SSLBP_RESET)
            fail_msg("command %X written while %X is there", (unsigned)values[0], (unsigned)fake->command);
        if (fake->logged < 64)
            fake->log[fake->logged++] = values[0];
        fake->command = values[0];
        fake->looks = 0;
    } else if (address == DATA) {
        fake->data_out = values[0];
    } else if (address >= CS && address < CS + 32) {
        fake->cs[(address - CS) / 4] = values[0];
    }
    return 0;
}

static int64_t fake_now(void *const access)
{
    return ((const struct fake_port *)access)->now_ns;
}

static struct sslbp_port port_of(struct fake_port *const fake, struct hm2_diag *const diag)
{
    return (struct sslbp_port){
        .bus = {fake, fake_read, fake_write, fake_now},
        .name = "port",
        .diag = diag,
        .command = COMMAND,
        .data = DATA,
        .cs = CS,
        .user = {USER, USER + 0x100, USER + 0x200},
        .users = 3,
    };
}

/* Local parameters as recorded. */
static struct fake_port fresh_port(void)
{
    return (struct fake_port){.local = {0x12, 8, 1, 0x2B, 0x70, 0x32, 0xD8, 2}, .latency = 3};
}

static void a_port_is_reset_checked_and_stopped(void **state)
{
    (void)state;
    struct fake_port fake = fresh_port();
    struct hm2_diag diag = {0};
    struct sslbp_port port = port_of(&fake, &diag);
    assert_int_equal(sslbp_port_open(&port), 0);
    static const uint32_t expected[] = {0x4000, 0x0001, 0x2003, 0x2000, 0x2001, 0x2002, 0x2007, 0x0800};
    assert_int_equal(fake.logged, sizeof expected / sizeof expected[0]);
    assert_memory_equal(fake.log, expected, sizeof expected);
    assert_int_equal(port.major, 1);
    assert_int_equal(port.minor, 43);
    assert_int_equal(port.channels, 2);
}

static void a_port_of_other_firmware_is_refused(void **state)
{
    (void)state;
    struct fake_port fake = fresh_port();
    struct hm2_diag diag = {0};
    struct sslbp_port port = port_of(&fake, &diag);
    fake.local[0] = 0x11;
    assert_int_equal(sslbp_port_open(&port), HM2_ERR_MISMATCH);
    assert_non_null(strstr(diag.text, "interface type 0x11"));
}

static void a_deaf_port_is_given_up_after_a_bounded_time(void **state)
{
    (void)state;
    struct fake_port fake = fresh_port();
    struct hm2_diag diag = {0};
    struct sslbp_port port = port_of(&fake, &diag);
    fake.deaf = true;
    assert_int_equal(sslbp_port_open(&port), HM2_ERR_TIMEOUT);
    assert_true(fake.now_ns >= 1000 * MS && fake.now_ns < 1100 * MS);
    assert_int_equal(diag.problems, 1);
}

static void a_start_tells_who_did_not_start(void **state)
{
    (void)state;
    struct fake_port fake = fresh_port();
    struct sslbp_port port = port_of(&fake, NULL);
    static const uint8_t modes[8] = {2, 0};
    unsigned failed = 0;
    fake.result = 2;
    assert_int_equal(sslbp_port_start(&port, 3, false, modes, &failed), 0);
    assert_int_equal(failed, 2);
    static const uint32_t expected[] = {0x0800, 0x0903};
    assert_memory_equal(fake.log, expected, sizeof expected);
    assert_int_equal(fake.cs[0], 0x02000000);
}

static void a_baud_rate_goes_byte_by_byte_to_every_channel(void **state)
{
    (void)state;
    struct fake_port fake = fresh_port();
    struct hm2_diag diag = {0};
    struct sslbp_port port = port_of(&fake, &diag);
    port.channels = 2;
    port.minor = 43;
    assert_int_equal(sslbp_port_baud(&port, 115200), 0);
    for (unsigned channel = 0; channel < 2; channel++)
        for (unsigned i = 0; i < 4; i++)
            assert_int_equal(fake.local[0x70 + channel * 0x32 + 42 + i], 115200u >> 8 * i & 0xFFu);
    port.minor = 33;
    assert_int_equal(sslbp_port_baud(&port, 115200), HM2_ERR_UNSUPPORTED);
}

static void remote_reads_go_through_cs_and_doit(void **state)
{
    (void)state;
    static const struct record process[] = {{8, SSLBP_BITS, SSLBP_INPUT, 0, 0, 0x600, "", "Input"}};
    struct fake_port fake = fresh_port();
    struct hm2_diag diag = {0};
    struct sslbp_port port = port_of(&fake, &diag);
    struct sslbp_tables tables;
    uint64_t value;
    fake.memory = make_memory(process, 1, NULL, 0);
    assert_int_equal(sslbp_remote_read(&port, 0, 0x100, 2, &value), 0);
    assert_int_equal(value, 0x400);
    assert_int_equal(fake.cs[0], 0x45000100);
    assert_int_equal(fake.log[0], 0x1001);
    assert_int_equal(sslbp_discover(&port, 0, &identity, "remote", &tables), 0);
    assert_int_equal(tables.process_count, 1);
    fake.result = 1;
    assert_int_equal(sslbp_remote_read(&port, 0, 0x100, 2, &value), HM2_ERR_IO);
    assert_non_null(strstr(diag.text, "channel 0: reading the remote's address 0x0100 failed"));
    free(fake.memory);
}

static void card_names_are_those_of_hal(void **state)
{
    (void)state;
    static const struct {
        uint32_t name;
        const char *text;
    } rows[] = {{0x37374937, "7i77"}, {0x30324938, "8i20"}, {0x00004937, "7i"}, {0x2F2E4937, "7i--"}, {0, ""}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[5];
        sslbp_card_name(&(struct sslbp_identity){.name = rows[i].name}, text);
        assert_string_equal(text, rows[i].text);
    }
}

/* ---- engine -------------------------------------------------------------------------------------------------------
 */

struct bench {
    struct sslbp_engine engine;
    struct sslbp_wish wish;
    uint32_t command, data, cs[8], user[8][3]; /* what the next reply shows */
    bool write_lost;
    bool early, out_of_order; /* replies to turns; an older write has come before the last */
    struct sslbp_orders orders;
};

static struct bench new_bench(const unsigned mask)
{
    struct bench b = {.wish = {.run = true, .fault_inc = 10, .fault_dec = 1, .fault_lim = 200}};
    sslbp_engine_init(&b.engine);
    b.engine.mask = (uint8_t)mask;
    b.engine.minor = 43;
    for (unsigned i = 0; i < 8; i++) {
        b.engine.channel[i].identity = identity;
        b.user[i][0] = identity.unit;
        b.user[i][1] = identity.name;
        b.user[i][2] = (uint32_t)identity.gtoc << 16 | identity.ptoc;
    }
    return b;
}

static unsigned take(struct bench *const b)
{
    const struct sslbp_reply reply = {.command = b->command,
                                      .data = b->data,
                                      .cs = b->cs,
                                      .user = (const uint32_t(*)[3])b->user,
                                      .write_lost = b->write_lost,
                                      .early = b->early,
                                      .in_order = b->early && !b->out_of_order,
                                      .now_ns = b->wish.now_ns};
    b->write_lost = b->out_of_order = false;
    return sslbp_engine_take(&b->engine, &reply, &b->wish);
}

static uint32_t next(struct bench *const b)
{
    b->orders = sslbp_engine_next(&b->engine, &b->wish);
    b->wish.now_ns += MS;
    return b->orders.command;
}

static uint32_t step(struct bench *const b)
{
    (void)take(b);
    if (b->engine.step == SSLBP_STEP_SCAN)
        sslbp_engine_scanned(&b->engine);
    return next(b);
}

static void start(struct bench *const b)
{
    assert_int_equal(step(b), 0x0800);
    assert_int_equal(step(b), 0x0900u | b->engine.mask);
    assert_int_equal(step(b), 0x1000u | b->engine.mask);
    assert_int_equal(sslbp_engine_state(&b->engine), SSLBP_RUNNING);
}

static void a_port_is_stopped_started_and_then_exchanges_data_every_cycle(void **state)
{
    (void)state;
    struct bench b = new_bench(3);
    start(&b);
    for (unsigned i = 0; i < 10; i++) {
        assert_int_equal(take(&b), 3);
        assert_int_equal(next(&b), 0x1003);
        assert_int_equal(b.orders.outputs, 3);
    }
    assert_int_equal(b.engine.skipped, 0);
}

static void a_doit_that_must_not_happen_has_the_ignore_bit_and_is_counted(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    start(&b);
    b.command = 0x1001; /* still busy */
    assert_int_equal(take(&b), 0);
    assert_true(next(&b) & SSLBP_IGNORE);
    assert_int_equal(b.orders.outputs, 0);
    assert_int_equal(b.engine.skipped, 1);
    b.command = 0;
    assert_int_equal(take(&b), 1);
    assert_int_equal(b.engine.doit_ns, 2 * MS);
    assert_int_equal(next(&b), 0x1001);
}

static void without_a_reply_nothing_is_ordered_and_the_inputs_of_a_doubtful_doit_are_not_used(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    start(&b);
    assert_true(next(&b) & SSLBP_IGNORE); /* the reply was lost */
    /* Clear: over, or never arrived? The registers may hold what the DOIT before brought. */
    assert_int_equal(take(&b), 0);
    assert_int_equal(next(&b), 0x1001);
    assert_int_equal(take(&b), 1);
    /* Not clear: then it has arrived. */
    assert_int_equal(next(&b), 0x1001);
    assert_true(next(&b) & SSLBP_IGNORE);
    b.command = 0x1001;
    assert_int_equal(take(&b), 0);
    assert_true(next(&b) & SSLBP_IGNORE);
    b.command = 0;
    assert_int_equal(take(&b), 1);
}

static void a_lost_write_brings_no_inputs(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    start(&b);
    b.write_lost = true;
    assert_int_equal(take(&b), 0);
    assert_int_equal(next(&b), 0x1001);
    assert_int_equal(take(&b), 1);
}

static void a_doit_that_is_under_way_in_its_own_packet_is_no_failure_and_is_awaited(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    b.early = true;
    start(&b);
    for (unsigned i = 0; i < 50; i++) {
        b.command = 0x1001;
        assert_int_equal(take(&b), 0);
        assert_true(b.engine.unfinished);
        assert_true(next(&b) & SSLBP_IGNORE);
        b.command = 0;
        assert_int_equal(take(&b), 1);
        assert_false(b.engine.unfinished);
        assert_int_equal(next(&b), 0x1001);
    }
    assert_int_equal(sslbp_engine_faults(&b.engine), 0);
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_RUNNING);
}

static void a_doit_that_outlasts_the_packet_after_its_own_is_a_failure(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    b.early = true;
    start(&b);
    b.command = 0x1001;
    assert_int_equal(take(&b), 0);
    assert_int_equal(sslbp_engine_faults(&b.engine), 0);
    for (unsigned i = 0; i < 30; i++) {
        assert_true(next(&b) & SSLBP_IGNORE);
        assert_int_equal(take(&b), 0);
        assert_false(b.engine.unfinished);
    }
    (void)next(&b);
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_ERROR);
}

static void after_a_lost_reply_the_next_turn_tells_whether_the_doit_arrived(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    b.early = true;
    start(&b);
    assert_true(next(&b) & SSLBP_IGNORE);
    assert_int_equal(take(&b), 1); /* it did: its inputs are used */
    assert_int_equal(next(&b), 0x1001);
    assert_true(next(&b) & SSLBP_IGNORE);
    b.out_of_order = true;
    assert_int_equal(take(&b), 0); /* it did not: the registers hold what the one before brought */
    assert_int_equal(next(&b), 0x1001);
    assert_true(next(&b) & SSLBP_IGNORE);
    assert_true(next(&b) & SSLBP_IGNORE);
    assert_int_equal(take(&b), 0); /* two are lost: nobody knows */
    assert_int_equal(next(&b), 0x1001);
    assert_int_equal(take(&b), 1);
}

static void a_start_of_a_turn_that_never_arrived_begins_with_a_stop_again(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    b.early = true;
    assert_int_equal(step(&b), 0x0800);
    assert_int_equal(step(&b), 0x0901);
    assert_true(next(&b) & SSLBP_IGNORE);
    b.out_of_order = true;
    assert_int_equal(step(&b), 0x0800);
    assert_int_equal(step(&b), 0x0901);
    assert_true(next(&b) & SSLBP_IGNORE);
    assert_int_equal(step(&b), 0x1001); /* this one did */
}

/* The older packet's DOIT may have been under way, and ours was lost. */
static void behind_an_older_packet_that_comes_late_a_clear_register_proves_nothing(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    b.early = true;
    start(&b);
    assert_int_equal(take(&b), 1);
    assert_int_equal(next(&b), 0x1001);
    b.out_of_order = true;
    assert_int_equal(take(&b), 0);
    assert_int_equal(next(&b), 0x1001);
    assert_int_equal(take(&b), 1);
    assert_int_equal(sslbp_engine_faults(&b.engine), 0);
}

static void a_lost_start_begins_with_a_stop_again(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    assert_int_equal(step(&b), 0x0800);
    assert_int_equal(step(&b), 0x0901);
    b.write_lost = true;
    assert_int_equal(step(&b), 0x0800);
    assert_int_equal(step(&b), 0x0901);
    assert_int_equal(step(&b), 0x1001);
}

static void a_channel_that_fails_is_stopped_alone_after_23_failures(void **state)
{
    (void)state;
    struct bench b = new_bench(3);
    start(&b);
    b.data = 2;
    unsigned failures = 0;
    while (!b.engine.channel[1].lost) {
        assert_int_equal(take(&b), 1);
        failures++;
        assert_true(failures < 100);
        assert_false(next(&b) & SSLBP_IGNORE);
    }
    assert_int_equal(failures, 23);
    assert_int_equal(take(&b), 1);
    assert_int_equal(next(&b), 0x1001);
    assert_int_equal(b.orders.silent, 2);
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_RUNNING);
}

static void the_last_channel_that_fails_stops_the_port_until_run_changes(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    start(&b);
    b.data = 1;
    for (unsigned i = 0; i < 30; i++)
        (void)step(&b);
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_ERROR);
    for (unsigned i = 0; i < 10000; i++)
        assert_true(step(&b) & SSLBP_IGNORE);
    b.data = 0;
    b.wish.run = false;
    (void)step(&b);
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_IDLE);
    b.wish.run = true;
    start(&b);
}

static void failed_starts_are_repeated_with_growing_pauses_on_request(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    int64_t before_ns = 0, pause_ns = 0;
    b.wish.restart = true;
    b.data = 1; /* START: the channel is not ready */
    for (unsigned i = 0; i < 60000; i++)
        if (step(&b) == 0x0901) {
            const int64_t now_pause_ns = b.wish.now_ns - before_ns;
            assert_true(now_pause_ns >= pause_ns || pause_ns == 0 || now_pause_ns >= 10000 * MS);
            pause_ns = now_pause_ns;
            before_ns = b.wish.now_ns;
        }
    assert_true(b.engine.restarts >= 8 && b.engine.restarts <= 14);
    assert_true(pause_ns >= 10000 * MS && pause_ns <= 10010 * MS);
}

static void another_remote_than_at_load_is_not_driven(void **state)
{
    (void)state;
    struct bench b = new_bench(3);
    b.user[0][0]++;
    (void)step(&b);
    (void)step(&b);
    assert_int_equal(step(&b), 0x1002);
    assert_false(b.engine.channel[0].started);
    assert_true(b.orders.silent & 1);
}

static void a_stuck_command_register_takes_a_reset(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    b.command = 0x0F01;
    assert_int_equal(step(&b), SSLBP_RESET);
    b.command = SSLBP_RESET;
    assert_int_equal(step(&b), SSLBP_RELEASE);
    b.command = 0;
    start(&b);
}

static void a_start_that_never_ends_is_an_error(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    (void)step(&b);
    assert_int_equal(step(&b), 0x0901);
    b.command = 0x0901;
    for (unsigned i = 0; i < 2200; i++)
        assert_true(step(&b) & SSLBP_IGNORE);
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_ERROR);
}

static void on_hold_nothing_is_ordered_and_all_starts_anew_after(void **state)
{
    (void)state;
    struct bench b = new_bench(1);
    start(&b);
    b.wish.hold = true;
    for (unsigned i = 0; i < 100; i++) {
        assert_true(step(&b) & SSLBP_IGNORE);
        assert_int_equal(b.orders.silent, 1);
    }
    assert_int_equal(sslbp_engine_state(&b.engine), SSLBP_IDLE);
    b.wish.hold = false;
    start(&b);
}

static void a_nonvolatile_parameter_is_opened_written_and_closed(void **state)
{
    (void)state;
    static const struct {
        uint32_t command, cs;
        uint64_t value;
    } expected[] = {
        {0x0800, 0, 0},          {0x0F02, 0, 0}, {0x1002, 0xEC000000, 1}, {0x1002, 0x65000700, 0x1234},
        {0x1002, 0xEC000000, 0}, {0x0800, 0, 0},
    };
    struct bench b = new_bench(2);
    assert_int_equal(step(&b), 0x0800);
    (void)take(&b);
    assert_int_equal(b.engine.step, SSLBP_STEP_SCAN);
    sslbp_engine_job(&b.engine, &(struct sslbp_job){1, 2, true, 0x700, 0x1234});
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        assert_int_equal(next(&b), expected[i].command);
        assert_int_equal(b.orders.job, expected[i].cs != 0);
        if (b.orders.job) {
            assert_int_equal(b.orders.job_channel, 1);
            assert_int_equal(b.orders.job_cs, expected[i].cs);
            assert_int_equal(b.orders.job_value, expected[i].value);
        }
        (void)take(&b);
    }
    assert_int_equal(b.engine.job_state, SSLBP_JOB_DONE);
    assert_int_equal(b.engine.step, SSLBP_STEP_SCAN);
}

static void a_parameter_that_is_refused_is_told_and_the_way_is_closed(void **state)
{
    (void)state;
    struct bench b = new_bench(2);
    (void)step(&b);
    (void)take(&b);
    sslbp_engine_job(&b.engine, &(struct sslbp_job){1, 2, true, 0x700, 0x1234});
    for (unsigned i = 0; i < 3; i++) { /* STOP ALL, START, open */
        (void)next(&b);
        (void)take(&b);
    }
    (void)next(&b);
    b.data = 2;
    (void)take(&b);
    b.data = 0;
    assert_int_equal(b.engine.job_state, SSLBP_JOB_FAILED);
    assert_int_equal(next(&b), 0x1002);
    assert_int_equal(b.orders.job_cs, 0xEC000000);
    assert_int_equal(b.orders.job_value, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sticky_faults_count_only_with_a_communication_error),
        cmocka_unit_test(faults_of_the_remote_count_when_its_bit_is_set_and_before_a_doit_from_firmware_29_on),
        cmocka_unit_test(a_status_is_told_in_words_and_never_past_the_buffer),
        cmocka_unit_test(fields_cross_words_and_leave_their_neighbours_alone),
        cmocka_unit_test(numbers_are_scaled_as_linuxcnc_scales),
        cmocka_unit_test(nothing_that_a_pin_may_hold_breaks_a_conversion),
        cmocka_unit_test(tables_become_fields_parameters_and_modes),
        cmocka_unit_test(records_that_make_no_sense_are_refused_with_their_place),
        cmocka_unit_test(a_table_without_an_end_ends),
        cmocka_unit_test(a_name_without_an_end_is_cut),
        cmocka_unit_test(a_port_is_reset_checked_and_stopped),
        cmocka_unit_test(a_port_of_other_firmware_is_refused),
        cmocka_unit_test(a_deaf_port_is_given_up_after_a_bounded_time),
        cmocka_unit_test(a_start_tells_who_did_not_start),
        cmocka_unit_test(a_baud_rate_goes_byte_by_byte_to_every_channel),
        cmocka_unit_test(remote_reads_go_through_cs_and_doit),
        cmocka_unit_test(card_names_are_those_of_hal),
        cmocka_unit_test(a_port_is_stopped_started_and_then_exchanges_data_every_cycle),
        cmocka_unit_test(a_doit_that_must_not_happen_has_the_ignore_bit_and_is_counted),
        cmocka_unit_test(without_a_reply_nothing_is_ordered_and_the_inputs_of_a_doubtful_doit_are_not_used),
        cmocka_unit_test(a_lost_write_brings_no_inputs),
        cmocka_unit_test(a_doit_that_is_under_way_in_its_own_packet_is_no_failure_and_is_awaited),
        cmocka_unit_test(a_doit_that_outlasts_the_packet_after_its_own_is_a_failure),
        cmocka_unit_test(after_a_lost_reply_the_next_turn_tells_whether_the_doit_arrived),
        cmocka_unit_test(a_start_of_a_turn_that_never_arrived_begins_with_a_stop_again),
        cmocka_unit_test(behind_an_older_packet_that_comes_late_a_clear_register_proves_nothing),
        cmocka_unit_test(a_lost_start_begins_with_a_stop_again),
        cmocka_unit_test(a_channel_that_fails_is_stopped_alone_after_23_failures),
        cmocka_unit_test(the_last_channel_that_fails_stops_the_port_until_run_changes),
        cmocka_unit_test(failed_starts_are_repeated_with_growing_pauses_on_request),
        cmocka_unit_test(another_remote_than_at_load_is_not_driven),
        cmocka_unit_test(a_stuck_command_register_takes_a_reset),
        cmocka_unit_test(a_start_that_never_ends_is_an_error),
        cmocka_unit_test(on_hold_nothing_is_ordered_and_all_starts_anew_after),
        cmocka_unit_test(a_nonvolatile_parameter_is_opened_written_and_closed),
        cmocka_unit_test(a_parameter_that_is_refused_is_told_and_the_way_is_closed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
