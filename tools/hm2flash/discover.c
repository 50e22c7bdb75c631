/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Which cards are there? There is no broadcast in the protocol: every address of the attached networks is asked (flash
 * tool reference 6, "Discovery"). */
#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"

#define MOST      1024u
#define AT_A_TIME 128u
#define WAIT_NS   INT64_C(300000000)
#define SUBNET    0xFFFFFF00u
#define HOSTS     254u

struct candidates {
    unsigned count;
    char text[MOST][32];
};

static void add(struct candidates *const list, const char *const text)
{
    for (unsigned i = 0; i < list->count; i++)
        if (strcmp(list->text[i], text) == 0)
            return;
    if (list->count < MOST)
        snprintf(list->text[list->count++], sizeof list->text[0], "%s", text);
}

static void add_subnet(struct candidates *const list, const uint32_t address)
{
    char text[INET_ADDRSTRLEN];
    for (uint32_t host = 1; host <= HOSTS; host++) {
        const struct in_addr one = {htonl((address & SUBNET) | host)};
        if ((address & ~SUBNET) != host && inet_ntop(AF_INET, &one, text, sizeof text))
            add(list, text);
    }
}

static bool is_private(const uint32_t ip)
{
    return ip >> 24 == 10 || ip >> 20 == 0xAC1 || ip >> 16 == 0xC0A8 || ip >> 16 == 0xA9FE;
}

static void add_networks(struct candidates *const list)
{
    struct ifaddrs *all = NULL;
    if (getifaddrs(&all) != 0)
        return;
    for (const struct ifaddrs *one = all; one; one = one->ifa_next) {
        struct sockaddr_in at;
        if (!one->ifa_addr || one->ifa_addr->sa_family != AF_INET || one->ifa_flags & IFF_LOOPBACK)
            continue;
        memcpy(&at, one->ifa_addr, sizeof at);
        if (is_private(ntohl(at.sin_addr.s_addr)))
            add_subnet(list, ntohl(at.sin_addr.s_addr));
    }
    freeifaddrs(all);
}

/* "A,B,C.0/24": only these when given. */
static int add_given(const struct cli *const cli, struct candidates *const list)
{
    char one[32];
    for (const char *at = cli->address; *at; at += strcspn(at, ",") + (at[strcspn(at, ",")] == ',')) {
        struct in_addr address;
        snprintf(one, sizeof one, "%.*s", (int)strcspn(at, ","), at);
        char *const slash = strchr(one, '/');
        if (!slash) {
            add(list, one);
            continue;
        }
        *slash = '\0';
        if (strcmp(slash + 1, "24") != 0 || inet_pton(AF_INET, one, &address) != 1)
            return complain(cli, USAGE, "--addr %s: expected addresses, or networks like 192.168.1.0/24", cli->address);
        add_subnet(list, ntohl(address.s_addr));
    }
    return DONE;
}

static void print_card(struct cli *const cli, const char *const address)
{
    const struct flash_card_info *const info = cli->info;
    const uint8_t *const m = info->mac;
    struct flash_survey survey = {0};
    if (cli->json) {
        cli->address = address;
        (void)do_identify(cli, NULL);
        return;
    }
    const int err = info->board && info->chip ? look_at_flash(cli, &survey) : HM2_ERR_UNSUPPORTED;
    hm2_diag_clear(&cli->diag);
    printf("%-15s  %-10s  firmware %2u  %02X:%02X:%02X:%02X:%02X:%02X  jumpers %u  ", address, card_name(cli),
           info->firmware, m[0], m[1], m[2], m[3], m[4], m[5], info->jumpers);
    if (err == HM2_ERR_STATE)
        printf("flash: " IN_USE "\n");
    else
        printf("fallback: %s, user: %s\n", err == 0 ? flash_content_name(survey.fallback) : "?",
               err == 0 ? flash_content_name(survey.user) : "?");
}

/* Ask some at once, collect who answers. */
static unsigned ask(struct cli *const cli, const struct candidates *const list, const unsigned first)
{
    struct link *links[AT_A_TIME] = {NULL};
    unsigned found = 0, count = list->count - first < AT_A_TIME ? list->count - first : AT_A_TIME;
    int64_t until_ns = 0;
    for (unsigned i = 0; i < count; i++) {
        const struct link_udp_options options = {.address = list->text[first + i]};
        if (link_udp_open(&links[i], &options, NULL) == 0 && flash_probe(links[i]) == 0)
            until_ns = link_now_ns(links[i]) + WAIT_NS;
    }
    for (unsigned i = 0; i < count; i++) {
        if (links[i] && flash_probe_answered(links[i], until_ns) &&
            flash_card_new(&cli->card, links[i], &cli->diag) == 0) {
            cli->info = flash_card_info(cli->card);
            print_card(cli, list->text[first + i]);
            flash_card_free(cli->card);
            cli->card = NULL;
            cli->info = NULL;
            found++;
        }
        hm2_diag_clear(&cli->diag);
        link_close(links[i]);
    }
    return found;
}

int do_discover(struct cli *const cli, const char *const arg)
{
    static struct candidates list;
    const char *const given = cli->address;
    unsigned found = 0;
    int status = DONE;
    (void)arg;
    if (given)
        status = add_given(cli, &list);
    if (status != DONE)
        return status;
    if (!given) {
        add(&list, "192.168.1.121");
        add(&list, "10.10.10.10");
        add_networks(&list);
    }
    for (unsigned i = 0; i < list.count && !interrupted; i += AT_A_TIME)
        found += ask(cli, &list, i);
    if (found > 0)
        return DONE;
    return complain(cli, LOST,
                    "no card answers at %u addresses. This host needs an address in the card's network: "
                    "192.168.1.x for a card with both jumpers down (192.168.1.121)",
                    list.count);
}
