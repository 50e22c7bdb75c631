/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What the files of hm2flash share. Texts for scripts go to stdout in mesaflash's words, what went wrong and what to do
 * about it goes to stderr. */
#ifndef HM2FLASH_CLI_H
#define HM2FLASH_CLI_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/flash.h>

enum { DONE = 0, FAILED = 1, USAGE = 2, REFUSED = 3, LOST = 4 };

#define CONNECTORS 6u

struct cli {
    /* what was asked for */
    char device[32];
    const char *address, *override, *expect_mac, *backup_to, *known;
    const char *dbnames[CONNECTORS];
    bool fallback, xml, verbose, json, dry_run, fix_boot_block, no_verify, sha256_check, reload, any_traffic;
    bool confirm_fallback, confirm_outputs;
    unsigned pages;
    /* where we are */
    bool many; /* one of several cards: no progress */
    struct link *link;
    struct flash_card *card;
    const struct flash_card_info *info;
    struct hm2_diag diag;
};

extern volatile sig_atomic_t interrupted;

/* To people on stdout, unless --json was given. */
void say(const struct cli *cli, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Print diag on stderr and empty it; returns the exit status that belongs to the error. */
int report(struct cli *cli, int err);
/* A sentence of the program's own on stderr; returns status. */
int complain(const struct cli *cli, int status, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* Name of the card as on the command line. */
const char *card_name(const struct cli *cli);
/* Where the card's address comes from, as its jumpers say. */
const char *jumper_text(const struct flash_card_info *info);
/* Refuse when somebody else uses the card. */
int check_alone(struct cli *cli);
/* What the flash holds, unless somebody else uses the card: HM2_ERR_STATE. */
int look_at_flash(struct cli *cli, struct flash_survey *survey);
#define IN_USE "not looked at while another program uses the card"
/* May outputs change? By option or by an answer at the terminal; otherwise says what to do. */
bool confirmed(struct cli *cli);
/* Refuse when outputs are driven, unless confirmed (what = "Reloading"); or when somebody else uses the card. */
int check_machine(struct cli *cli, const char *what);

/* ---- JSON: one object on a line ------------------------------------------------------------------------------------
 */

void json_begin(const struct cli *cli); /* all of these print nothing without --json */
void json_text(const struct cli *cli, const char *key, const char *value);
void json_number(const struct cli *cli, const char *key, double value);
void json_bool(const struct cli *cli, const char *key, bool value);
void json_array(const struct cli *cli, const char *key);
void json_object(const struct cli *cli); /* an element of an array */
void json_close(const struct cli *cli, char bracket);
void json_end(const struct cli *cli);
/* What goes to stderr is kept, and printed as an object of its own when a command fails that printed none. */
void json_problem(const char *text);
void json_failure(const struct cli *cli, int status);
/* The object of a finished command. */
void json_result(const struct cli *cli, const char *action);

/* ---- files
 * ----------------------------------------------------------------------------------------------------------- */

#define SHA256_TEXT 65u

void sha256_text(const uint8_t *bytes, size_t len, char text[SHA256_TEXT]);
/* Compare bytes with PATH.sha256: 0, or an exit status. A file that is not there is an error only when required. */
int check_side_file(struct cli *cli, const char *path, const uint8_t *bytes, size_t len, bool required,
                    const char *what);
/* The card that the list of --known says the image is for; empty when it says nothing. 0, or an exit status. */
int look_up_image(struct cli *cli, const uint8_t *bytes, size_t len, char card[FLASH_TEXT_BYTES]);
int write_side_files(struct cli *cli, const char *path, const uint8_t *bytes, size_t len);

/* ---- progress
 * --------------------------------------------------------------------------------------------------------- */

struct progress {
    const struct cli *cli;
    const char *kind; /* "FLASH memory sectors" */
    int phase;
    unsigned shown;
    bool terminal, line_open;
    double start_s;
    uint64_t bytes;
};

void progress_init(struct progress *progress, const struct cli *cli);
bool progress_show(void *context, const struct flash_progress *now);
void progress_close(struct progress *progress);
double seconds_now(void);

/* ---- commands: each returns an exit status
 * --------------------------------------------------------------------------- */

int do_identify(struct cli *cli, const char *arg);
int do_readhmid(struct cli *cli, const char *arg);
int do_print_pd(struct cli *cli, const char *arg);
int do_print_lio(struct cli *cli, const char *arg);
int do_sserial(struct cli *cli, const char *arg);
int do_rpo(struct cli *cli, const char *arg);
int do_wpo(struct cli *cli, const char *arg);
int do_set(struct cli *cli, const char *arg);
int do_enable_all(struct cli *cli, const char *arg);
int do_safe_io(struct cli *cli, const char *arg);
int do_write(struct cli *cli, const char *arg);
int do_verify(struct cli *cli, const char *arg);
int do_backup(struct cli *cli, const char *arg);
int do_restore(struct cli *cli, const char *arg);
int do_program(struct cli *cli, const char *arg);
int do_reload(struct cli *cli, const char *arg);
int do_reset(struct cli *cli, const char *arg);
int do_info(struct cli *cli, const char *arg);
int do_discover(struct cli *cli, const char *arg);
int do_report(struct cli *cli, const char *arg);

struct hm2_terminals;
/* Terminal names of a connector (NULL = none) and what they are called, as the options or the card's table say. */
const struct hm2_terminals *terminals_of(const struct cli *cli, unsigned port, const char **name);
const char *connector_of(const struct cli *cli, unsigned port);

/* What a smart-serial remote's unit number says of it: " ANALOG" or nothing. */
const char *sserial_part(uint32_t unit);
/* Print the header of an image as --info does. */
void print_image(const struct cli *cli, const struct flash_image *image);
/* Wait for the card after a restart and say what runs. */
int await_card(struct cli *cli, const char *what);
/* A backup of the whole chip into a file or folder. */
int backup_to(struct cli *cli, const char *where);

#endif
