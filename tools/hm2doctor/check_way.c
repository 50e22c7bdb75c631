/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The way to the card: route, neighbours, filters. */
#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>

#include "doctor.h"

#define LOOPBACK_NET  127u
#define QUIET_PACKETS 20 /* a second: what computers say of themselves, to a line on which nobody answers */

/* A line of /proc/net/route; addresses and mask are in network order, printed as a number of this machine. */
struct route {
    char interface[INTERFACE_BYTES];
    uint32_t to, gateway, mask;
};

static bool hexadecimal(const char *const word, uint32_t *const value)
{
    char *end;
    const unsigned long number = strtoul(word, &end, 16);
    *value = ntohl((uint32_t)number);
    return end != word && *end == '\0' && number <= UINT32_MAX;
}

static bool parse_route(const char *const line, struct route *const route)
{
    char to[9], gateway[9], mask[9];
    return sscanf(line, "%15s %8s %8s %*s %*s %*s %*s %8s", route->interface, to, gateway, mask) == 4 &&
           hexadecimal(to, &route->to) && hexadecimal(gateway, &route->gateway) && hexadecimal(mask, &route->mask);
}

static const char *next_line(const char *const at)
{
    const char *const end = strchr(at, '\n');
    return end ? end + 1 : NULL;
}

void look_at_routes(struct patient *const p)
{
    if (!state_text(p->state, p->routes, sizeof p->routes, "proc/net/route"))
        p->routes[0] = '\0';
}

/* The route with the longest mask that the card's address matches. */
static bool best_route(const char *const text, const uint32_t card, struct route *const best)
{
    bool found = false;
    for (const char *line = next_line(text); line; line = next_line(line)) {
        struct route route;
        if (parse_route(line, &route) && (card & route.mask) == route.to && (!found || route.mask > best->mask)) {
            *best = route;
            found = true;
        }
    }
    return found;
}

bool find_interface(struct patient *const p)
{
    struct route route;
    if (p->card >> 24 == LOOPBACK_NET) {
        snprintf(p->interface, sizeof p->interface, "lo");
        return true;
    }
    if (!best_route(p->routes, p->card, &route))
        return false;
    memcpy(p->interface, route.interface, sizeof p->interface);
    return true;
}

static void card_text(const uint32_t card, char text[INET_ADDRSTRLEN])
{
    const struct in_addr address = {.s_addr = htonl(card)};
    inet_ntop(AF_INET, &address, text, INET_ADDRSTRLEN);
}

static void check_route(struct patient *const p)
{
    char card[INET_ADDRSTRLEN];
    struct route route = {.mask = 0};
    card_text(p->card, card);
    if (!best_route(p->routes, p->card, &route)) {
        remedy(find(p->findings, "route", GRADE_FAULT, "there is no way to %s", card), false,
               "ip addr add %u.%u.%u.1/24 dev INTERFACE (the one with the card's cable)", p->card >> 24,
               p->card >> 16 & 255, p->card >> 8 & 255);
        return;
    }
    if (route.gateway != 0)
        remedy(find(p->findings, "route", GRADE_FAULT,
                    "%s is reached through a gateway by %s; the card answers to its own "
                    "network only",
                    card, route.interface),
               false, "ip addr add %u.%u.%u.1/24 dev INTERFACE (the one with the card's cable)", p->card >> 24,
               p->card >> 16 & 255, p->card >> 8 & 255);
    else
        find(p->findings, "route", GRADE_OK, "%s is reached directly by %s", card, route.interface);
}

/* A network port that leads elsewhere, too, has other packets in the way. */
static void check_sharing(struct patient *const p)
{
    if (p->routes[0] == '\0')
        return;
    for (const char *line = next_line(p->routes); line; line = next_line(line)) {
        struct route route;
        if (parse_route(line, &route) && route.mask == 0 && strcmp(route.interface, p->interface) == 0) {
            remedy(find(p->findings, "sharing", GRADE_ADVICE, "%s also leads to everything else (default route)",
                        p->interface),
                   false, "give the card a network port of its own");
            return;
        }
    }
    find(p->findings, "sharing", GRADE_OK, "%s leads to nothing else by default", p->interface);
}

static void check_traffic(struct patient *const p)
{
    char text[STATE_TEXT_BYTES];
    long long packets;
    if (!state_text(p->state, text, sizeof text, "doctor/traffic/%s", p->interface) ||
        !text_named_number(text, "packets", &packets)) {
        find(p->findings, "traffic", GRADE_UNKNOWN, "whether other packets pass %s is not known", p->interface);
        return;
    }
    if (packets <= QUIET_PACKETS) {
        find(p->findings, "traffic", GRADE_OK, "%s is quiet: %lld packets in a second", p->interface, packets);
        return;
    }
    remedy(find(p->findings, "traffic", GRADE_ADVICE,
                "%lld packets pass %s in a second while nothing is asked here; each of the longest holds a reply up by "
                "123 us at 100 Mbit/s",
                packets, p->interface),
           false, "tcpdump -n -c 20 -i %s (stop the program that sends them; is one using the card?)", p->interface);
}

static void check_neighbour(struct patient *const p)
{
    static char text[STATE_TEXT_BYTES];
    char card[INET_ADDRSTRLEN], flags[8], mac[20];
    card_text(p->card, card);
    if (!state_text(p->state, text, sizeof text, "proc/net/arp"))
        return;
    for (const char *line = next_line(text); line; line = next_line(line)) {
        char address[INET_ADDRSTRLEN];
        if (sscanf(line, "%15s %*s %7s %19s", address, flags, mac) != 3 || strcmp(address, card) != 0)
            continue;
        const unsigned long state = strtoul(flags, NULL, 16);
        if (state == 0)
            remedy(find(p->findings, "arp", GRADE_FAULT, "%s does not answer to ARP", card), false,
                   "check cable, power and the address jumpers of the card");
        else if (strncmp(mac, "00:60:1b:", 9) != 0)
            remedy(find(p->findings, "arp", GRADE_ADVICE,
                        "%s is %s, which is no MAC address of Mesa: another device may "
                        "have the card's address",
                        card, mac),
                   false, "arping -D -I %s %s (two answers are two devices)", p->interface, card);
        else
            find(p->findings, "arp", GRADE_OK, "%s is %s%s", card, mac, state & 4 ? ", pinned" : "");
        return;
    }
}

/* This computer itself, as the tree of /proc/net/fib_trie has its own addresses: "|-- ADDRESS", then "/32 host LOCAL".
 */
static bool is_own_address(struct patient *const p, const char *const card)
{
    static char text[STATE_TEXT_BYTES];
    if (!state_text(p->state, text, sizeof text, "proc/net/fib_trie"))
        return false;
    for (const char *line = text; line; line = next_line(line)) {
        const char *const below = next_line(line);
        char address[INET_ADDRSTRLEN];
        if (below && sscanf(line, " |-- %15s", address) == 1 && strcmp(address, card) == 0 &&
            strstr(below, "/32 host LOCAL") && strstr(below, "/32 host LOCAL") < below + strcspn(below, "\n"))
            return true;
    }
    return false;
}

#define DEVICES    4u
#define MAC_LENGTH 18u /* with the terminating zero */

struct devices {
    char mac[DEVICES][MAC_LENGTH];
    unsigned count;
};

static void note_device(struct devices *const devices, const char *const mac)
{
    for (unsigned i = 0; i < devices->count; i++)
        if (strcmp(devices->mac[i], mac) == 0)
            return;
    if (devices->count < DEVICES)
        snprintf(devices->mac[devices->count++], MAC_LENGTH, "%s", mac);
}

/* Those that the table has at any port, and those that answered just now. */
static bool look_for_devices(struct patient *const p, const char *const card, struct devices *const devices)
{
    static char text[STATE_TEXT_BYTES];
    char address[INET_ADDRSTRLEN], flags[8], mac[MAC_LENGTH];
    if (state_text(p->state, text, sizeof text, "proc/net/arp"))
        for (const char *line = next_line(text); line; line = next_line(line))
            if (sscanf(line, "%15s %*s %7s %17s", address, flags, mac) == 3 && strcmp(address, card) == 0 &&
                strtoul(flags, NULL, 16) != 0)
                note_device(devices, mac);
    if (!state_text(p->state, text, sizeof text, "doctor/arp/%s/%s", p->interface, card))
        return false;
    for (const char *line = text; line; line = next_line(line))
        if (sscanf(line, "reply %17s", mac) == 1)
            note_device(devices, mac);
    return true;
}

static void check_conflict(struct patient *const p)
{
    struct devices devices = {.count = 0};
    char card[INET_ADDRSTRLEN];
    card_text(p->card, card);
    if (is_own_address(p, card)) {
        remedy(find(p->findings, "conflict", GRADE_FAULT, "%s is an address of this computer, too", card), false,
               "ip addr del %s dev INTERFACE (ip addr shows which), or give the card another address", card);
        return;
    }
    const bool asked = look_for_devices(p, card, &devices);
    if (devices.count > 1)
        remedy(find(p->findings, "conflict", GRADE_FAULT, "%u devices have the address %s, among them %s and %s",
                    devices.count, card, devices.mac[0], devices.mac[1]),
               false, "give each card an address of its own (jumpers, or hm2flash --set ip=...)");
    else if (asked && devices.count == 0)
        find(p->findings, "conflict", GRADE_UNKNOWN, "no device answers for the address %s", card);
    else if (!asked)
        find(p->findings, "conflict", GRADE_UNKNOWN, "whether several devices have the address is shown to root only");
    else
        find(p->findings, "conflict", GRADE_OK, "one device has the address %s", card);
}

static void check_reverse_path(struct patient *const p)
{
    long long all = 0, own = 0;
    if (!state_number(p->state, &own, "proc/sys/net/ipv4/conf/%s/rp_filter", p->interface))
        return;
    (void)state_number(p->state, &all, "proc/sys/net/ipv4/conf/all/rp_filter");
    if (all == 1 || own == 1)
        remedy(find(p->findings, "rp_filter", GRADE_ADVICE,
                    "replies that come by another port than the route says are "
                    "dropped without a word (rp_filter 1)"),
               true, "sysctl -w net.ipv4.conf.all.rp_filter=2 net.ipv4.conf.%s.rp_filter=2", p->interface);
    else
        find(p->findings, "rp_filter", GRADE_OK, "replies are not filtered by their way");
}

/* A base chain of the way in or out that drops what no rule lets through. */
static void check_firewall(struct patient *const p)
{
    static char text[STATE_TEXT_BYTES];
    if (!state_text(p->state, text, sizeof text, "doctor/firewall")) {
        find(p->findings, "firewall", GRADE_UNKNOWN, "the firewall's rules are shown to root only");
        return;
    }
    for (const char *line = text; line; line = next_line(line)) {
        char copy[160];
        const size_t len = strcspn(line, "\n");
        snprintf(copy, sizeof copy, "%.*s", len < sizeof copy ? (int)len : (int)sizeof copy - 1, line);
        if ((strstr(copy, "hook input") || strstr(copy, "hook output")) && strstr(copy, "policy drop")) {
            remedy(find(p->findings, "firewall", GRADE_ADVICE, "the firewall drops what no rule lets through (%s)",
                        strstr(copy, "hook input") ? "input" : "output"),
                   false, "let UDP port 27181 of the card through");
            return;
        }
    }
    find(p->findings, "firewall", GRADE_OK, "the firewall lets packets through unless a rule says otherwise");
}

void check_way(struct patient *const p)
{
    if (p->card >> 24 != LOOPBACK_NET)
        check_route(p);
    if (p->interface[0] && strcmp(p->interface, "lo") != 0) {
        check_sharing(p);
        check_traffic(p);
        check_neighbour(p);
        check_conflict(p);
        check_reverse_path(p);
    }
    check_firewall(p);
}
