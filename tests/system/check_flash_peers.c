/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * hm2flash judged from outside: what it prints beside what Debian's mesaflash (3.4.6) prints of the same card, files
 * and flashes that one writes and the other reads, and images that must not get into a card.
 */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "flash_rig.h"
#include "suite.h"

#define MAX_LINES 700u

static struct simulator sim;
static struct process mesa, ours;
static const char *const devices[] = {"7i93", "7i96s"};

static bool has_mesaflash(void)
{
    if (process_find("mesaflash"))
        return true;
    printf("SKIP: mesaflash is not installed\n");
    return false;
}

static void start_cards(void)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i93", "--card", "7i96s", NULL});
}

static int run_mesa(const unsigned card, const char *const *const args)
{
    return flash_rig_run(&mesa, "mesaflash", devices[card], sim.address[card], args);
}

static int run_ours(const unsigned card, const char *const *const args)
{
    return flash_rig_run(&ours, process_built("hm2flash"), devices[card], sim.address[card], args);
}

/* ---- texts ------------------------------------------------------------------------------------------------------- */

/* What newer versions of mesaflash write in another way than 3.4.6, as that one wrote it; and blanks, as they shift. */
static void as_3_4_6(const char *from, char *to, const size_t size)
{
    static const struct {
        const char *text;
        size_t drop;
    } newer[] = {{"_EncA", 6}, {"_EncB", 6}, {"-SSR", 4}};
    size_t used = 0;
    while (*from && used + 1 < size) {
        for (size_t i = 0; i < sizeof newer / sizeof newer[0]; i++)
            if (strncmp(from, newer[i].text, strlen(newer[i].text)) == 0)
                from += newer[i].drop;
        if (*from && !(*from == ' ' && used > 0 && to[used - 1] == ' '))
            to[used++] = *from;
        from += *from != '\0';
    }
    to[used] = '\0';
}

static bool counts_packets(const char *const line)
{
    static const char *const own[] = {"uSTimeStampReg", "packets received", "packets sent", "scratch"};
    for (size_t i = 0; i < sizeof own / sizeof own[0]; i++)
        if (strstr(line, own[i]))
            return true;
    return false;
}

/* Of a remote's 32-bit parameters mesaflash 3.4.6 reads those in non-volatile memory only and prints 0 for others. */
static bool same_but_for_zero(const char *const a, const char *const b)
{
    static const char zero[] = "    UnitNumber = 00000000 ";
    const size_t len = sizeof zero - 1, name = len - 9;
    return strncmp(a, zero, len) == 0 && strncmp(b, zero, name) == 0 && strlen(b) == strlen(a) &&
           strcmp(a + len, b + len) == 0;
}

static bool same_line(const char *const a, const char *const b)
{
    static char left[4096], right[4096];
    if (same_but_for_zero(a, b))
        return true;
    if (strcmp(a, b) == 0 || (counts_packets(a) && counts_packets(b)))
        return true;
    if (!strstr(b, "_Enc") && !strstr(b, "-SSR"))
        return false;
    as_3_4_6(a, left, sizeof left);
    as_3_4_6(b, right, sizeof right);
    return strcmp(left, right) == 0;
}

static unsigned split(char *text, const char *lines[const MAX_LINES])
{
    unsigned n = 0;
    for (char *end; (end = strchr(text, '\n')) != NULL && n < MAX_LINES; text = end + 1) {
        *end = '\0';
        if (strncmp(text, "hm2flash: ", 10) != 0) /* advice, on stderr */
            lines[n++] = text;
    }
    return n;
}

static void compare(const unsigned card, const char *const *const args)
{
    static const char *theirs[MAX_LINES], *own[MAX_LINES];
    const int status = run_mesa(card, args), own_status = run_ours(card, args);
    if (status != own_status)
        ck_abort_msg("%s %s: mesaflash %d, hm2flash %d: %s", devices[card], args[0] ? args[0] : "", status, own_status,
                     ours.text);
    const unsigned count = split(mesa.text, theirs), own_count = split(ours.text, own);
    for (unsigned i = 0; i < count && i < own_count; i++)
        if (!same_line(theirs[i], own[i]))
            ck_abort_msg("%s %s, line %u:\n%s\n%s", devices[card], args[0] ? args[0] : "", i + 1, theirs[i], own[i]);
    const bool may_tell_more = args[0] && strcmp(args[0], "--verbose") == 0;
    if (may_tell_more ? own_count < count : own_count != count)
        ck_abort_msg("%s %s: %u lines and %u; the next is \"%s\"", devices[card], args[0] ? args[0] : "", count,
                     own_count, own_count > count ? own[count] : theirs[own_count]);
}

START_TEST(texts_that_programs_read_are_mesaflashs)
{
    static const char *const commands[][4] = {
        {NULL},
        {"--verbose", NULL},
        {"--readhmid", NULL},
        {"--readhmid", "--xml", NULL},
        {"--readhmid", "--verbose", NULL},
        {"--print-pd", NULL},
        {"--print-lio", NULL},
        {"--rpo", "0x100", NULL},
        {"--rpo", "4096", NULL},
        {"--wpo", "0x1100=0x0", NULL},
        {"--set", "ip=10.10.10.11", NULL},
    };
    if (!has_mesaflash())
        return;
    start_cards();
    for (unsigned card = 0; card < 2; card++)
        for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
            compare(card, commands[i]);
    simulator_stop(&sim);
}
END_TEST

/* 1.4.5, whole; and what the port needed is given back (mesaflash leaves every pin an input). */
START_TEST(smart_serial_lists_are_mesaflashs)
{
    static const char *const cards[2][12] = {{"--realtime", "--card", "7i93", "--firmware",
                                              TEST_DATA "/idrom/7I77x2_34.hex", "--remote", "0:0=7i77", "--remote",
                                              "0:3=7i77d", "--remote", "0:2=7i84"},
                                             {"--realtime", "--card", "7i96s", "--remote", "0:0=7i76"}};
    static const char *const commands[][3] = {{"--sserial", NULL}, {"--sserial", "--verbose", NULL}};
    static const char *const names[2] = {"channel 4: 7I77 ANALOG (unit 0x1100",
                                         "channel 0: 7I76 GPIO+SPINDLE (unit 0x1000"};
    if (!has_mesaflash())
        return;
    for (unsigned card = 0; card < 2; card++) {
        simulator_start(&sim, cards[card]);
        if (card == 1)
            memcpy(sim.address[1], sim.address[0], sizeof sim.address[0]); /* where the helpers look for a 7I96S */
        for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
            compare(card, commands[i]);
        ck_assert_int_eq(run_ours(card, (const char *const[]){"--wpo", "0x1104=0x21", NULL}), 0);
        ck_assert_int_eq(run_ours(card, commands[0]), 0);
        if (!strstr(ours.text, names[card]))
            ck_abort_msg("\"%s\" is not in the list: %s", names[card], ours.text);
        ck_assert_uint_eq(simulator_read(&sim, 0, 0x1104), 0x21);
        simulator_stop(&sim);
    }
}
END_TEST

static const char *image_of(const unsigned card, const uint64_t seed, const enum sim_area area)
{
    static const char *const names[2][2] = {{"7i93_u.bit", "7i93_fallback.bit"}, {"7i96s_u.bin", "7i96s_fallback.bin"}};
    const struct sim_flash_file file = {.profile = devices[card], .area = area, .seed = seed};
    return flash_rig_image(names[card][area], &file);
}

START_TEST(info_is_mesaflashs_but_for_its_gap)
{
    if (!has_mesaflash())
        return;
    for (unsigned card = 0; card < 2; card++) {
        const char *const file = image_of(card, 1, SIM_AREA_USER);
        const char *const theirs[] = {"mesaflash", "--info", file, NULL};
        const char *const own[] = {process_built("hm2flash"), "--info", file, NULL};
        ck_assert_int_eq(process_run(&mesa, theirs, 10000), 0);
        ck_assert_int_eq(process_run(&ours, own, 10000), 0);
        char *const gap = strstr(mesa.text, "323  .4.6"); /* it cuts the line in two */
        if (gap)
            memmove(gap + 3, gap + 5, strlen(gap + 5) + 1);
        ck_assert_str_eq(ours.text, mesa.text);
    }
}
END_TEST

/* ---- files and flashes ------------------------------------------------------------------------------------------- */

#define MUST(call, process)                                          \
    do {                                                             \
        const int status_ = (call);                                  \
        if (status_ != 0)                                            \
            ck_abort_msg(#call ": %d: %s", status_, (process).text); \
    } while (0)

START_TEST(what_one_writes_verifies_with_the_other)
{
    if (!has_mesaflash())
        return;
    start_cards();
    for (unsigned card = 0; card < 2; card++) {
        const char *const first = image_of(card, 1, SIM_AREA_USER);
        MUST(run_ours(card, (const char *const[]){"--write", first, NULL}), ours);
        MUST(run_mesa(card, (const char *const[]){"--verify", first, NULL}), mesa); /* padding included */
        const char *const second = image_of(card, 2, SIM_AREA_USER);
        ck_assert_int_ne(run_ours(card, (const char *const[]){"--verify", second, NULL}), 0);
        MUST(run_mesa(card, (const char *const[]){"--write", second, NULL}), mesa);
        MUST(run_ours(card, (const char *const[]){"--verify", second, NULL}), ours);
        const char *const fallback = image_of(card, 3, SIM_AREA_FALLBACK);
        MUST(run_ours(card, (const char *const[]){"--fallback", "--write", fallback, "--confirm", "fallback",
                                                  "--backup-to", flash_rig_path("."), NULL}),
             ours);
        MUST(run_mesa(card, (const char *const[]){"--fallback", "--verify", fallback, NULL}), mesa);
        MUST(run_mesa(card, (const char *const[]){"--verify", second, NULL}), mesa);
    }
    simulator_stop(&sim);
}
END_TEST

START_TEST(backups_are_the_same_and_each_restores_the_others)
{
    if (!has_mesaflash())
        return;
    start_cards();
    for (unsigned card = 0; card < 2; card++) {
        char name[32];
        size_t len, own_len;
        snprintf(name, sizeof name, "theirs%u", card);
        const char *const theirs = flash_rig_path(name);
        snprintf(name, sizeof name, "ours%u", card);
        const char *const own = flash_rig_path(name);
        MUST(run_ours(card, (const char *const[]){"--write", image_of(card, 1, SIM_AREA_USER), NULL}), ours);
        MUST(run_mesa(card, (const char *const[]){"--backup-flash", theirs, NULL}), mesa);
        MUST(run_ours(card, (const char *const[]){"--backup-flash", own, NULL}), ours);
        const uint8_t *const a = flash_rig_read(theirs, &len), *const b = flash_rig_read(own, &own_len);
        ck_assert_uint_eq(len, own_len);
        ck_assert_mem_eq(a, b, len);
        MUST(run_ours(card, (const char *const[]){"--write", image_of(card, 2, SIM_AREA_USER), NULL}), ours);
        MUST(run_ours(card, (const char *const[]){"--restore-flash", theirs, "--confirm", "fallback", NULL}), ours);
        MUST(run_mesa(card, (const char *const[]){"--verify", image_of(card, 1, SIM_AREA_USER), NULL}), mesa);
        MUST(run_ours(card, (const char *const[]){"--write", image_of(card, 2, SIM_AREA_USER), NULL}), ours);
        MUST(run_mesa(card, (const char *const[]){"--restore-flash", own, NULL}), mesa);
        MUST(run_ours(card, (const char *const[]){"--verify", own, NULL}), ours);
    }
    simulator_stop(&sim);
}
END_TEST

/* ---- images that must not get in --------------------------------------------------------------------------------- */

enum damage { WHOLE, CUT_OFF, TRAILING, RAW, EMPTY, FLIPPED };

static const struct wrong {
    const char *what, *name;
    unsigned card;
    struct sim_flash_file file;
    const char *args[4];
    enum damage damage;
} wrong_images[] = {
    {"another FPGA", "7i93.bit", 0, {.profile = "7i80hd-16"}, {NULL}, WHOLE},
    {"another family", "7i93.bin", 0, {.profile = "7i96s"}, {NULL}, WHOLE},
    {"another FPGA in its packets", "7i93.bit", 0, {.profile = "7i93", .idcode = 0x04002093}, {NULL}, WHOLE},
    {"multiboot", "7i93.bit", 0, {.profile = "7i93", .faults = SIM_FILE_MULTIBOOT}, {NULL}, WHOLE},
    {"no reset on error", "7i93.bit", 0, {.profile = "7i93", .faults = SIM_FILE_NO_RESET_ON_ERROR}, {NULL}, WHOLE},
    {"no CRC", "7i93.bit", 0, {.profile = "7i93", .faults = SIM_FILE_NO_CRC}, {NULL}, WHOLE},
    {"no sync word", "7i93.bit", 0, {.profile = "7i93", .faults = SIM_FILE_NO_SYNC}, {NULL}, WHOLE},
    {"cut off", "7i93.bit", 0, {.profile = "7i93"}, {NULL}, CUT_OFF},
    {"bytes behind it", "7i93.bit", 0, {.profile = "7i93"}, {NULL}, TRAILING},
    {"raw bits", "7i93.bin", 0, {.profile = "7i93"}, {NULL}, RAW},
    {"one wrong bit", "7i93.bit", 0, {.profile = "7i93"}, {NULL}, FLIPPED},
    {"empty", "7i93.bit", 0, {.profile = "7i93"}, {NULL}, EMPTY},
    {"too short", "7i93.bit", 0, {.profile = "7i93", .bytes = 100000}, {NULL}, WHOLE},
    {"too long", "7i93.bit", 0, {.profile = "7i93", .bytes = 1000000}, {NULL}, WHOLE},
    {"PCI design", "7i93.bit", 0, {.profile = "7i93", .design = "TopPCIHostMot2.ncd;UserID=0xFFFFFFFF"}, {NULL}, WHOLE},
    {"named after another board", "7i92_x.bit", 0, {.profile = "7i93"}, {NULL}, WHOLE},
    {"named after no board", "x.bit", 0, {.profile = "7i93"}, {NULL}, WHOLE},
    {"fallback by name", "7i93_fallback.bit", 0, {.profile = "7i93"}, {NULL}, WHOLE},
    {"user by name", "7i93.bit", 0, {.profile = "7i93"}, {"--fallback", "--confirm", "fallback", NULL}, WHOLE},
    {"override of another card", "x.bit", 0, {.profile = "7i93"}, {"--override", "7I92", NULL}, WHOLE},
    {"no side file", "7i93.bit", 0, {.profile = "7i93"}, {"--sha256-check", NULL}, WHOLE},
    {"fallback unconfirmed", "7i93_fallback.bit", 0, {.profile = "7i93"}, {"--fallback", NULL}, WHOLE},
    {"another family", "7i96s.bit", 1, {.profile = "7i93"}, {NULL}, WHOLE},
    {"another FPGA", "7i96s.bin", 1, {.profile = "7i96s", .part = "T120F324"}, {NULL}, WHOLE},
    {"another board's project", "7i96s.bin", 1, {.profile = "7i96s", .project = "/p/7i92tdist"}, {NULL}, WHOLE},
    {"no board's project and name", "x.bin", 1, {.profile = "7i96s", .project = "/p/hostmot2"}, {NULL}, WHOLE},
    {"named after another board", "7i95t.bin", 1, {.profile = "7i96s"}, {NULL}, WHOLE},
    {"passive mode", "7i96s.bin", 1, {.profile = "7i96s", .mode = "passive"}, {NULL}, WHOLE},
    {"width 4", "7i96s.bin", 1, {.profile = "7i96s", .width = "4"}, {NULL}, WHOLE},
    {"padded bits", "7i96s.bin", 1, {.profile = "7i96s", .padded_bits = "3"}, {NULL}, WHOLE},
    {"another series", "7i96s.bin", 1, {.profile = "7i96s", .series = "Titanium"}, {NULL}, WHOLE},
    {"fallback image", "7i96s.bin", 1, {.profile = "7i96s", .area = SIM_AREA_FALLBACK}, {NULL}, WHOLE},
    {"user image", "7i96s_fallback.bin", 1, {.profile = "7i96s"}, {"--fallback", "--confirm", "fallback", NULL}, WHOLE},
    {"no sync word", "7i96s.bin", 1, {.profile = "7i96s", .faults = SIM_FILE_NO_SYNC}, {NULL}, WHOLE},
    {"cut off", "7i96s.bin", 1, {.profile = "7i96s"}, {NULL}, CUT_OFF},
    {"bytes behind it", "7i96s.bin", 1, {.profile = "7i96s"}, {NULL}, TRAILING},
};

static void damage_file(const char *const path, const enum damage damage)
{
    enum { MANY = 100000, RAW_AT = 104 };
    size_t len;
    const uint8_t *const bytes = flash_rig_read(path, &len);
    const size_t from = damage == RAW ? RAW_AT : 0;
    const size_t keep = damage == CUT_OFF ? len - MANY : damage == EMPTY ? 0 : len - from;
    FILE *const out = fopen(path, "wb");
    ck_assert_ptr_nonnull(out);
    ck_assert_uint_eq(fwrite(bytes + from, 1, keep, out), keep);
    if (damage == FLIPPED) {
        ck_assert_int_eq(fseek(out, MANY, SEEK_SET), 0);
        ck_assert_int_ne(fputc(bytes[MANY] ^ 1, out), EOF);
    }
    if (damage == TRAILING)
        ck_assert_uint_eq(fwrite(bytes, 1, MANY, out), MANY);
    ck_assert_int_eq(fclose(out), 0);
}

START_TEST(a_wrong_image_is_refused_before_the_first_erase)
{
    start_cards();
    for (size_t i = 0; i < sizeof wrong_images / sizeof wrong_images[0]; i++) {
        const struct wrong *const w = &wrong_images[i];
        const char *const path = flash_rig_image(w->name, &w->file);
        if (w->damage != WHOLE)
            damage_file(path, w->damage);
        const char *const args[] = {
            "--write", path, w->args[0], w->args[0] ? w->args[1] : NULL, w->args[0] && w->args[1] ? w->args[2] : NULL,
            NULL};
        const int status = run_ours(w->card, args);
        if (status == 0 || strlen(ours.text) == 0 || !strstr(ours.text, "hm2flash: "))
            ck_abort_msg("%s, %s: status %d: %s", devices[w->card], w->what, status, ours.text);
        for (unsigned card = 0; card < 2; card++) {
            char command[32];
            snprintf(command, sizeof command, "card %u flash", card);
            const char *const answer = simulator_ask(&sim, command);
            if (strcmp(answer, "programs 0 erases 0 sector-0 0") != 0)
                ck_abort_msg("%s, %s: %s: %s", devices[w->card], w->what, answer, ours.text);
        }
    }
    printf("%zu wrong images refused\n", sizeof wrong_images / sizeof wrong_images[0]);
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2flash and mesaflash");
    TCase *const tests = tcase_create("peers");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, NULL, flash_rig_clean);
    tcase_add_test(tests, texts_that_programs_read_are_mesaflashs);
    tcase_add_test(tests, smart_serial_lists_are_mesaflashs);
    tcase_add_test(tests, info_is_mesaflashs_but_for_its_gap);
    tcase_add_test(tests, what_one_writes_verifies_with_the_other);
    tcase_add_test(tests, backups_are_the_same_and_each_restores_the_others);
    tcase_add_test(tests, a_wrong_image_is_refused_before_the_first_erase);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
