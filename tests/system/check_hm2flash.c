/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2flash as a program, on simulated cards over UDP: what it prints, does, refuses, and its exit status. */
#include <arpa/inet.h>
#include <check.h>
#include <pty.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <hm2/lbp16.h>

#include "flash_rig.h"
#include "process.h"
#include "simulator.h"
#include "suite.h"

#define RUN_MS   30000
#define MAX_ARGS 20

enum { DONE = 0, FAILED = 1, USAGE = 2, REFUSED = 3, LOST = 4 };

static struct simulator sim;
static struct process tool;

/* Two cards: a 7I96S at address 0, a 7I93 at address 1. */
static void set_up(void)
{
    static const char *const cards[] = {"--card", "7i96s", "--card", "7i93", NULL};
    simulator_start(&sim, cards);
}

static void tear_down(void)
{
    simulator_stop(&sim);
    flash_rig_clean();
}

/* Run with these arguments and expect this status; what it printed. */
static const char *run_with(const int status, const char *const *const args)
{
    const char *argv[MAX_ARGS] = {process_built("hm2flash")};
    for (unsigned n = 0; args[n]; n++) {
        ck_assert_uint_lt(n + 2, MAX_ARGS);
        argv[n + 1] = args[n];
    }
    const int got = process_run(&tool, argv, RUN_MS);
    ck_assert_msg(got == status, "status %d instead of %d: %s", got, status, tool.text);
    return tool.text;
}
#define run(status, ...) run_with(status, (const char *const[]){__VA_ARGS__, NULL})

static void printed(const char *const words)
{
    ck_assert_msg(strstr(tool.text, words) != NULL, "\"%s\" was not printed: %s", words, tool.text);
}

static const char *image_7i96s(const uint64_t seed)
{
    return flash_rig_image("7i96s_test.bin", &(struct sim_flash_file){.profile = "7i96s", .seed = seed});
}

START_TEST(identifies_a_card)
{
    char line[64];
    snprintf(line, sizeof line, "\nETH device 7I96S at ip=%s\n", sim.address[0]);
    ck_assert_str_eq(run(DONE, "--device", "7i96s", "--addr", sim.address[0]), line);
    ck_assert_str_eq(run(DONE, "-device", "ether", "-addr", sim.address[0]), line);
    run(DONE, "--device", "ETHER", "--addr", sim.address[1], "--verbose");
    printed("  FPGA type: 6slx9tqg144\n");
    printed("  flash: sector 0: boot block, fallback area: Xilinx image, user area: blank\n");
}
END_TEST

START_TEST(tells_what_is_wrong_by_its_exit_status)
{
    run(REFUSED, "--device", "7i96", "--addr", sim.address[0]);
    printed("No 7I96 board found\n");
    printed("is a 7I96S, not a 7I96");
    run(USAGE, "--device", "7i99", "--addr", sim.address[0]);
    printed("ERROR: Unsupported device 7I99\n");
    run(USAGE, "--device", "7i96s");
    printed("You must supply an IP address for Ethernet cards\nNo 7I96S board found\n");
    run(LOST, "--device", "7i96s", "--addr", "127.255.255.254");
    printed("No 7I96S board found\n");
    printed("192.168.1.121");
    run(REFUSED, "--info", "/nonexistent");
    const char *const image = flash_rig_image("7i93.bit", &(struct sim_flash_file){.profile = "7i93"});
    run(DONE, "--info", image);
    FILE *const file = fopen(image, "r+b");
    ck_assert_ptr_nonnull(file);
    ck_assert_int_eq(fseek(file, 100000, SEEK_SET), 0);
    ck_assert_uint_eq(fwrite("damaged!", 1, 8, file), 8);
    ck_assert_int_eq(fclose(file), 0);
    run(FAILED, "--info", image);
    printed("the file is damaged");
    run(FAILED, "--info", image, "--json");
    printed("\"damaged\": true, \"safe\": false");
    run(USAGE, "--device", "7i96s", "--addr", sim.address[0], "--rpo", "garbage");
    run(USAGE, "--device", "7i96s", "--addr", sim.address[0], "--wpo", "0x1000");
    run(USAGE, "--device", "7i96s", "--addr", sim.address[0], "--set", "ip=");
    run(REFUSED, "--device", "7i96s", "--addr", sim.address[0], "--set", "ip=224.0.0.1");
    run(REFUSED, "--device", "7i96s", "--addr", sim.address[0], "--expect-mac", "00:00:00:00:00:01");
}
END_TEST

START_TEST(writes_verifies_and_starts_an_image)
{
    const char *const address = sim.address[0], *const image = image_7i96s(1);
    run(DONE, "--device", "7i96s", "--addr", address, "--write", image, "--dry-run");
    printed("Nothing was changed.");
    run(FAILED, "--device", "7i96s", "--addr", address, "--verify", image);
    printed("expected: 0xA but read: 0xFF\n");
    run(DONE, "--device", "7i96s", "--addr", address, "--write", image, "--reload");
    printed("  |WWWW");
    printed("Board configuration verified successfully.\n");
    printed("is back after");
    printed("user image");
    run(DONE, "--device", "7i96s", "--addr", address, "--verify", image);
    run(DONE, "--device", "7i96s", "--addr", address, "--write", image, "--json");
    printed("\"sectors_same\": 11, \"sectors_erased\": 0, \"pages_written\": 0");
    ck_assert_str_eq(simulator_ask(&sim, "card 0 boots"), "runs user boots user");
}
END_TEST

START_TEST(refuses_before_it_erases)
{
    const char *const address = sim.address[1];
    run(REFUSED, "--device", "7i93", "--addr", address, "--write", image_7i96s(1));
    printed("wrong bitfile destination device: T20F256, should be 6slx9tqg144");
    const char *const other = flash_rig_image("7i92_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 2});
    run(REFUSED, "--device", "7i93", "--addr", address, "--write", other);
    printed("is for a 7I92");
    run(REFUSED, "--device", "7i93", "--addr", address, "--write", other, "--override", "7I92");
    run(REFUSED, "--device", "7i93", "--addr", address, "--write", other, "--sha256-check");
    run(DONE, "--device", "7i93", "--addr", address, "--write", other, "--override", "7I93");
}
END_TEST

START_TEST(backs_up_and_restores)
{
    const char *const address = sim.address[1], *const dump = flash_rig_path("dump.bin");
    const char *const image = flash_rig_image("7i93_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 3});
    run(DONE, "--device", "7i93", "--addr", address, "--backup-flash", dump);
    printed("FLASH memory backup file '");
    printed("Checksum file '");
    run(REFUSED, "--device", "7i93", "--addr", address, "--backup-flash", dump);
    printed("already exist");
    ck_assert_ptr_null(strstr(tool.text, "Reading")); /* found out before the chip is read */
    run(FAILED, "--device", "7i93", "--addr", address, "--backup-flash", "/proc/dump.bin");
    ck_assert_ptr_null(strstr(tool.text, "Reading"));
    run(DONE, "--device", "7i93", "--addr", address, "--write", image);
    run(DONE, "--device", "7i93", "--addr", address, "--restore-flash", dump);
    printed("Backup file integrity verification passed\n");
    run(DONE, "--device", "7i93", "--addr", address, "--verify", dump);
    run(REFUSED, "--device", "7i96s", "--addr", sim.address[0], "--restore-flash", dump);
    printed("the dump is from a 7I93");
    ck_assert_int_eq(truncate(dump, 100), 0);
    run(REFUSED, "--device", "7i93", "--addr", address, "--restore-flash", dump);
    printed("integrity verification not passed\n");
}
END_TEST

START_TEST(sets_and_reads_settings_and_registers)
{
    const char *const address = sim.address[0];
    run(DONE, "--device", "7i96s", "--addr", address, "--set", "ip=192.168.5.7");
    printed("Board IP updated successfully.\n");
    printed("You must power cycle board to load updated eeprom settings.\n");
    printed("warning: the card does not take its address from the EEPROM");
    run(DONE, "--device", "7i96s", "--addr", address, "--set", "netmask=255.255.0.0");
    run(REFUSED, "--device", "7i96s", "--addr", address, "--set", "netmask=255.0.255.0");
    run(DONE, "--device", "7i96s", "--addr", address, "--set", "ledmode=1");
    run(DONE, "--device", "7i96s", "--addr", address, "--json");
    printed("\"eeprom_ip\": \"192.168.5.7\", \"eeprom_netmask\": \"255.255.0.0\", \"led_mode\": 1");
    run(DONE, "--device", "7i96s", "--addr", address, "--verbose");
    printed("  EEPROM 0x20: 0507 C0A8 0000 FFFF 0001 ");
    ck_assert_str_eq(run(DONE, "--device", "7i96s", "--addr", address, "--rpo", "0x100"), "55AACAFE\n");
    run(DONE, "--device", "7i96s", "--addr", address, "--wpo", "0x1100=0x21");
    ck_assert_uint_eq(simulator_read(&sim, 0, 0x1100), 0x21);
    run(REFUSED, "--device", "7i96s", "--addr", address, "--reload");
    printed("2 pins of the card are outputs");
    run(DONE, "--device", "7i96s", "--addr", address, "--safe-io");
    run(DONE, "--device", "7i96s", "--addr", address, "--reset");
    printed("is back after");
}
END_TEST

/* --reload of card 0 at a terminal, where this is typed; its exit status. The time limit of the test bounds it. */
static int reload_at_terminal(const char *const typed)
{
    int terminal, status;
    char text[512];
    const pid_t pid = forkpty(&terminal, NULL, NULL, NULL);
    ck_assert_int_ge(pid, 0);
    if (pid == 0) {
        execl(process_built("hm2flash"), "hm2flash", "--addr", sim.address[0], "--reload", (char *)NULL);
        _exit(127);
    }
    ck_assert_int_eq(write(terminal, typed, strlen(typed)), (ssize_t)strlen(typed));
    while (read(terminal, text, sizeof text) > 0)
        ;
    close(terminal);
    ck_assert_int_eq(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* H19 */
START_TEST(asks_before_outputs_let_go)
{
    const char *const address = sim.address[0], *const image = image_7i96s(1);
    run(DONE, "--addr", address, "--wpo", "0x1100=0x21");
    run(REFUSED, "--addr", address, "--reload");
    printed("2 pins of the card are outputs");
    printed("then add --yes");
    run(REFUSED, "--addr", address, "--write", image, "--reload");
    ck_assert_ptr_null(strstr(tool.text, "Erasing"));
    ck_assert_int_eq(reload_at_terminal("n\n"), REFUSED);
    ck_assert_int_eq(reload_at_terminal("\n"), REFUSED);
    ck_assert_uint_eq(simulator_read(&sim, 0, 0x1100), 0x21);
    run(DONE, "--addr", address, "--write", image); /* leaves the outputs as they are */
    ck_assert_uint_eq(simulator_read(&sim, 0, 0x1100), 0x21);
    ck_assert_int_eq(reload_at_terminal("y\n"), DONE);
    ck_assert_uint_eq(simulator_read(&sim, 0, 0x1100), 0);
    run(DONE, "--addr", address, "--reload"); /* nothing is an output any more */
    run(REFUSED, "--addr", address, "--enable-all-mod");
    run(DONE, "--addr", address, "--enable-all-mod", "--yes");
    run(DONE, "--addr", address, "--reload", "--yes");
}
END_TEST

/* H4: in the current folder under a name of its own, or where --backup-to says; without it nothing is written. */
START_TEST(backs_up_before_the_fallback_image_is_replaced)
{
    const char *const address = sim.address[1], *const kept = flash_rig_path("kept.bin");
    const char *const image = flash_rig_image("7i93_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 3});
    const char *const fallback =
        flash_rig_image("7i93_fallback.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 4});
    const char *const other =
        flash_rig_image("7i93_fallback_2.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 5});
#define WRITE(file) "--addr", address, "--fallback", "--write", file, "--confirm", "fallback"
    run(DONE, "--addr", address, "--write", image);
    ck_assert_ptr_null(strstr(tool.text, "backup"));
    ck_assert_int_eq(chdir("/proc"), 0); /* where nobody makes a file */
    run(REFUSED, WRITE(fallback));
    printed("without a backup the flash is not written, and nothing was changed");
    ck_assert_ptr_null(strstr(tool.text, "Erasing"));
    run(DONE, WRITE(fallback), "--dry-run");
    run(DONE, WRITE(fallback), "--backup-to", kept);
    printed("FLASH memory backup file '");
    run(FAILED, "--addr", address, "--verify", kept); /* it holds what was there before */
    run(REFUSED, WRITE(other), "--backup-to", kept);  /* and is not overwritten */
    ck_assert_int_eq(chdir(flash_rig_path(".")), 0);
    run(DONE, WRITE(other));
    printed("Used auto naming backup file: '7I93_flash_backup_");
    run(DONE, WRITE(other)); /* the same again changes nothing */
    ck_assert_ptr_null(strstr(tool.text, "backup"));
    run(REFUSED, "--addr", address, "--restore-flash", kept);
    printed("--confirm fallback");
    run(DONE, "--addr", address, "--restore-flash", kept, "--confirm", "fallback", "--backup-to",
        flash_rig_path("second.bin"));
    run(DONE, "--addr", address, "--verify", kept);
#undef WRITE
    ck_assert_int_eq(chdir("/"), 0);
}
END_TEST

/* H7 */
START_TEST(shows_what_is_wrong_with_the_boot_block)
{
    const char *const flash = flash_rig_path("flash"), *const args[] = {"--card", "7i93", "--flash", flash, NULL};
    const char *const image = flash_rig_image("7i93_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 3});
    simulator_stop(&sim);
    simulator_start(&sim, args);
    run(DONE, "--addr", sim.address[0], "--write", image, "--dry-run");
    ck_assert_ptr_null(strstr(tool.text, "boot block 0x"));
    simulator_stop(&sim);
    FILE *const file = fopen(flash, "r+b");
    ck_assert_ptr_nonnull(file);
    ck_assert_int_eq(fseek(file, 25, SEEK_SET), 0);
    ck_assert_int_eq(fputc(0x08, file), 0x08); /* of a chip half as large */
    ck_assert_int_eq(fclose(file), 0);
    simulator_start(&sim, args);
    for (unsigned repair = 0; repair < 2; repair++) {
        run(repair ? DONE : REFUSED, "--addr", sim.address[0], "--write", image,
            repair ? "--fix-boot-block" : "--verbose", "--backup-to", flash_rig_path("kept.bin"));
        printed("boot block 0x10, found:    FF FF 32 61 00 00 32 81 0B 08 32 A1 00 00 32 C1\n");
        printed("boot block 0x10, expected: FF FF 32 61 00 00 32 81 0B 10 32 A1 00 00 32 C1\n");
        ck_assert_ptr_null(strstr(tool.text, "boot block 0x00"));
    }
    printed("BootBlock installed\n");
    run(DONE, "--addr", sim.address[0], "--write", image);
    printed("Boot sector OK\n");
    ck_assert_ptr_null(strstr(tool.text, "boot block 0x"));
}
END_TEST

/* H14 */
START_TEST(tells_the_way_back_from_a_stored_address)
{
    static const char *const bad[] = {"ip=0.1.2.3", "ip=10.0.0.0", "ip=10.0.0.255", "ip=255.255.255.255",
                                      "ip=224.0.0.1"};
    static const struct {
        const char *jumpers, *words;
        bool counts;
    } rows[] = {{"0", "as they are now: fixed 192.168.1.121 (0)", false},
                {"1", "as they are now: fixed from EEPROM (1)", true},
                {"2", "as they are now: from BOOTP (2)", false},
                {"3", "as they are now: Force Fallback (3)", false}};
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        simulator_stop(&sim);
        simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--jumpers", rows[i].jumpers, NULL});
        run(DONE, "--addr", sim.address[0], "--set", "ip=10.9.8.7");
        printed(rows[i].words);
        printed("both address jumpers down, power on, and it is at 192.168.1.121");
        ck_assert(rows[i].counts == !strstr(tool.text, "warning: the card does not take its address"));
    }
    for (unsigned i = 0; i < sizeof bad / sizeof bad[0]; i++)
        run(REFUSED, "--addr", sim.address[0], "--set", bad[i]);
    run(DONE, "--addr", sim.address[0], "--json"); /* none of them was stored */
    printed("\"eeprom_ip\": \"10.9.8.7\"");
}
END_TEST

/* H14: what is network and broadcast depends on the card's own mask. */
START_TEST(judges_addresses_by_the_cards_mask)
{
    const char *const address = sim.address[0];
    static const struct {
        int status;
        const char *setting;
    } rows[] = {{DONE, "ip=10.0.1.77"}, /* the card's own may be anything */
                {DONE, "netmask=255.255.254.0"},
                {DONE, "ip=10.0.0.255"},
                {DONE, "ip=10.0.1.0"},
                {REFUSED, "ip=10.0.0.0"},
                {REFUSED, "ip=10.0.1.255"},
                {REFUSED, "netmask=255.255.255.0"},
                {DONE, "ip=10.0.1.6"},
                {DONE, "netmask=255.255.255.0"},
                {REFUSED, "ip=10.0.0.255"},
                {DONE, "netmask=255.255.255.248"},
                {REFUSED, "ip=10.0.1.8"},
                {REFUSED, "ip=10.0.1.15"},
                {DONE, "ip=10.0.1.9"}};
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++)
        run(rows[i].status, "--addr", address, "--set", rows[i].setting, "--any-traffic");
}
END_TEST

START_TEST(prints_daughter_boards_in_capitals)
{
    run(DONE, "--addr", sim.address[1], "--readhmid", "--dbname1", "7i77");
    printed("7I77");
    ck_assert_ptr_null(strstr(tool.text, "7i77"));
}
END_TEST

static void write_list(const char *const path, const char *const hash, const char *const card)
{
    FILE *const file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    ck_assert_int_ge(fprintf(file, "# images of this house\n%.64s %s\n", hash, card), 0);
    ck_assert_int_eq(fclose(file), 0);
}

/* H3: same FPGA, other card; the file does not tell, a list of hashes does. */
START_TEST(believes_a_list_of_known_images)
{
    const char *const address = sim.address[1], *const list = flash_rig_path("known");
    const char *const image = flash_rig_image("firmware.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 3});
    run(REFUSED, "--addr", address, "--write", image, "--dry-run");
    printed("says what card it is for");
    char hash[65] = "";
    memcpy(hash, strstr(tool.text, "sha256: '") + 9, 64);
    write_list(list, hash, "7I92");
    run(REFUSED, "--addr", address, "--write", image, "--known", list);
    printed("the image is for a 7I92, going by its entry in the list of known images");
    write_list(list, hash, "7I93");
    run(DONE, "--addr", address, "--write", image, "--known", list);
    write_list(list, "no hash", "7I93");
    run(REFUSED, "--addr", address, "--write", image, "--known", list);
    printed("line 2 of the list of known images");
    run(REFUSED, "--addr", address, "--write", image, "--known", "/nonexistent");
}
END_TEST

/* H15: each command that has to do with the flash says which of two chips it is about. */
START_TEST(reminds_of_the_second_chip)
{
    static const char words[] = "the 7I76E has two flash chips, and this concerns only the one that jumper W9 chooses";
    const char *const image = flash_rig_image("7i76e_a.bit", &(struct sim_flash_file){.profile = "7i76e", .seed = 1});
    const char *const dump = flash_rig_path("dump.bin");
    simulator_stop(&sim);
    simulator_start(&sim, (const char *const[]){"--card", "7i76e", NULL});
    const char *const commands[][2] = {
        {"--write", image}, {"--verify", image}, {"--backup-flash", dump}, {"--restore-flash", dump}};
    for (unsigned i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        run(DONE, "--device", "7i76e", "--addr", sim.address[0], commands[i][0], commands[i][1]);
        printed(words);
    }
    run(DONE, "--device", "7i76e", "--addr", sim.address[0]);
    ck_assert_ptr_null(strstr(tool.text, "two flash chips"));
}
END_TEST

/* H18: a check sum beside the file counts without being asked for, and the file's own is printed. */
START_TEST(refuses_a_file_that_its_check_sum_does_not_fit)
{
    static const char wrong[] = "0000000000000000000000000000000000000000000000000000000000000000 *7i96s_test.bin\n";
    const char *const address = sim.address[0], *const image = image_7i96s(1);
    run(REFUSED, "--addr", address, "--write", image, "--sha256-check");
    run(DONE, "--addr", address, "--write", image, "--dry-run");
    const char *const hash = strstr(tool.text, "sha256: '");
    ck_assert_ptr_nonnull(hash);
    ck_assert_uint_eq(strspn(hash + 9, "0123456789abcdef"), 64);
    char right[100];
    snprintf(right, sizeof right, "%.64s *7i96s_test.bin\n", hash + 9);
    const char *const texts[] = {wrong, "no check sum\n", right};
    for (unsigned i = 0; i < 3; i++) {
        FILE *const side = fopen(flash_rig_path("7i96s_test.bin.sha256"), "w");
        ck_assert_ptr_nonnull(side);
        ck_assert_int_ge(fputs(texts[i], side), 0);
        ck_assert_int_eq(fclose(side), 0);
        run(i == 2 ? DONE : REFUSED, "--addr", address, "--write", image);
        ck_assert(i == 2 || !strstr(tool.text, "Board: ")); /* nothing but the file was looked at */
    }
    printed("Bitfile integrity verification passed\n");
}
END_TEST

/* H12 */
START_TEST(reads_and_never_writes_a_card_whose_chip_it_does_not_know)
{
    const char *const image = flash_rig_image("7i93_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 1});
    simulator_stop(&sim);
    simulator_start(&sim, (const char *const[]){"--card", "7i93", "--flash-chip", "64Mb", NULL});
    const char *const address = sim.address[0];
    run(REFUSED, "--addr", address, "--write", image);
    printed("the flash chip's ID is 0x16 and the card gives its size as 2^");
    printed("so it can be read and not written");
    run(REFUSED, "--addr", address, "--backup-flash", flash_rig_path("dump"));
    printed("Unknown size FLASH memory on the 7I93 board");
    run(DONE, "--addr", address, "--json");
    printed("\"flash_id\": 22, \"flash_bytes\": 0}");
    run(DONE, "--addr", address, "--verbose");
    ck_assert_ptr_null(strstr(tool.text, "Flash size")); /* as mesaflash: no line for an ID it does not know */
    run(DONE, "--addr", address, "--discover");
    printed("fallback: ?, user: ?");
    ck_assert_str_eq(simulator_ask(&sim, "card 0 flash"), "programs 0 erases 0 sector-0 0");
}
END_TEST

/* H20: by any name, which card it is and which part of it stands there before anything happens. */
START_TEST(says_which_card_and_which_part_before_it_acts)
{
    char board[96], mac[18], line[128];
    const char *const address = sim.address[1], *const dump = flash_rig_path("dump.bin");
    const char *const image = flash_rig_image("7i93_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 3});
    const char *const text = run(DONE, "--device", "ether", "--addr", address, "--json");
    ck_assert_ptr_nonnull(strstr(text, "\"mac\": \""));
    snprintf(mac, sizeof mac, "%s", strstr(text, "\"mac\": \"") + 8);
    snprintf(board, sizeof board, "Board: 7I93 at %s, MAC address %s, ", address, mac);
    const struct {
        const char *option, *file, *part, *act;
    } rows[] = {{"--write", image, "user area", "Programming"},
                {"--verify", image, "user area", "Verifying"},
                {"--backup-flash", dump, NULL, "Reading"},
                {"--verify", dump, "whole flash", "Verifying"},
                {"--restore-flash", dump, "whole flash", "FLASH memory sectors to write: 0"}};
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        run(DONE, "--device", "ether", "--addr", address, rows[i].option, rows[i].file, "--expect-mac", mac);
        if (!rows[i].part)
            continue;
        snprintf(line, sizeof line, "%s%s\n", board, rows[i].part);
        printed(line);
        printed(rows[i].act);
        ck_assert(strstr(tool.text, line) < strstr(tool.text, rows[i].act));
        run(REFUSED, "--device", "ether", "--addr", address, rows[i].option, rows[i].file, "--expect-mac",
            "02:00:00:00:00:01");
        printed("not 02:00:00:00:00:01");
    }
    run(DONE, "--addr", address, "--write", image, "--fallback", "--dry-run", "--override", "7i93", "--confirm",
        "fallback");
    snprintf(line, sizeof line, "%sfallback area\n", board);
    printed(line);
}
END_TEST

/* Datagrams to card 1, a thousand a second, until this process is ended. */
static pid_t start_driver(void)
{
    static const uint8_t request[] = {0x01, 0x42, 0x00, 0x01};
    const pid_t pid = fork();
    ck_assert_int_ge(pid, 0);
    if (pid > 0)
        return pid;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(LBP16_UDP_PORT)};
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (inet_pton(AF_INET, sim.address[1], &to.sin_addr) != 1)
        _exit(1);
    for (;;) {
        (void)!sendto(fd, request, sizeof request, 0, (const struct sockaddr *)&to, sizeof to);
        usleep(1000);
    }
}

/* Until the driver had its turn while the tool was looking: on a busy machine it may not at first. */
static void comes_to(const int status, const char *const words, const char *const *const args)
{
    const char *argv[MAX_ARGS] = {process_built("hm2flash"), "--addr", sim.address[1]};
    int got = -1;
    for (unsigned n = 0; args[n]; n++)
        argv[n + 3] = args[n];
    for (unsigned i = 0; i < 20; i++) {
        got = process_run(&tool, argv, RUN_MS);
        if (got == status && strstr(tool.text, words))
            return;
        (void)remove(flash_rig_path("dump"));
    }
    ck_abort_msg("%s: status %d instead of %d, and no \"%s\": %s", args[0], got, status, words, tool.text);
}

/* H10, H11: who reads the flash holds up a driver, too. */
START_TEST(keeps_away_from_the_flash_of_a_card_in_use)
{
    static const char words[] = "another program talks to this card", not_looked_at[] = "not looked at while";
    const char *const image = flash_rig_image("7i93_test.bit", &(struct sim_flash_file){.profile = "7i93", .seed = 3});
    const char *const dump = flash_rig_path("dump"), *const page = flash_rig_path("page.html");
    const pid_t driver = start_driver();
    const struct {
        int status;
        const char *words, *args[3];
    } rows[] = {{REFUSED, words, {"--write", image}},       {REFUSED, words, {"--verify", image}},
                {REFUSED, words, {"--backup-flash", dump}}, {DONE, not_looked_at, {"--verbose"}},
                {DONE, not_looked_at, {"--discover"}},      {DONE, "\"in_use\": true}", {"--json"}},
                {DONE, "created", {"--report", page}}};
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++)
        comes_to(rows[i].status, rows[i].words, rows[i].args);
    run(DONE, "--addr", sim.address[1], "--verbose", "--any-traffic");
    printed("  flash: sector 0: boot block");
    kill(driver, SIGKILL);
    ck_assert_int_eq(waitpid(driver, NULL, 0), driver);
    ck_assert_str_eq(simulator_ask(&sim, "card 1 flash"), "programs 0 erases 0 sector-0 0");
}
END_TEST

/* A program that reads JSON gets an object in any case, and the sentences in it. */
START_TEST(failures_are_json_too)
{
    char both[40];
    snprintf(both, sizeof both, "%s,%s", sim.address[0], sim.address[1]);
    run(REFUSED, "--device", "7i96", "--addr", sim.address[0], "--json");
    printed("\"done\": false, \"status\": 3, \"error\": \"the card at ");
    run(LOST, "--addr", "127.255.255.254", "--json");
    printed("\"status\": 4, \"error\": \"no card answers LBP16");
    run(REFUSED, "--addr", sim.address[1], "--write", image_7i96s(1), "--json");
    printed("\"error\": \"Error: wrong bitfile destination device: T20F256, should be 6slx9tqg144.");
    run(REFUSED, "--device", "7i93", "--addr", both, "--json");
    printed("\"device\": \"7I96S\", \"done\": false, \"status\": 3");
    printed("\"device\": \"7I93\", \"name\": \"7I93\"");
    run(REFUSED, "--info", "/nonexistent", "--json");
    printed("\"status\": 3, \"error\": \"Can't open file /nonexistent");
    const char *const image = image_7i96s(2);
    const char *const text = run(FAILED, "--addr", sim.address[0], "--verify", image, "--json");
    ck_assert_ptr_null(strstr(strstr(text, "difference_at"), "\"status\"")); /* one object, not two */
}
END_TEST

START_TEST(works_on_many_cards_and_finds_them)
{
    char both[40], line[96];
    snprintf(both, sizeof both, "%s,%s", sim.address[0], sim.address[1]);
    run(DONE, "--device", "ether", "--addr", both);
    for (unsigned i = 0; i < 2; i++) {
        snprintf(line, sizeof line, "%s: ETH device %s at ip=%s\n", sim.address[i], i ? "7I93" : "7I96S",
                 sim.address[i]);
        printed(line);
    }
    run(REFUSED, "--device", "7i93", "--addr", both); /* one of them is */
    run(DONE, "--discover", "--addr", both);
    printed("7I96S");
    printed("fallback: Xilinx image, user: blank");
    run(LOST, "--discover", "--addr", "127.255.255.254");
}
END_TEST

START_TEST(goes_by_the_name_of_mesaflash_too)
{
    const char *const link = flash_rig_path("mesaflash");
    const char *const argv[] = {link, "--version", NULL};
    ck_assert_int_eq(symlink(process_built("hm2flash"), link), 0);
    ck_assert_int_eq(process_run(&tool, argv, RUN_MS), 0);
    ck_assert_str_eq(strncmp(tool.text, "Mesaflash version 3.5.16", 24) == 0 ? "" : tool.text, "");
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2flash");
    TCase *const tests = tcase_create("programs");
    tcase_add_checked_fixture(tests, set_up, tear_down);
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, identifies_a_card);
    tcase_add_test(tests, tells_what_is_wrong_by_its_exit_status);
    tcase_add_test(tests, writes_verifies_and_starts_an_image);
    tcase_add_test(tests, refuses_before_it_erases);
    tcase_add_test(tests, backs_up_and_restores);
    tcase_add_test(tests, sets_and_reads_settings_and_registers);
    tcase_add_test(tests, asks_before_outputs_let_go);
    tcase_add_test(tests, backs_up_before_the_fallback_image_is_replaced);
    tcase_add_test(tests, shows_what_is_wrong_with_the_boot_block);
    tcase_add_test(tests, tells_the_way_back_from_a_stored_address);
    tcase_add_test(tests, judges_addresses_by_the_cards_mask);
    tcase_add_test(tests, prints_daughter_boards_in_capitals);
    tcase_add_test(tests, believes_a_list_of_known_images);
    tcase_add_test(tests, reminds_of_the_second_chip);
    tcase_add_test(tests, refuses_a_file_that_its_check_sum_does_not_fit);
    tcase_add_test(tests, reads_and_never_writes_a_card_whose_chip_it_does_not_know);
    tcase_add_test(tests, says_which_card_and_which_part_before_it_acts);
    tcase_add_test(tests, keeps_away_from_the_flash_of_a_card_in_use);
    tcase_add_test(tests, failures_are_json_too);
    tcase_add_test(tests, works_on_many_cards_and_finds_them);
    tcase_add_test(tests, goes_by_the_name_of_mesaflash_too);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
