/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "isolation.h"

#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <linux/capability.h>
#include <net/if.h>
#include <netinet/in.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#ifdef HM2_HAVE_NFTABLES
#include <nftables/libnftables.h>
#endif

#include <hm2/lbp16.h>

struct way {
    struct sockaddr_in card;
    char interface[IFNAMSIZ];
};

/* ---- the way to a card --------------------------------------------------------------------------------------------
 */

static bool parse_address(const char *const text, struct sockaddr_in *const card)
{
    char address[INET_ADDRSTRLEN];
    const size_t len = strcspn(text, ":");
    if (len >= sizeof address)
        return false;
    memcpy(address, text, len);
    address[len] = '\0';
    const unsigned long port = text[len] ? strtoul(text + len + 1, NULL, 10) : LBP16_UDP_PORT;
    *card = (struct sockaddr_in){.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    return inet_pton(AF_INET, address, &card->sin_addr) == 1;
}

/* Address from which the kernel sends to a card. */
static bool own_address(const struct sockaddr_in *const card, struct in_addr *const own)
{
    struct sockaddr_in local = {0};
    socklen_t size = sizeof local;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const bool found = fd >= 0 && connect(fd, (const struct sockaddr *)card, sizeof *card) == 0 &&
                       getsockname(fd, (struct sockaddr *)&local, &size) == 0;
    if (fd >= 0)
        (void)close(fd);
    *own = local.sin_addr;
    return found;
}

static bool is_ipv4(const struct ifaddrs *const entry)
{
    return entry->ifa_addr && entry->ifa_addr->sa_family == AF_INET;
}

static bool has_address(const struct ifaddrs *const entry, const struct in_addr address)
{
    struct sockaddr_in own;
    if (!is_ipv4(entry))
        return false;
    memcpy(&own, entry->ifa_addr, sizeof own);
    return own.sin_addr.s_addr == address.s_addr;
}

/* False for the loopback interface, and when none is found. */
static bool find_way(const struct ifaddrs *const all, const char *const address, struct way *const way)
{
    struct in_addr own;
    if (!parse_address(address, &way->card) || !own_address(&way->card, &own))
        return false;
    for (const struct ifaddrs *entry = all; entry; entry = entry->ifa_next) {
        if (!has_address(entry, own))
            continue;
        (void)snprintf(way->interface, sizeof way->interface, "%s", entry->ifa_name);
        return !(entry->ifa_flags & IFF_LOOPBACK);
    }
    return false;
}

/* ---- hardware addresses -------------------------------------------------------------------------------------------
 */

static int arp(const unsigned long request, struct arpreq *const entry)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return errno;
    const int result = ioctl(fd, request, entry) == 0 ? 0 : errno;
    (void)close(fd);
    return result;
}

/* The card has just answered, so that the kernel knows its hardware address; it shall not ask for it again. */
static void pin(struct isolation *const isolation, const struct way *const way, struct hm2_diag *const diag)
{
    char address[INET_ADDRSTRLEN];
    struct arpreq entry = {0};
    memcpy(&entry.arp_pa, &way->card, sizeof way->card);
    memcpy(entry.arp_dev, way->interface, sizeof way->interface);
    int error = arp(SIOCGARP, &entry);
    if (error == 0 && entry.arp_flags & ATF_PERM)
        return; /* by somebody else, whose affair it remains */
    entry.arp_flags = ATF_PERM | ATF_COM;
    if (error == 0)
        error = arp(SIOCSARP, &entry);
    if (error == 0)
        isolation->pinned[isolation->pinned_count++] = entry;
    else
        hm2_diag_warn(
            diag,
            "the hardware address of card %s is not pinned on interface %s: %s; now and then a cycle will wait "
            "for ARP. Connect the card to an interface of its own, without a router between",
            inet_ntop(AF_INET, &way->card.sin_addr, address, sizeof address), way->interface, strerror(error));
}

/* ---- interfaces ---------------------------------------------------------------------------------------------------
 */

static unsigned ipv4_addresses(const struct ifaddrs *const all, const char *const interface)
{
    unsigned count = 0;
    for (const struct ifaddrs *entry = all; entry; entry = entry->ifa_next)
        count += is_ipv4(entry) && strcmp(entry->ifa_name, interface) == 0;
    return count;
}

/* A line of the kernel's table: interface, destination, and more, with tabs between. */
static bool has_default_route(const char *const interface)
{
    char line[256];
    bool found = false;
    const size_t len = strlen(interface);
    FILE *const table = fopen("/proc/net/route", "re");
    while (table && !found && fgets(line, sizeof line, table))
        found = strncmp(line, interface, len) == 0 && strncmp(line + len, "\t00000000\t", 10) == 0;
    if (table)
        (void)fclose(table);
    return found;
}

static bool may_close(const struct ifaddrs *const all, const char *const interface, const enum isolation_mode mode,
                      struct hm2_diag *const diag)
{
    if (mode != ISOLATION_AUTO)
        return mode == ISOLATION_FORCED;
    const bool routes = has_default_route(interface);
    if (!routes && ipv4_addresses(all, interface) == 1)
        return true;
    hm2_diag_warn(diag,
                  "interface %s %s, so other programs are not kept off it and may delay a cycle. Give the cards an "
                  "interface of their own; firewall=nft closes this one all the same, firewall=none leaves it open "
                  "without this message",
                  interface, routes ? "has the default route" : "has further addresses");
    return false;
}

/* ---- rules --------------------------------------------------------------------------------------------------------
 */

#define RULES_SIZE 8192u

struct rules {
    char text[RULES_SIZE];
    size_t used;
    bool any;
};

static void add(struct rules *const rules, const char *const format, ...) __attribute__((format(printf, 2, 3)));
static void add(struct rules *const rules, const char *const format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const size_t room = sizeof rules->text - rules->used;
    const int len = vsnprintf(rules->text + rules->used, room, format, arguments);
    va_end(arguments);
    rules->used += len < 0 || (size_t)len >= room ? room - 1 : (size_t)len;
}

static void close_interface(struct rules *const rules, const struct way *const ways, const unsigned count,
                            const char *const interface)
{
    char address[INET_ADDRSTRLEN];
    for (unsigned i = 0; i < count; i++)
        if (strcmp(ways[i].interface, interface) == 0)
            add(rules, "oifname \"%s\" ip daddr %s udp dport %u accept\n", interface,
                inet_ntop(AF_INET, &ways[i].card.sin_addr, address, sizeof address), ntohs(ways[i].card.sin_port));
    add(rules, "oifname \"%s\" meta l4proto icmp drop\noifname \"%s\" reject\n", interface, interface);
    rules->any = true;
}

static bool seen_before(const struct way *const ways, const unsigned i)
{
    for (unsigned k = 0; k < i; k++)
        if (strcmp(ways[k].interface, ways[i].interface) == 0)
            return true;
    return false;
}

/* The table belongs to the socket that made it. */
static void write_rules(struct rules *const rules, const struct ifaddrs *const all, const struct way *const ways,
                        const unsigned count, const enum isolation_mode mode, struct hm2_diag *const diag)
{
    add(rules, "table inet hm2_lbp16_%d {\nflags owner;\nchain output {\n", (int)getpid());
    add(rules, "type filter hook output priority 0; policy accept;\n");
    for (unsigned i = 0; i < count; i++)
        if (!seen_before(ways, i) && may_close(all, ways[i].interface, mode, diag))
            close_interface(rules, ways, count, ways[i].interface);
    add(rules, "}\n}\n");
}

#ifdef HM2_HAVE_NFTABLES

static void install(struct isolation *const isolation, const struct rules *const rules, struct hm2_diag *const diag)
{
    struct nft_ctx *const context = nft_ctx_new(NFT_CTX_DEFAULT);
    if (context && nft_ctx_buffer_error(context) == 0 && nft_ctx_buffer_output(context) == 0 &&
        nft_run_cmd_from_buffer(context, rules->text) == 0) {
        isolation->rules = context;
        return;
    }
    const char *const reason = context ? nft_ctx_get_error_buffer(context) : NULL;
    hm2_diag_warn(
        diag,
        "other programs are not kept off the cards' interface and may delay a cycle: nftables says: %.*s. Make "
        "rules of your own, or give firewall=none",
        reason ? (int)strcspn(reason, "\n") : 9, reason ? reason : "no memory");
    if (context)
        nft_ctx_free(context);
}

static void remove_rules(struct isolation *const isolation)
{
    if (isolation->rules)
        nft_ctx_free(isolation->rules);
    isolation->rules = NULL;
}

#else

static void install(struct isolation *const isolation, const struct rules *const rules, struct hm2_diag *const diag)
{
    (void)isolation;
    (void)rules;
    hm2_diag_warn(diag,
                  "other programs are not kept off the cards' interface and may delay a cycle: this component was "
                  "built without libnftables. Make rules of your own, or give firewall=none");
}

static void remove_rules(struct isolation *const isolation)
{
    (void)isolation;
}

#endif

/* ---- all of it ----------------------------------------------------------------------------------------------------
 */

static bool may_change_networks(void)
{
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3] = {{0}};
    return syscall(SYS_capget, &header, data) == 0 && data[0].effective & (1u << CAP_NET_ADMIN);
}

void isolation_begin(struct isolation *const isolation, const char *const *const addresses, const unsigned count,
                     const enum isolation_mode mode, struct hm2_diag *const diag)
{
    struct way ways[ISOLATION_CARDS];
    unsigned found = 0;
    struct ifaddrs *all = NULL;
    *isolation = (struct isolation){0};
    if (getifaddrs(&all) != 0)
        return;
    for (unsigned i = 0; i < count && i < ISOLATION_CARDS; i++)
        found += find_way(all, addresses[i], &ways[found]);
    if (found > 0 && !may_change_networks()) {
        if (mode != ISOLATION_NONE)
            hm2_diag_warn(diag,
                          "without CAP_NET_ADMIN neither hardware addresses are pinned nor other programs kept off "
                          "interface %s; either may delay a cycle. Run with it, or give firewall=none",
                          ways[0].interface);
    } else if (found > 0) {
        struct rules rules = {.used = 0};
        for (unsigned i = 0; i < found; i++)
            pin(isolation, &ways[i], diag);
        write_rules(&rules, all, ways, found, mode, diag);
        if (rules.any)
            install(isolation, &rules, diag);
    }
    freeifaddrs(all);
}

void isolation_end(struct isolation *const isolation)
{
    remove_rules(isolation);
    while (isolation->pinned_count > 0)
        (void)arp(SIOCDARP, &isolation->pinned[--isolation->pinned_count]);
}
