/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "live.h"

#include <arpa/inet.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <netinet/if_ether.h>
#include <netpacket/packet.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "command.h"

struct answer {
    char *text;
    size_t cap, len;
};

static void __attribute__((format(printf, 2, 3))) say(struct answer *const answer, const char *const format, ...)
{
    va_list values;
    va_start(values, format);
    const int len = vsnprintf(answer->text + answer->len, answer->cap - answer->len, format, values);
    va_end(values);
    if (len > 0 && (size_t)len < answer->cap - answer->len)
        answer->len += (size_t)len;
    answer->text[answer->len] = '\0';
}

/* ---- ethtool -------------------------------------------------------------------------------------------------------
 */

struct device {
    int socket;
    struct ifreq request;
};

/* The request's first member is always its command. */
static bool device_ask(struct device *const device, void *const request)
{
    device->request.ifr_data = request;
    return ioctl(device->socket, SIOCETHTOOL, &device->request) == 0;
}

static void ask_value(struct device *const device, struct answer *const answer, const char *const name,
                      const __u32 command)
{
    struct ethtool_value value = {.cmd = command};
    if (device_ask(device, &value))
        say(answer, "%s %u\n", name, value.data);
}

static void ask_coalescing(struct device *const device, struct answer *const answer)
{
    struct ethtool_coalesce coalesce = {.cmd = ETHTOOL_GCOALESCE};
    if (device_ask(device, &coalesce))
        say(answer, "rx-usecs %u\ntx-usecs %u\nadaptive-rx %u\n", coalesce.rx_coalesce_usecs,
            coalesce.tx_coalesce_usecs, coalesce.use_adaptive_rx_coalesce);
}

static void ask_all(struct device *const device, struct answer *const answer)
{
    struct ethtool_drvinfo driver = {.cmd = ETHTOOL_GDRVINFO};
    struct ethtool_eee eee = {.cmd = ETHTOOL_GEEE};
    struct ethtool_channels channels = {.cmd = ETHTOOL_GCHANNELS};
    struct ethtool_value flags = {.cmd = ETHTOOL_GFLAGS};
    if (device_ask(device, &driver))
        say(answer, "driver %.31s\n", driver.driver);
    ask_coalescing(device, answer);
    if (device_ask(device, &eee))
        say(answer, "eee %u\n", eee.eee_enabled);
    ask_value(device, answer, "gro", ETHTOOL_GGRO);
    if (device_ask(device, &flags))
        say(answer, "lro %u\n", (flags.data & ETH_FLAG_LRO) != 0);
    if (device_ask(device, &channels))
        say(answer, "channels %u\n", channels.combined_count + channels.rx_count);
}

static bool ask_ethtool(const char *const interface, struct answer *const answer)
{
    struct device device = {.socket = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
    if (device.socket < 0)
        return false;
    snprintf(device.request.ifr_name, sizeof device.request.ifr_name, "%s", interface);
    ask_all(&device, answer);
    close(device.socket);
    return answer->len > 0;
}

/* ---- limits, firewall ----------------------------------------------------------------------------------------------
 */

static bool ask_limits(const char *const unused, struct answer *const answer)
{
    static const struct {
        const char *name;
        int which;
    } limits[] = {{"rtprio", RLIMIT_RTPRIO}, {"memlock", RLIMIT_MEMLOCK}};
    (void)unused;
    for (size_t i = 0; i < sizeof limits / sizeof limits[0]; i++) {
        struct rlimit limit;
        if (getrlimit((__rlimit_resource_t)limits[i].which, &limit) == 0)
            say(answer, "%s %lld\n", limits[i].name,
                limit.rlim_cur == RLIM_INFINITY ? -1LL : (long long)limit.rlim_cur);
    }
    if (geteuid() == 0)
        say(answer, "root 1\n");
    return answer->len > 0;
}

static bool ask_firewall(const char *const unused, struct answer *const answer)
{
    (void)unused;
    return command_run("PATH=$PATH:/usr/sbin nft list ruleset", answer->text, answer->cap) == 0;
}

/* ---- traffic -------------------------------------------------------------------------------------------------------
 */

#define LISTEN_S 1

enum { COLUMN_RECEIVED = 1, COLUMN_SENT = 9 }; /* of /proc/net/dev, behind the name */

static unsigned long long column(const char *text, const unsigned number)
{
    unsigned long long value = 0;
    for (unsigned i = 0; i <= number; i++) {
        char *end;
        value = strtoull(text, &end, 10);
        text = end;
    }
    return value;
}

/* Packets received and sent so far. */
static bool count_packets(const char *const interface, unsigned long long *const packets)
{
    char line[256];
    const size_t len = strlen(interface);
    bool found = false;
    FILE *const file = fopen("/proc/net/dev", "r");
    while (file && !found && fgets(line, sizeof line, file)) {
        const char *const name = line + strspn(line, " ");
        found = strncmp(name, interface, len) == 0 && name[len] == ':';
        if (found)
            *packets = column(name + len + 1, COLUMN_RECEIVED) + column(name + len + 1, COLUMN_SENT);
    }
    if (file)
        fclose(file);
    return found;
}

/* While nothing is sent from here. */
static bool ask_traffic(const char *const interface, struct answer *const answer)
{
    unsigned long long before, after;
    if (!count_packets(interface, &before))
        return false;
    (void)sleep(LISTEN_S);
    if (!count_packets(interface, &after) || after < before)
        return false;
    say(answer, "packets %llu\n", (after - before) / LISTEN_S);
    return true;
}

/* ---- ARP -----------------------------------------------------------------------------------------------------------
 */

#define ANSWERS_MS  300 /* all devices of a local network answer within a few */
#define MAX_ANSWERS 64u

/* A probe (RFC 5227): it asks without an address of its own, so nobody learns anything from it. */
static bool send_probe(const int fd, const int interface, const struct in_addr address, const uint8_t own[ETH_ALEN])
{
    struct sockaddr_ll to = {.sll_family = AF_PACKET,
                             .sll_protocol = htons(ETH_P_ARP),
                             .sll_ifindex = interface,
                             .sll_halen = ETH_ALEN,
                             .sll_addr = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}};
    struct ether_arp probe = {.ea_hdr = {.ar_hrd = htons(ARPHRD_ETHER),
                                         .ar_pro = htons(ETH_P_IP),
                                         .ar_hln = ETH_ALEN,
                                         .ar_pln = sizeof address,
                                         .ar_op = htons(ARPOP_REQUEST)}};
    memcpy(probe.arp_sha, own, ETH_ALEN);
    memcpy(probe.arp_tpa, &address, sizeof address);
    return sendto(fd, &probe, sizeof probe, 0, (const struct sockaddr *)&to, sizeof to) == (ssize_t)sizeof probe;
}

static void take_answers(const int fd, const struct in_addr address, struct answer *const answer)
{
    struct pollfd ready = {.fd = fd, .events = POLLIN};
    for (unsigned i = 0; i < MAX_ANSWERS && poll(&ready, 1, ANSWERS_MS) == 1; i++) {
        struct ether_arp arp;
        if (recv(fd, &arp, sizeof arp, MSG_DONTWAIT) != (ssize_t)sizeof arp || arp.ea_hdr.ar_op != htons(ARPOP_REPLY) ||
            memcmp(arp.arp_spa, &address, sizeof address) != 0)
            continue;
        const uint8_t *const mac = arp.arp_sha;
        say(answer, "reply %02x:%02x:%02x:%02x:%02x:%02x\n", mac[0], mac[1], mac[2], mac[3], mac[4], mac[5]);
    }
}

/* INTERFACE/ADDRESS. Needs the right to use packet sockets. */
static bool ask_arp(const char *const rest, struct answer *const answer)
{
    struct ifreq request = {.ifr_ifindex = 0};
    struct in_addr address;
    const size_t len = strcspn(rest, "/");
    if (len >= sizeof request.ifr_name || rest[len] != '/' || inet_pton(AF_INET, rest + len + 1, &address) != 1)
        return false;
    memcpy(request.ifr_name, rest, len);
    const int fd = socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC, htons(ETH_P_ARP));
    bool asked = false;
    if (fd >= 0 && ioctl(fd, SIOCGIFHWADDR, &request) == 0) {
        uint8_t own[ETH_ALEN];
        memcpy(own, request.ifr_hwaddr.sa_data, sizeof own);
        asked = ioctl(fd, SIOCGIFINDEX, &request) == 0 && send_probe(fd, request.ifr_ifindex, address, own);
    }
    if (asked) {
        say(answer, "asked 1\n");
        take_answers(fd, address, answer);
    }
    if (fd >= 0)
        close(fd);
    return asked;
}

bool live_ask(const char *const question, char *const text, const size_t cap)
{
    static const struct {
        const char *name;
        bool (*ask)(const char *rest, struct answer *answer);
    } questions[] = {{"ethtool/", ask_ethtool},
                     {"limits", ask_limits},
                     {"firewall", ask_firewall},
                     {"traffic/", ask_traffic},
                     {"arp/", ask_arp}};
    struct answer answer = {.text = text, .cap = cap};
    for (size_t i = 0; i < sizeof questions / sizeof questions[0]; i++) {
        const size_t len = strlen(questions[i].name);
        if (strncmp(question, questions[i].name, len) == 0)
            return questions[i].ask(question + len, &answer);
    }
    return false;
}
