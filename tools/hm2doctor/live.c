/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "live.h"

#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <stdarg.h>
#include <stdio.h>
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

bool live_ask(const char *const question, char *const text, const size_t cap)
{
    static const struct {
        const char *name;
        bool (*ask)(const char *rest, struct answer *answer);
    } questions[] = {{"ethtool/", ask_ethtool}, {"limits", ask_limits}, {"firewall", ask_firewall}};
    struct answer answer = {.text = text, .cap = cap};
    for (size_t i = 0; i < sizeof questions / sizeof questions[0]; i++) {
        const size_t len = strlen(questions[i].name);
        if (strncmp(question, questions[i].name, len) == 0)
            return questions[i].ask(question + len, &answer);
    }
    return false;
}
