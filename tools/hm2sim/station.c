/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "station.h"

#include <arpa/inet.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "../common/whole_file.h"
#include "remotes.h"

#define MAX_FIRMWARE_BYTES (1u << 20)
#define PEER_STEP_NS       1000000
#define WIRED_STEP_NS \
    5000000 /* edges on wires, of switches and of shafts are made at least this often, not all at the next packet */

/* ---- clients ------------------------------------------------------------------------------------------------------
 */

static uint64_t client_number(const struct sockaddr_in *const from)
{
    return (uint64_t)ntohl(from->sin_addr.s_addr) << 16 | ntohs(from->sin_port);
}

static void deliver(void *const context, const uint64_t client, const uint8_t *const data, const size_t len,
                    const bool foreign)
{
    struct station *const s = context;
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)client), .sin_addr.s_addr = htonl((uint32_t)(client >> 16))};
    const int fd = foreign ? s->foreign_socket : s->socket;
    if (sendto(fd, data, len, MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)&to, sizeof to) < 0)
        s->send_errors++;
    else if (!foreign)
        s->replies++;
}

/* ---- what the world does by itself --------------------------------------------------------------------------------
 */

static void drive_patterns(struct station *const s, const int64_t now_ns)
{
    for (unsigned i = 0; i < s->options->pattern_count; i++) {
        const struct pattern *const p = &s->options->patterns[i];
        while (s->pattern_due_ns[i] <= now_ns) {
            const int64_t due_ns = s->pattern_due_ns[i];
            const enum sim_level level = p->levels[s->pattern_step[i]];
            sim_net_sleep_until(s->net, due_ns);
            (void)!sim_card_drive(s->card, sim_card_clock_at(s->card, due_ns), p->io, level);
            s->pattern_step[i] = (s->pattern_step[i] + 1) % p->count;
            s->pattern_due_ns[i] = p->count > 1 ? due_ns + p->step_ns : INT64_MAX;
        }
    }
}

static void press_switches(struct station *const s, const int64_t now_ns)
{
    if (s->options->switch_count == 0)
        return;
    sim_card_advance(s->card, sim_card_clock_at(s->card, now_ns));
    axes_run(&s->axes);
}

void station_receive(struct station *const s, const int64_t now_ns)
{
    uint8_t data[2048];
    struct sockaddr_in from = {.sin_family = AF_INET};
    socklen_t from_len = sizeof from;
    const ssize_t len =
        recvfrom(s->socket, data, sizeof data, MSG_DONTWAIT | MSG_TRUNC, (struct sockaddr *)&from, &from_len);
    if (len < 0 || (size_t)len > sizeof data)
        return;
    s->requests++;
    drive_patterns(s, now_ns); /* what was due before it came has happened, whichever the loop looked at first */
    press_switches(s, now_ns);
    absolutes_run(&s->absolutes, now_ns);
    peers_run(&s->peers, now_ns);
    sim_net_arrive(s->net, now_ns, client_number(&from), data, (size_t)len);
}

void station_run(struct station *const s, const int64_t now_ns)
{
    drive_patterns(s, now_ns);
    sim_net_sleep_until(s->net, now_ns);
    press_switches(s, now_ns);
    absolutes_run(&s->absolutes, now_ns);
    peers_run(&s->peers, now_ns);
    ppmc_turn(&s->ppmc, now_ns);
}

void station_receive_ppmc(struct station *const s, const int64_t now_ns)
{
    station_run(s, now_ns);
    ppmc_receive(&s->ppmc);
}

int64_t station_next_ns(const struct station *const s)
{
    int64_t next_ns = sim_net_next_ns(s->net);
    for (unsigned i = 0; i < s->options->pattern_count; i++)
        if (s->pattern_due_ns[i] < next_ns)
            next_ns = s->pattern_due_ns[i];
    if (s->options->wire_count > 0 || s->options->switch_count > 0 || s->options->ppmc) {
        const int64_t step_ns = link_now_ns(sim_net_link(s->net)) + WIRED_STEP_NS;
        next_ns = step_ns < next_ns ? step_ns : next_ns;
    }
    if (peers_exist(&s->peers) || absolutes_move(&s->absolutes)) {
        const int64_t step_ns = link_now_ns(sim_net_link(s->net)) + PEER_STEP_NS;
        next_ns = step_ns < next_ns ? step_ns : next_ns;
    }
    return next_ns;
}

/* ---- opening ------------------------------------------------------------------------------------------------------
 */

static int read_firmware(const char *const path, struct hm2_image *const image, struct hm2_diag *const diag)
{
    size_t len;
    char *const text = whole_file(path, MAX_FIRMWARE_BYTES, &len);
    if (!text)
        return hm2_diag_add(diag, HM2_ERR_IO, "firmware %s cannot be read: %s", path, strerror(errno));
    const int err = hm2_image_from_text(text, len, image, diag);
    free(text);
    return err;
}

static int make_card(struct station *const s, const uint64_t seed, struct hm2_diag *const diag)
{
    const struct card_options *const o = s->options;
    struct hm2_image image;
    struct sim_card_options options = {
        .profile = o->type, .card_name = o->name, .seed = seed, .flash_id = o->flash.id, .sources = o->sources};
    memcpy(options.mac, o->mac, sizeof options.mac);
    memcpy(options.ip, &o->address.s_addr, sizeof options.ip);
    if (o->firmware) {
        const int err = read_firmware(o->firmware, &image, diag);
        if (err)
            return err;
        options.image = &image;
    }
    return sim_card_new(&s->card, &options, diag);
}

static int connect_pins(struct station *const s, struct hm2_diag *const diag)
{
    const struct card_options *const o = s->options;
    for (unsigned i = 0; i < o->wire_count; i++) {
        const int err = sim_card_wire(s->card, o->wires[i].from, o->wires[i].to);
        if (err)
            return hm2_diag_add(diag, err, "--wire %u:%u: %s", o->wires[i].from, o->wires[i].to,
                                err == HM2_ERR_STATE ? "the pin has a wire already, or the wires make a ring"
                                                     : "this card has no such pin");
    }
    for (unsigned i = 0; i < o->pattern_count; i++)
        if (o->patterns[i].io >= sim_card_idrom(s->card)->pin_count)
            return hm2_diag_add(diag, HM2_ERR_RANGE, "--drive %u: this card has I/O 0 to %u", o->patterns[i].io,
                                sim_card_idrom(s->card)->pin_count - 1);
    return 0;
}

static int open_socket(const struct in_addr address, const uint16_t port, int *const fd, struct sockaddr_in *const at,
                       struct hm2_diag *const diag)
{
    char text[INET_ADDRSTRLEN];
    *at = (struct sockaddr_in){.sin_family = AF_INET, .sin_port = htons(port), .sin_addr = address};
    socklen_t at_len = sizeof *at;
    *fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (*fd >= 0 && bind(*fd, (const struct sockaddr *)at, sizeof *at) == 0 &&
        getsockname(*fd, (struct sockaddr *)at, &at_len) == 0)
        return 0;
    return hm2_diag_add(diag, HM2_ERR_IO, "cannot listen at %s:%u: %s", inet_ntop(AF_INET, &address, text, sizeof text),
                        port, strerror(errno));
}

int station_open(struct station *const s, const struct options *const options, const struct card_options *const card,
                 const uint64_t seed, struct hm2_diag *const diag)
{
    struct sockaddr_in unused;
    struct sim_faults faults = options->faults;
    faults.seed = seed;
    *s = (struct station){.options = card, .flash.fd = -1, .socket = -1, .foreign_socket = -1};
    int err = make_card(s, seed, diag);
    if (!err)
        err = flash_open(&s->flash, &card->flash, s->card, diag);
    if (!err)
        err = sim_net_new(&s->net, s->card, &faults);
    if (!err)
        err = connect_pins(s, diag);
    if (!err)
        err = remotes_connect(s->card, card, seed, diag);
    if (!err)
        err = peers_connect(&s->peers, card, s->card, diag);
    if (!err)
        err = axes_connect(&s->axes, card, s->card, diag);
    if (!err)
        err = absolutes_connect(&s->absolutes, s->card, card->absolutes, card->absolute_count, diag);
    if (!err && card->ppmc)
        err = ppmc_open(&s->ppmc, s->card, card->ppmc, diag);
    if (!err)
        err = open_socket(card->address, card->port, &s->socket, &s->address, diag);
    if (!err)
        err = open_socket(card->address, 0, &s->foreign_socket, &unused, diag);
    if (err)
        return err;
    sim_net_on_deliver(s->net, deliver, s);
    sim_net_set_instant(s->net, !options->latency);
    return 0;
}

void station_close(struct station *const s)
{
    if (s->socket >= 0)
        close(s->socket);
    if (s->foreign_socket >= 0)
        close(s->foreign_socket);
    peers_close(&s->peers);
    ppmc_close(&s->ppmc);
    sim_net_free(s->net);
    sim_card_free(s->card);
    flash_close(&s->flash);
}

/* ---- reports ------------------------------------------------------------------------------------------------------
 */

void station_name(const struct station *const s, char name[const STATION_NAME_SIZE])
{
    char address[INET_ADDRSTRLEN];
    inet_ntop(AF_INET, &s->address.sin_addr, address, sizeof address);
    snprintf(name, STATION_NAME_SIZE, "%s@%s:%u", s->options->type, address, ntohs(s->address.sin_port));
}

void station_print_stats(struct station *const s)
{
    char name[STATION_NAME_SIZE];
    const struct sim_net_truth t = sim_net_truth(s->net);
    station_name(s, name);
    printf("%s: requests %" PRIu64 " replies %" PRIu64 " send-errors %" PRIu64 "\n", name, s->requests, s->replies,
           s->send_errors);
    const struct {
        const char *what;
        const uint64_t *count;
    } faults[] = {{"lost", t.lost},           {"duplicated", t.duplicated}, {"reordered", t.reordered},
                  {"truncated", t.truncated}, {"foreign", t.foreign},       {"overflow", t.overflow}};
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++)
        if (faults[i].count[0] + faults[i].count[1] > 0)
            printf("%s: %s to the card %" PRIu64 " from it %" PRIu64 "\n", name, faults[i].what, faults[i].count[0],
                   faults[i].count[1]);
    if (t.unheard > 0)
        printf("%s: unheard while frozen %" PRIu64 "\n", name, t.unheard);
    axes_print(&s->axes, name);
    peers_print(&s->peers, name);
    ppmc_print(&s->ppmc, name);
}
