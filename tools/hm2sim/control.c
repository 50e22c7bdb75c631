/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "control.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "faults.h"
#include "remotes.h"

#define MAX_WORDS    6u
#define ANY_WORDS    0u
#define COMMAND_SIZE 512u

struct command {
    const char *words[MAX_WORDS];
    unsigned count;
    struct station *first; /* the stations that it is for */
    unsigned stations;
    int64_t now_ns;
    char *reply;
};

static void answer(const struct command *const c, const char *const text)
{
    snprintf(c->reply, CONTROL_REPLY_SIZE, "%s", text);
}

static bool read_io(const struct command *const c, const char *const text, unsigned *const io)
{
    char *end;
    const unsigned long value = strtoul(text, &end, 10);
    if (*text < '0' || *text > '9' || *end != '\0' || value >= HM2_MAX_PINS)
        return false;
    *io = (unsigned)value;
    for (unsigned i = 0; i < c->stations; i++)
        if (*io >= sim_card_idrom(c->first[i].card)->pin_count)
            return false;
    return true;
}

static void do_faults(const struct command *const c)
{
    struct hm2_diag diag = {0};
    struct sim_faults faults = {.seed = 0};
    if (faults_option(c->words[1], &faults, &diag)) {
        snprintf(c->reply, CONTROL_REPLY_SIZE, "error: %.1000s", diag.text);
        return;
    }
    for (unsigned i = 0; i < c->stations; i++) {
        faults.seed = (uint64_t)c->now_ns + i;
        if (sim_net_set_faults(c->first[i].net, &faults)) {
            answer(c, "error: faults out of range");
            return;
        }
    }
}

static void do_freeze(const struct command *const c)
{
    const bool on = strcmp(c->words[1], "on") == 0;
    if (!on && strcmp(c->words[1], "off") != 0) {
        answer(c, "error: freeze on or freeze off");
        return;
    }
    for (unsigned i = 0; i < c->stations; i++)
        sim_net_freeze(c->first[i].net, on);
}

static void do_power_cycle(const struct command *const c)
{
    for (unsigned i = 0; i < c->stations; i++)
        sim_card_power_cycle(c->first[i].card);
}

static void do_power_off(const struct command *const c)
{
    for (unsigned i = 0; i < c->stations; i++)
        sim_card_power_off(c->first[i].card);
}

static void do_flash_faults(const struct command *const c)
{
    struct hm2_diag diag = {0};
    struct sim_flash_faults faults;
    if (flash_faults_option(c->words[1], &faults, &diag)) {
        snprintf(c->reply, CONTROL_REPLY_SIZE, "error: %.1000s", diag.text);
        return;
    }
    for (unsigned i = 0; i < c->stations; i++)
        sim_card_flash_faults(c->first[i].card, &faults);
}

static void do_boots(const struct command *const c)
{
    const struct sim_card *const card = c->first[0].card;
    snprintf(c->reply, CONTROL_REPLY_SIZE, "runs %s boots %s", sim_boot_name(sim_card_running(card)),
             sim_boot_name(sim_card_would_boot(card)));
}

static void do_flash(const struct command *const c)
{
    const struct sim_flash_counts counts = sim_card_flash_counts(c->first[0].card);
    snprintf(c->reply, CONTROL_REPLY_SIZE, "programs %" PRIu64 " erases %" PRIu64 " sector-0 %" PRIu64, counts.programs,
             counts.erases, counts.sector0_erases);
}

static void do_drive(const struct command *const c)
{
    unsigned io;
    enum sim_level level;
    if (!read_io(c, c->words[1], &io) || strlen(c->words[2]) != 1 || !options_level(c->words[2][0], &level)) {
        answer(c, "error: drive IO 0, 1, z or h");
        return;
    }
    for (unsigned i = 0; i < c->stations; i++)
        (void)!sim_card_drive(c->first[i].card, sim_card_clock_at(c->first[i].card, c->now_ns), io, level);
}

static void do_pad(const struct command *const c)
{
    static const char *const levels[] = {[SIM_LOW] = "0", [SIM_HIGH] = "1", [SIM_FLOAT] = "z", [SIM_PULLUP] = "h"};
    unsigned io;
    if (read_io(c, c->words[1], &io))
        answer(c, levels[sim_card_pad(c->first[0].card, io)]);
    else
        answer(c, "error: pad IO");
}

static void do_stats(const struct command *const c)
{
    size_t used = 0;
    c->reply[0] = '\0';
    for (unsigned i = 0; i < c->stations && used + 256 < CONTROL_REPLY_SIZE; i++) {
        const struct station *const s = &c->first[i];
        const struct sim_net_truth t = sim_net_truth(s->net);
        char name[STATION_NAME_SIZE];
        station_name(s, name);
        const int n = snprintf(
            c->reply + used, CONTROL_REPLY_SIZE - used,
            "%s requests %" PRIu64 " replies %" PRIu64 " lost %" PRIu64 " %" PRIu64 " duplicated %" PRIu64 " %" PRIu64
            " reordered %" PRIu64 " %" PRIu64 " truncated %" PRIu64 " %" PRIu64 " foreign %" PRIu64 " %" PRIu64 "\n",
            name, s->requests, s->replies, t.lost[0], t.lost[1], t.duplicated[0], t.duplicated[1], t.reordered[0],
            t.reordered[1], t.truncated[0], t.truncated[1], t.foreign[0], t.foreign[1]);
        used += n > 0 ? (size_t)n : 0;
    }
}

/* What follows the reader stands behind a space here. */
static void do_absolute(const struct command *const c)
{
    char text[COMMAND_SIZE];
    struct absolute_encoder encoder;
    struct hm2_diag diag = {0};
    snprintf(text, sizeof text, "%s:%s", c->words[1], c->words[2]);
    int err = absolute_option(text, &encoder, &diag);
    for (unsigned i = 0; i < c->stations && !err; i++)
        err = absolutes_add(&c->first[i].absolutes, &encoder, c->now_ns, &diag);
    if (err)
        snprintf(c->reply, CONTROL_REPLY_SIZE, "error: %.1000s", diag.text);
}

static void do_remote(const struct command *const c)
{
    for (unsigned i = 0; i < c->stations; i++) {
        struct sim_card *const card = c->first[i].card;
        sim_card_advance(card, sim_card_clock_at(card, c->now_ns));
        remotes_command(card, c->words + 1, c->count - 1, c->reply, CONTROL_REPLY_SIZE);
    }
}

static void do_quit(const struct command *const c)
{
    (void)c;
}

static const struct {
    const char *name;
    unsigned words;
    void (*run)(const struct command *command);
} commands[] = {
    {"faults", 2, do_faults},
    {"freeze", 2, do_freeze},
    {"power-cycle", 1, do_power_cycle},
    {"drive", 3, do_drive},
    {"pad", 2, do_pad},
    {"stats", 1, do_stats},
    {"power-off", 1, do_power_off},
    {"flash-faults", 2, do_flash_faults},
    {"boots", 1, do_boots},
    {"flash", 1, do_flash},
    {"quit", 1, do_quit},
    {"remote", ANY_WORDS, do_remote},
    {"absolute", 3, do_absolute},
};

/* "card N" in front names one card; else a command is for all of them. */
static char *choose_card(char *const text, struct command *const c)
{
    static const char prefix[] = "card ";
    char *end;
    if (strncmp(text, prefix, strlen(prefix)) != 0)
        return text;
    const unsigned long number = strtoul(text + strlen(prefix), &end, 10);
    if (end == text + strlen(prefix) || number >= c->stations)
        return NULL;
    c->first += number;
    c->stations = 1;
    return end;
}

bool control_command(char *const text, struct station *const stations, const unsigned count, const int64_t now_ns,
                     char reply[const CONTROL_REPLY_SIZE])
{
    struct command c = {.first = stations, .stations = count, .now_ns = now_ns, .reply = reply};
    char *rest = choose_card(text, &c);
    char *state = NULL;
    answer(&c, "ok");
    for (unsigned i = 0; i < count; i++)
        station_run(&stations[i], now_ns);
    if (!rest) {
        answer(&c, "error: no such card");
        return false;
    }
    for (char *word; (word = strtok_r(rest, " \t\r\n", &state)) && c.count < MAX_WORDS; rest = NULL)
        c.words[c.count++] = word;
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        const bool fits = c.count == commands[i].words || commands[i].words == ANY_WORDS;
        if (c.count == 0 || !fits || strcmp(c.words[0], commands[i].name) != 0)
            continue;
        commands[i].run(&c);
        return commands[i].run == do_quit;
    }
    answer(&c, "error: commands are: [card N] faults LIST, freeze on|off, power-cycle, power-off, flash, "
               "flash-faults LIST, boots, drive IO 0|1|z|h, pad IO, remote PORT:CHANNEL ..., absolute READER LIST, "
               "stats, quit");
    return false;
}

int control_open(const char *const path, int *const fd, struct hm2_diag *const diag)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    struct stat st;
    if (strlen(path) >= sizeof at.sun_path)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "control socket %s: the path has more than %zu characters", path,
                            sizeof at.sun_path - 1);
    memcpy(at.sun_path, path, strlen(path));
    if (lstat(path, &st) == 0 && S_ISSOCK(st.st_mode))
        unlink(path);
    *fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (*fd >= 0 && bind(*fd, (const struct sockaddr *)&at, sizeof at) == 0)
        return 0;
    return hm2_diag_add(diag, HM2_ERR_IO, "control socket %s: %s", path, strerror(errno));
}

/* Lines are commands that follow each other at one moment; the first error ends them. */
static bool obey(char *const text, struct station *const stations, const unsigned count, const int64_t now_ns,
                 char reply[const CONTROL_REPLY_SIZE])
{
    for (char *line = text, *next; line; line = next) {
        next = strchr(line, '\n');
        if (next)
            *next++ = '\0';
        if (next && !*next)
            next = NULL; /* the end of the last line */
        if (control_command(line, stations, count, now_ns, reply))
            return true;
        if (strncmp(reply, "error", 5) == 0)
            return false;
    }
    return false;
}

bool control_receive(const int fd, struct station *const stations, const unsigned count, const int64_t now_ns)
{
    char command[COMMAND_SIZE], reply[CONTROL_REPLY_SIZE];
    struct sockaddr_un from;
    socklen_t from_len = sizeof from;
    const ssize_t len = recvfrom(fd, command, sizeof command - 1, MSG_DONTWAIT, (struct sockaddr *)&from, &from_len);
    if (len < 0)
        return false;
    command[len] = '\0';
    const bool quit = obey(command, stations, count, now_ns, reply);
    if (from_len > sizeof(sa_family_t)) /* the sender has a name */
        (void)!sendto(fd, reply, strlen(reply), MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)&from, from_len);
    return quit;
}
