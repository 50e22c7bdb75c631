/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "idrom_files.h"

/* Word of the ROM at a byte offset from its start. */
#define ROM(image, offset) ((image).rom[(offset) / 4u])

enum { MODULES = 0x40, PINS = 0x1C0 };

static struct hm2_image image_7i96s(void)
{
    struct hm2_image image;
    load_image(IDROM_7I96S, &image);
    return image;
}

static const struct hm2_idrom_expect expect_7i96s = {"7I96S", 3, 17};

/* ---- good images ------------------------------------------------------------------------------------------------ */

static void the_7i96s_image_parses_completely(void **state)
{
    (void)state;
    const struct hm2_image image = image_7i96s();
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    if (hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag) != 0)
        fail_msg("%s", diag.text);
    assert_int_equal(diag.problems + diag.warnings, 0);
    assert_int_equal(rom.type, 3);
    assert_string_equal(rom.board_name, "MESA7I96");
    assert_int_equal(rom.fpga_size, 20);
    assert_int_equal(rom.fpga_pins, 256);
    assert_int_equal(rom.clock_low_hz, 100000000);
    assert_int_equal(rom.clock_high_hz, 200000000);
    assert_int_equal(rom.module_count, 11);
    assert_int_equal(rom.pin_count, 51);

    const struct hm2_md *const stepgen = hm2_idrom_find(&rom, HM2_GTAG_STEPGEN);
    assert_non_null(stepgen);
    assert_int_equal(stepgen->version, 2);
    assert_int_equal(stepgen->instances, 5);
    assert_int_equal(stepgen->registers, 10);
    assert_int_equal(stepgen->multiple, 0x1FF);
    assert_int_equal(stepgen->clock_hz, 100000000);
    assert_int_equal(hm2_md_address(stepgen, 0, 4), 0x2010);
    assert_int_equal(hm2_md_address(stepgen, 1, 4), 0x2110);
    assert_int_equal(hm2_md_address(stepgen, 9, 4), 0x2900);
    assert_int_equal(hm2_idrom_find(&rom, HM2_GTAG_PWMGEN)->clock_hz, 200000000);
    assert_int_equal(hm2_idrom_find(&rom, HM2_GTAG_SSERIAL)->instance_stride, 64);
    assert_null(hm2_idrom_find(&rom, HM2_GTAG_MUXED_ENCODER));

    assert_int_equal(rom.pins[18].secondary_pin, 0x82);
    assert_int_equal(rom.pins[18].secondary_tag, HM2_GTAG_STEPGEN);
    assert_int_equal(rom.pins[19].secondary_unit, 1);
    assert_int_equal(rom.pins[50].primary_tag, HM2_GTAG_IOPORT);
}

struct index_name {
    const char *name;
    uint8_t gtag;
};

static const struct index_name index_names[] = {
    {"watchdog", 0x02}, {"ioport", 0x03}, {"qcount", 0x04}, {"stepgen", 0x05}, {"pwm", 0x06},      {"spi", 0x07},
    {"sssi", 0x08},     {"uartt", 0x09},  {"uartr", 0x0A},  {"addrx", 0x0B},   {"mqcount", 0x0C},  {"mqcntsel", 0x0D},
    {"bspi", 0x0E},     {"dbspi", 0x0F},  {"tppwm", 0x13},  {"wavegen", 0x14}, {"daqfifo", 0x15},  {"binosc", 0x16},
    {"dmdma", 0x17},    {"biss", 0x18},   {"fabs", 0x19},   {"hm2dpll", 0x1A}, {"pktuartt", 0x1B}, {"pktuartr", 0x1C},
    {"sigma5", 0x1F},   {"led", 0x80},    {"resmod", 0xC0}, {"sserial", 0xC1}, {"twiddler", 0xC2},
};

/* The module list as index.csv writes it. */
static void format_modules(const struct hm2_idrom *const rom, char *const text, const size_t size)
{
    size_t used = 0;
    for (unsigned i = 0; i < rom->module_count; i++) {
        const char *name = "?";
        for (size_t k = 0; k < sizeof index_names / sizeof index_names[0]; k++)
            if (index_names[k].gtag == rom->modules[i].gtag)
                name = index_names[k].name;
        used += (size_t)snprintf(text + used, size - used, "%s%s:%u", i ? " " : "", name, rom->modules[i].instances);
        if (rom->modules[i].version)
            used += (size_t)snprintf(text + used, size - used, "v%u", rom->modules[i].version);
    }
}

/* The images that contradict themselves, as their source has them: what IOPort module and header say. */
static const struct {
    const char *file;
    unsigned found, header, used;
} inconsistent[] = {
    {"7I77E_51.hex", 4, 3, 3},    {"BOSSV.hex", 2, 3, 2},           {"OLDBOSSV.hex", 2, 3, 2},
    {"SSSV8_48_96.hex", 4, 2, 2}, {"SVST2_4_7I47_96.hex", 3, 4, 3},
};

static void check_remarks(const char *const file, const struct hm2_idrom *const rom, const struct hm2_diag *const diag)
{
    char sentence[192] = "";
    unsigned used = rom->io_ports;
    for (size_t i = 0; i < sizeof inconsistent / sizeof inconsistent[0]; i++) {
        if (strcmp(inconsistent[i].file, file) != 0)
            continue;
        used = inconsistent[i].used;
        (void)snprintf(sentence, sizeof sentence,
                       "warning: this card: module descriptor 1 (IOPort): instances is %u, expected IOPorts of the "
                       "header, %u; the first %u are used\n",
                       inconsistent[i].found, inconsistent[i].header, used);
    }
    assert_string_equal(diag->text, sentence);
    assert_int_equal(hm2_idrom_ports(rom), used);
}

/* One line of index.csv: file, card, board, ports, width, clock low, clock high, modules. */
static void check_index_line(char *const line)
{
    char *field[8];
    char *rest = line;
    for (unsigned i = 0; i < 8; i++) {
        field[i] = strsep(&rest, ",");
        assert_non_null(field[i]);
    }
    char path[512], modules[1024] = "";
    assert_true(snprintf(path, sizeof path, "%s/idrom/%s", TEST_DATA, field[0]) < (int)sizeof path);
    struct hm2_image image;
    load_image(path, &image);
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    if (hm2_idrom_parse(&image, NULL, &rom, &diag) != 0)
        fail_msg("%s: %s", path, diag.text);
    check_remarks(field[0], &rom, &diag);
    assert_memory_equal(rom.board_name + 4, field[2], strlen(field[2]) < 4 ? strlen(field[2]) : 4);
    assert_int_equal(rom.io_ports, strtol(field[3], NULL, 10));
    assert_int_equal(rom.io_width, strtol(field[4], NULL, 10));
    assert_int_equal(rom.pin_count, rom.io_width);
    assert_int_equal(rom.clock_low_hz, strtol(field[5], NULL, 10));
    assert_int_equal(rom.clock_high_hz, strtol(field[6], NULL, 10));
    format_modules(&rom, modules, sizeof modules);
    assert_string_equal(modules, field[7]);
}

static void every_dumped_image_agrees_with_the_index(void **state)
{
    (void)state;
    size_t len;
    char *const text = load_text(TEST_DATA "/idrom/index.csv", &len);
    char *rest = text;
    unsigned images = 0;
    (void)strsep(&rest, "\n");
    for (char *line = strsep(&rest, "\n"); line && *line; line = strsep(&rest, "\n"), images++)
        check_index_line(line);
    assert_int_equal(images, 218);
    free(text);
}

/* ---- single faults ---------------------------------------------------------------------------------------------- */

struct fault {
    bool id;         /* word of the cookie area instead of the ROM */
    uint32_t offset; /* byte offset */
    uint32_t value;
    const char *sentence; /* the one that must be there */
    unsigned problems;    /* sentences in all; several where a wrong word contradicts several others */
};

static const struct fault faults[] = {
    {true, 0x0, 0x55AACAFF, "7I96S: cookie (register 0x0100) is 0x55AACAFF, expected 0x55AACAFE", 1},
    {true, 0x4, 0x54534F47,
     "config name (registers 0x0104, 0x0108) is \"GOSTMOT2\" (0x54534F47 0x32544F4D), expected \"HOSTMOT2\"", 1},
    {true, 0x8, 0x33544F4D, "is \"HOSTMOT3\" (0x54534F48 0x33544F4D), expected \"HOSTMOT2\"", 1},
    {true, 0xC, 0xFFFF, "IDROM pointer (register 0x010C) is 0xFFFF, expected a multiple of 4 from 0x0110", 1},
    {true, 0xC, 0xFC04, "IDROM pointer (register 0x010C) is 0xFC04", 1},
    {true, 0xC, 0x0100, "IDROM pointer (register 0x010C) is 0x0100", 1},
    {false, 0x00, 4, "IDROM type is 4, expected 2 or 3", 1},
    {false, 0x00, 1, "IDROM type is 1, expected 2 or 3", 1},
    {false, 0x04, 0x3C, "OffsetToModules is 60, expected a multiple of 4 from 64 to 1020", 1},
    {false, 0x04, 0x400, "OffsetToModules is 1024, expected a multiple of 4 from 64 to 1020", 1},
    {false, 0x04, 0xFFFFFFFC, "OffsetToModules is 4294967292, expected a multiple of 4", 1},
    {false, 0x04, 0x41, "OffsetToModules is 65, expected a multiple of 4", 1},
    {false, 0x04, 0x1B0, "no IOPort module descriptor (tag 0x03) found among 0, expected one with 3 instances", 1},
    {false, 0x08, 0xFFFFFFFC, "OffsetToPinDesc is 4294967292, expected a multiple of 4 from 64 to 1020", 1},
    {false, 0x08, 0x400, "OffsetToPinDesc is 1024, expected a multiple of 4 from 64 to 1020", 1},
    {false, 0x08, 0x3FC, "the list of pin descriptors at offset 1020 has room for 1 before the ROM ends, expected 51",
     2},
    {false, 0x1C, 0, "IDROM IOPorts is 0, expected at least 1", 3},
    {false, 0x1C, 4, "IDROM IOPorts is 4, expected 3 as this card has", 2},
    {false, 0x20, 50, "IDROM IOWidth is 50, expected IOPorts * PortWidth = 3 * 17 = 51", 1},
    {false, 0x20, 0xFFFFFFFF, "IDROM IOWidth is 4294967295, expected at most 144", 3},
    {false, 0x24, 0, "IDROM PortWidth is 0, expected 1 to 32", 3},
    {false, 0x24, 33, "IDROM PortWidth is 33, expected 1 to 32", 3},
    {false, 0x24, 24, "IDROM PortWidth is 24, expected 17 as this card has", 2},
    {false, 0x28, 999999, "IDROM ClockLow is 999999 Hz, expected at least 1000000 Hz", 1},
    {false, 0x2C, 0, "IDROM ClockHigh is 0 Hz, expected at least 1000000 Hz", 1},
    {false, 0x30, 0, "module descriptor 0 (Hostmot2 DPLL): IDROM instance stride 0 is 0 bytes, expected a multiple",
     10},
    {false, 0x34, 66, "(Smart Serial Interface): IDROM instance stride 1 is 66 bytes, expected a multiple of 4", 1},
    {false, 0x38, 0x10000, "IDROM register stride 0 is 65536 bytes, expected a multiple of 4 from 4 to 65532", 20},
    {false, MODULES, 0x0103001A, "module descriptor 0 (Hostmot2 DPLL): clock tag is 3, expected 1 (ClockLow) or 2", 1},
    {false, MODULES, 0x0100001A, "module descriptor 0 (Hostmot2 DPLL): clock tag is 0, expected 1 (ClockLow) or 2", 1},
    {false, MODULES + 4, 0x02077000, "(Hostmot2 DPLL): register stride selector is 2, expected 0 or 1", 1},
    {false, MODULES + 4, 0xF0077000, "(Hostmot2 DPLL): instance stride selector is 15, expected 0 or 1", 1},
    {false, MODULES + 4, 0x0007FF00, "base address 0xFF00 with 7 registers of 1 instances ends at 0x10503", 1},
    {false, MODULES + 4, 0x00077002, "module descriptor 0 (Hostmot2 DPLL): base address 0x7002", 1},
    {false, MODULES + 12, 0x01010080, "tag 0x80 (LED) found again, expected only once (it is descriptor 1 already)", 1},
    {false, MODULES + 24, 0x00010003, "module descriptor 2 (IOPort): instances is 0, expected IOPorts of the header, 3",
     1},
    {false, MODULES + 24, 0x03010000, "no IOPort module descriptor (tag 0x03) found among 2, expected one with 3", 1},
    {false, PINS, 0x00002301, "pin descriptors 0 to 0: primary tag is 0x00 (the list is too short), expected 0x03", 1},
    {false, PINS + 4 * 50, 0x40000000, "pin descriptors 50 to 50: primary tag is 0x40, expected 0x03 (IOPort)", 1},
};

static void each_single_fault_is_refused_with_field_found_and_expected(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        struct hm2_image image = image_7i96s();
        if (faults[i].id)
            image.id[faults[i].offset / 4u] = faults[i].value;
        else
            ROM(image, faults[i].offset) = faults[i].value;
        struct hm2_idrom rom;
        struct hm2_diag diag = {0};
        assert_int_equal(hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag), HM2_ERR_MISMATCH);
        if (!strstr(diag.text, faults[i].sentence) || diag.problems != faults[i].problems)
            fail_msg("fault %zu: expected %u sentences with \"%s\", found %u:\n%s", i, faults[i].problems,
                     faults[i].sentence, diag.problems, diag.text);
        assert_true(rom.module_count <= HM2_MAX_MODULES);
        assert_true(rom.pin_count <= HM2_MAX_PINS);
    }
}

static void all_faults_of_one_image_are_reported_at_once(void **state)
{
    (void)state;
    struct hm2_image image = image_7i96s();
    image.id[0] = 0;
    image.id[1] = 0x00000000;
    ROM(image, 0x00) = 7;
    ROM(image, 0x20) = 52;
    ROM(image, 0x28) = 10;
    ROM(image, 0x2C) = 20;
    ROM(image, MODULES) = 0x0109001A;
    ROM(image, MODULES + 16) = 0x30030C00;
    ROM(image, MODULES + 24) = 0x00010003;
    ROM(image, PINS + 4 * 3) = 0;
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag), HM2_ERR_MISMATCH);
    static const char *const words[] = {"cookie",
                                        "config name",
                                        "type is 7",
                                        "IOWidth is 52",
                                        "ClockLow is 10 Hz",
                                        "ClockHigh",
                                        "clock tag is 9",
                                        "stride selector is 3",
                                        "instances is 0",
                                        "pin descriptors 3 to 3",
                                        "pin descriptors 51 to 51"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (!strstr(diag.text, words[i]))
            fail_msg("\"%s\" is missing in:\n%s", words[i], diag.text);
    assert_int_equal(diag.problems, sizeof words / sizeof words[0]);
    assert_int_equal(diag.dropped, 0);
}

static void a_type_2_image_has_its_pins_at_512(void **state)
{
    (void)state;
    struct hm2_image image = image_7i96s();
    ROM(image, 0x00) = 2;
    ROM(image, 0x08) = 0x200;
    memmove(&ROM(image, 0x200), &ROM(image, PINS), 51 * 4);
    memset(&ROM(image, PINS), 0, 0x200 - PINS);
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    if (hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag) != 0)
        fail_msg("%s", diag.text);
    assert_int_equal(rom.pins[18].secondary_pin, 0x82);
    assert_int_equal(rom.module_count, 11);
}

static void a_module_list_that_fills_its_space_needs_no_end_mark(void **state)
{
    (void)state;
    struct hm2_image image = image_7i96s();
    for (unsigned i = 11; i < 32; i++) {
        ROM(image, MODULES + 12 * i) = 0x0101000B; /* translation RAM: may be there several times */
        ROM(image, MODULES + 12 * i + 4) = 0x00035000;
    }
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    if (hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag) != 0)
        fail_msg("%s", diag.text);
    assert_int_equal(rom.module_count, 32);
}

static void a_module_list_without_end_is_cut_and_refused(void **state)
{
    (void)state;
    struct hm2_image image = image_7i96s();
    memmove(&ROM(image, 0x40), &ROM(image, PINS), 51 * 4);
    ROM(image, 0x08) = 0x40;
    ROM(image, 0x04) = 0x110;
    for (unsigned i = 0; i < 60; i++) {
        ROM(image, 0x110 + 12 * i) = 0x0101000B;
        ROM(image, 0x110 + 12 * i + 4) = 0x00035000;
    }
    ROM(image, 0x110) = 0x03010003;
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag), HM2_ERR_MISMATCH);
    assert_int_equal(diag.problems, 1);
    assert_non_null(strstr(diag.text, "has no end (tag 0) after 48 entries, expected at most 48"));
    assert_int_equal(rom.module_count, HM2_MAX_MODULES);
}

static void an_unusual_port_width_is_only_a_warning(void **state)
{
    (void)state;
    struct hm2_image image = image_7i96s();
    ROM(image, 0x20) = 48;
    ROM(image, 0x24) = 16;
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_idrom_parse(&image, NULL, &rom, &diag), 0);
    assert_int_equal(diag.warnings, 1);
    assert_string_equal(diag.text, "warning: this card: IDROM PortWidth 16 is none of the known connectors'; pin names "
                                   "will be wrong\n");
}

static void an_erased_or_absent_fpga_is_refused_without_harm(void **state)
{
    (void)state;
    struct hm2_image image;
    struct hm2_idrom rom;
    for (int fill = 0; fill < 256; fill += 255) {
        struct hm2_diag diag = {0};
        memset(&image, fill, sizeof image);
        assert_int_equal(hm2_idrom_parse(&image, &expect_7i96s, &rom, &diag), HM2_ERR_MISMATCH);
        assert_int_equal(rom.module_count, 0);
        assert_int_equal(rom.pin_count, 0);
    }
}

static void the_fingerprint_tells_images_apart(void **state)
{
    (void)state;
    struct hm2_image image = image_7i96s();
    const uint64_t before = hm2_image_fingerprint(&image);
    struct hm2_idrom rom;
    assert_int_equal(hm2_idrom_parse(&image, NULL, &rom, NULL), 0);
    assert_true(rom.fingerprint == before);
    image.rom[255] ^= 0x80000000u;
    assert_true(hm2_image_fingerprint(&image) != before);
    image.rom[255] ^= 0x80000000u;
    image.id[3] |= 0x10000u;
    assert_true(hm2_image_fingerprint(&image) != before);
    memset(&image, 0, sizeof image); /* FNV-1a of 1040 zero bytes: offset basis times prime^1040 */
    uint64_t expected = 0xCBF29CE484222325u;
    for (unsigned i = 0; i < 1040; i++)
        expected *= 0x100000001B3u;
    assert_true(hm2_image_fingerprint(&image) == expected);
}

/* ---- text ------------------------------------------------------------------------------------------------------- */

static void a_dump_may_place_the_rom_elsewhere(void **state)
{
    (void)state;
    static const char text[] = "0800 00000003 # type\r\n\r\n  0bFc\tdeadbeef\n010C 12340800\n0100 1";
    struct hm2_image image;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_image_from_text(text, sizeof text - 1, &image, &diag), 0);
    assert_int_equal(image.rom[0], 3);
    assert_int_equal(image.rom[255], 0xDEADBEEF);
    assert_int_equal(image.id[0], 1);
    assert_int_equal(image.id[3], 0x12340800);
}

static void a_malformed_dump_is_refused_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *text, *sentence;
    } cases[] = {
        {"0100 55AACAFE\n0104", "line 2: \"0104\" found, expected a word address"},
        {"0100 55AACAFEE\n", "line 1: "},
        {"00100 55AACAFE\n", "line 1: "},
        {"0102 55AACAFE\n", "line 1: "},
        {"# x\n\n0100 55AACAFE 1\n", "line 3: "},
        {"0100 55AACAFG\n", "line 1: "},
        {"0100:55AACAFE\n", "line 1: "},
        {"0404 1\n0800 00000000\n", "line 2: address 0x0800 found, expected 0x0100 to 0x010C or a word of the ROM, "
                                    "which starts at 0x0400 and has 1024 bytes"},
        {"010C 500\n0400 1\n", "line 2: address 0x0400 found, expected 0x0100 to 0x010C or a word of the ROM, which "
                               "starts at 0x0500"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct hm2_image image;
        struct hm2_diag diag = {0};
        assert_int_equal(hm2_image_from_text(cases[i].text, strlen(cases[i].text), &image, &diag), HM2_ERR_MALFORMED);
        if (!strstr(diag.text, cases[i].sentence))
            fail_msg("case %zu: \"%s\" is missing in: %s", i, cases[i].sentence, diag.text);
    }
}

/* ---- names ------------------------------------------------------------------------------------------------------ */

static const char *function(const uint8_t tag, const uint8_t code)
{
    static char buf[32];
    const struct hm2_pd pd = {.secondary_pin = code, .secondary_tag = tag, .primary_tag = HM2_GTAG_IOPORT};
    return hm2_pin_function(&pd, buf, sizeof buf);
}

static void pins_have_the_names_of_the_load_time_listing(void **state)
{
    (void)state;
    static const struct {
        uint8_t tag, code;
        const char *name;
    } rows[] = {
        {0x00, 0x00, "GPIO"},          {0x04, 0x01, "A"},
        {0x04, 0x04, "IndexMask"},     {0x05, 0x81, "Step"},
        {0x05, 0x88, "Table7Pin"},     {0x05, 0x0A, "Probe"},
        {0x06, 0x83, "Not-Enable"},    {0x0D, 0x82, "Mux Select 1"},
        {0x0E, 0x8C, "CS7"},           {0x19, 0x84, "TestClk"},
        {0x1A, 0x86, "Timer 4 Pin"},   {0x23, 0x01, "in0,enca0"},
        {0x23, 0x08, "in7,encb3"},     {0x23, 0x09, "in8"},
        {0x23, 0x20, "in31"},          {0x2D, 0x85, "Out-04"},
        {0xC3, 0x84, "Out-03"},        {0xC3, 0xA0, "AC Ref (internal)"},
        {0xC1, 0x01, "rx0"},           {0xC1, 0x88, "tx7"},
        {0xC6, 0x91, "txen0"},         {0xC1, 0xA8, "ntxen7"},
        {0x1E, 0x85, "addr4"},         {0xC2, 0xC1, "IO00"},
        {0x05, 0x89, "unknown-pin-9"}, {0xEE, 0x81, "unknown-pin-1"},
        {0xC8, 0x01, "input"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_string_equal(function(rows[i].tag, rows[i].code), rows[i].name);
    assert_string_equal(hm2_tag_name(HM2_GTAG_STEPGEN), "StepGen");
    assert_string_equal(hm2_tag_name(HM2_GTAG_DPLL), "Hostmot2 DPLL");
    assert_string_equal(hm2_tag_name(0xEE), "unknown");
}

static void connector_pins_follow_the_port_width(void **state)
{
    (void)state;
    assert_int_equal(hm2_connector_pin(24, 0), 1);
    assert_int_equal(hm2_connector_pin(24, 47), 47);
    assert_int_equal(hm2_connector_pin(17, 1), 14);
    assert_int_equal(hm2_connector_pin(17, 50), 13);
    assert_int_equal(hm2_connector_pin(32, 40), 41);
    assert_int_equal(hm2_connector_pin(30, 59), 60);
    assert_int_equal(hm2_connector_pin(16, 3), 0);
    assert_int_equal(hm2_connector_pin(0, 3), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_7i96s_image_parses_completely),
        cmocka_unit_test(every_dumped_image_agrees_with_the_index),
        cmocka_unit_test(each_single_fault_is_refused_with_field_found_and_expected),
        cmocka_unit_test(all_faults_of_one_image_are_reported_at_once),
        cmocka_unit_test(a_type_2_image_has_its_pins_at_512),
        cmocka_unit_test(a_module_list_that_fills_its_space_needs_no_end_mark),
        cmocka_unit_test(a_module_list_without_end_is_cut_and_refused),
        cmocka_unit_test(an_unusual_port_width_is_only_a_warning),
        cmocka_unit_test(an_erased_or_absent_fpga_is_refused_without_harm),
        cmocka_unit_test(the_fingerprint_tells_images_apart),
        cmocka_unit_test(a_dump_may_place_the_rom_elsewhere),
        cmocka_unit_test(a_malformed_dump_is_refused_with_its_line),
        cmocka_unit_test(pins_have_the_names_of_the_load_time_listing),
        cmocka_unit_test(connector_pins_follow_the_port_width),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
