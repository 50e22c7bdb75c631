/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2sim's configuration flash: kept in a file, programmed by Debian's mesaflash, started from, cut by the power. */
#include <check.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "flash_rig.h"
#include "suite.h"

#define END_MS     5000
#define USER       0x100000u
#define CHIP_BYTES 0x200000u

static struct simulator sim;
static struct process client;

static const struct sim_flash_file bit = {.profile = "7i93", .seed = 1};
static const struct sim_flash_file bin = {.profile = "7i96s", .seed = 2};

static void expect(const char *const command, const char *const answer)
{
    ck_assert_str_eq(simulator_ask(&sim, command), answer);
}

static bool has_mesaflash(void)
{
    if (process_find("mesaflash"))
        return true;
    printf("SKIP: mesaflash is not installed\n");
    return false;
}

START_TEST(mesaflash_writes_images_that_the_cards_start)
{
    if (!has_mesaflash())
        return;
    const char *const files[] = {flash_rig_image("a.bit", &bit), flash_rig_image("a.bin", &bin)};
    static const char *const devices[] = {"7i93", "7i96s"};
    simulator_start(&sim, (const char *const[]){"--card", "7i93", "--card", "7i96s", NULL});
    for (unsigned i = 0; i < 2; i++) {
        char command[32];
        const int status = flash_rig_run(&client, "mesaflash", devices[i], sim.address[i],
                                         (const char *const[]){"--write", files[i], NULL});
        if (status != 0)
            ck_abort_msg("%s: %d: %s", devices[i], status, client.text);
        snprintf(command, sizeof command, "card %u boots", i);
        expect(command, "runs fallback boots user");
        ck_assert_int_eq(
            flash_rig_run(&client, "mesaflash", devices[i], sim.address[i], (const char *const[]){"--reload", NULL}),
            0);
        expect(command, "runs user boots user");
    }
    expect("card 0 flash", "programs 1331 erases 6 sector-0 0");
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_file_keeps_the_flash_when_hm2sim_is_killed)
{
    if (!has_mesaflash())
        return;
    const char *const flash = flash_rig_path("flash"), *const file = flash_rig_image("a.bit", &bit);
    const char *const args[] = {"--card", "7i93", "--flash", flash, NULL};
    simulator_start(&sim, args);
    ck_assert_int_eq(
        flash_rig_run(&client, "mesaflash", "7i93", sim.address[0], (const char *const[]){"--write", file, NULL}), 0);
    ck_assert_int_eq(process_stop(&sim.process, SIGKILL, END_MS), 128 + SIGKILL);
    size_t image_len, flash_len;
    const uint8_t *const image = flash_rig_read(file, &image_len), *const kept = flash_rig_read(flash, &flash_len);
    ck_assert_uint_eq(flash_len, CHIP_BYTES);
    const size_t payload = 340604; /* the header is in front */
    ck_assert_mem_eq(kept + USER, image + image_len - payload, payload);
    simulator_start(&sim, args);
    expect("boots", "runs user boots user");
    ck_assert_int_eq(
        flash_rig_run(&client, "mesaflash", "7i93", sim.address[0], (const char *const[]){"--verify", file, NULL}), 0);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_power_cut_leaves_what_the_card_starts_from)
{
    if (!has_mesaflash())
        return;
    const char *const file = flash_rig_image("a.bit", &bit);
    simulator_start(&sim, (const char *const[]){"--card", "7i93", "--flash-faults", "cut=100:17", NULL});
    const char *const argv[] = {"mesaflash", "--device", "7i93", "--addr", sim.address[0], "--write", file, NULL};
    process_start(&client, argv); /* it waits for ever */
    const char *answer = "";
    for (unsigned i = 0; i < 2000 && strcmp(answer, "runs nothing boots fallback") != 0; i++) {
        answer = simulator_ask(&sim, "boots");
        usleep(1000);
    }
    (void)process_stop(&client, SIGKILL, END_MS);
    ck_assert_str_eq(answer, "runs nothing boots fallback");
    expect("flash", "programs 94 erases 6 sector-0 0");
    simulator_do(&sim, "power-cycle");
    expect("boots", "runs fallback boots fallback");
    simulator_do(&sim, "power-off");
    expect("boots", "runs nothing boots fallback");
    simulator_stop(&sim);
}
END_TEST

static void refused(const char *const option, const char *const value, const char *const message)
{
    char address[16];
    test_address(3, address);
    const char *const argv[] = {process_built("hm2sim"), "--bind", address, option, value, NULL};
    const int status = process_run(&client, argv, END_MS);
    if (status == 0 || !strstr(client.text, message))
        ck_abort_msg("%s %s: %d: %s", option, value, status, client.text);
}

START_TEST(wrong_options_are_refused_with_what_is_right)
{
    const char *const file = flash_rig_path("short");
    FILE *const out = fopen(file, "wb");
    ck_assert_ptr_nonnull(out);
    ck_assert_int_eq(fclose(out), 0);
    refused("--flash", file, "has 0 bytes, the chip has 2097152");
    refused("--flash", "/nowhere/flash", "cannot be made");
    refused("--flash-chip", "128Mb", "64Mb");
    refused("--flash-times", "m25p17", "m25p16-max");
    refused("--flash-faults", "cut=0", "cut=OPERATION[:BYTES]");
    refused("--flash-faults", "cut=1:257", "cut=OPERATION[:BYTES]");
    refused("--flash-faults", "bad=100", "bad=ADDRESS:MASK");
    refused("--flash-faults", "stick=1,", "stick=OPERATION");
    refused("--jumpers", "4", "0 to 3");
}
END_TEST

START_TEST(two_simulators_do_not_share_a_file)
{
    const char *const flash = flash_rig_path("flash");
    simulator_start(&sim, (const char *const[]){"--flash", flash, "--flash-chip", "2Mb", NULL});
    struct stat st;
    ck_assert_int_eq(stat(flash, &st), 0);
    ck_assert_int_eq((int)st.st_size, 262144);
    char address[16];
    test_address(3, address);
    const char *const argv[] = {
        process_built("hm2sim"), "--bind", address, "--flash-chip", "2Mb", "--flash", flash, NULL};
    ck_assert_int_eq(process_run(&client, argv, END_MS), 1);
    ck_assert_ptr_nonnull(strstr(client.text, "another hm2sim uses it"));
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2sim's flash");
    TCase *const tests = tcase_create("flash");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, NULL, flash_rig_clean);
    tcase_add_test(tests, mesaflash_writes_images_that_the_cards_start);
    tcase_add_test(tests, a_file_keeps_the_flash_when_hm2sim_is_killed);
    tcase_add_test(tests, a_power_cut_leaves_what_the_card_starts_from);
    tcase_add_test(tests, wrong_options_are_refused_with_what_is_right);
    tcase_add_test(tests, two_simulators_do_not_share_a_file);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
