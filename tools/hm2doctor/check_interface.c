/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The network interface: its driver and what it does to save interrupts and power. */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#include "doctor.h"

#define MAX_IRQ     4096
#define LOOPBACK_IF "lo"

static void check_link(struct patient *const p)
{
    char state[16] = "";
    long long speed = 0;
    (void)state_text(p->state, state, sizeof state, "sys/class/net/%s/operstate", p->interface);
    if (strcmp(state, "down") == 0 || strcmp(state, "lowerlayerdown") == 0) {
        remedy(find(p->findings, "link", GRADE_FAULT, "%s is down", p->interface), true, "ip link set %s up",
               p->interface);
        return;
    }
    if (!state_number(p->state, &speed, "sys/class/net/%s/speed", p->interface) || speed <= 0)
        return;
    if (speed >= 100)
        find(p->findings, "link", GRADE_OK, "%s has a link of %lld Mbit/s", p->interface, speed);
    else
        remedy(find(p->findings, "link", GRADE_FAULT, "%s has a link of %lld Mbit/s only; the cards speak 100",
                    p->interface, speed),
               false, "replace the cable; is there a hub between?");
}

static void check_kind(struct patient *const p)
{
    char text[16];
    if (state_text(p->state, text, sizeof text, "sys/class/net/%s/wireless/status", p->interface))
        remedy(find(p->findings, "kind", GRADE_FAULT, "%s is wireless: replies are late by milliseconds", p->interface),
               false, "connect the card by a cable to a network port of its own");
    else if (state_text(p->state, text, sizeof text, "sys/class/net/%s/bridge/bridge_id", p->interface))
        remedy(find(p->findings, "kind", GRADE_ADVICE,
                    "%s is a bridge: each packet takes a way more through the kernel", p->interface),
               false, "connect the card to a network port that belongs to no bridge");
}

static void check_driver(struct patient *const p, const char *const ethtool)
{
    static const char at_usb[] = "it is at USB, which adds a millisecond at times";
    static const char no_usb[] = "use a network port of the main board or a PCI card";
    /* What users report of them, and LinuxCNC's forum with them. */
    static const struct {
        const char *driver, *why, *what;
    } known[] = {
        {"r8169", "it loses the cycle now and then with power saving of the bus",
         "apt-get install r8168-dkms (then restart)"},
        {"ax88179_178a", at_usb, no_usb},
        {"r8152", at_usb, no_usb},
        {"asix", at_usb, no_usb},
        {"cdc_ether", at_usb, no_usb},
    };
    char driver[32];
    if (!text_named_word(ethtool, "driver", driver, sizeof driver))
        return;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (strcmp(driver, known[i].driver) == 0) {
            remedy(find(p->findings, "driver", GRADE_ADVICE, "%s has the driver %s: %s", p->interface, driver,
                        known[i].why),
                   false, "%s", known[i].what);
            return;
        }
    }
    find(p->findings, "driver", GRADE_OK, "%s has the driver %s", p->interface, driver);
}

static void check_coalescing(struct patient *const p, const char *const ethtool)
{
    long long rx_us = 0, tx_us = 0, adaptive = 0;
    if (!text_named_number(ethtool, "rx-usecs", &rx_us))
        return;
    (void)text_named_number(ethtool, "tx-usecs", &tx_us);
    (void)text_named_number(ethtool, "adaptive-rx", &adaptive);
    /* 1 means an own, short mode to Intel's drivers, not a microsecond. */
    if (rx_us == 0 && !adaptive)
        find(p->findings, "coalescing", GRADE_OK, "%s reports each packet at once", p->interface);
    else
        remedy(find(p->findings, "coalescing", GRADE_ADVICE, "%s holds interrupts back to save some (rx-usecs %lld%s)",
                    p->interface, rx_us, adaptive ? ", adaptive" : ""),
               true, "ethtool -C %s rx-usecs 0 tx-usecs 0%s", p->interface, adaptive ? " adaptive-rx off" : "");
}

static void check_saving(struct patient *const p, const char *const ethtool)
{
    static const struct {
        const char *name, *check, *what, *command, *rest;
    } savings[] = {
        {"eee", "eee", "lets the line sleep between packets (energy-efficient Ethernet)", "ethtool --set-eee",
         "eee off"},
        {"gro", "offloads", "collects packets before it hands them on (GRO)", "ethtool -K", "gro off"},
        {"lro", "offloads", "collects packets before it hands them on (LRO)", "ethtool -K", "lro off"},
    };
    for (size_t i = 0; i < sizeof savings / sizeof savings[0]; i++) {
        long long on = 0;
        if (!text_named_number(ethtool, savings[i].name, &on))
            continue;
        if (on)
            remedy(find(p->findings, savings[i].check, GRADE_ADVICE, "%s %s", p->interface, savings[i].what), true,
                   "%s %s %s", savings[i].command, p->interface, savings[i].rest);
        else
            find(p->findings, savings[i].check, GRADE_OK, "%s: %s is off", p->interface, savings[i].name);
    }
}

static void check_queues(struct patient *const p, const char *const ethtool)
{
    long long channels = 0;
    if (text_named_number(ethtool, "channels", &channels) && channels > 1)
        remedy(find(p->findings, "queues", GRADE_ADVICE, "%s spreads its packets over %lld queues and their processors",
                    p->interface, channels),
               true, "ethtool -L %s combined 1", p->interface);
}

/* Lines of /proc/interrupts: "NUMBER: counts... names", where a name is the interface or begins with it and "-". */
static bool line_is_of(const char *const line, const size_t len, const char *const interface)
{
    const size_t name = strlen(interface);
    for (size_t i = 1; i + name <= len; i++) {
        const char before = line[i - 1], after = i + name < len ? line[i + name] : ' ';
        if (strncmp(line + i, interface, name) == 0 && (isspace((unsigned char)before) || before == ',') &&
            (isspace((unsigned char)after) || after == '-' || after == ','))
            return true;
    }
    return false;
}

static void check_interrupt(struct patient *const p, const long irq, const char *const isolated)
{
    char affinity[128];
    if (!state_text(p->state, affinity, sizeof affinity, "proc/irq/%ld/smp_affinity_list", irq))
        return;
    if (isolated[0] == '\0' || strcmp(affinity, isolated) == 0)
        find(p->findings, "interrupt", GRADE_OK, "interrupt %ld of %s goes to processors %s", irq, p->interface,
             affinity);
    else
        remedy(find(p->findings, "interrupt", GRADE_ADVICE,
                    "interrupt %ld of %s goes to processors %s, the cycle runs on %s", irq, p->interface, affinity,
                    isolated),
               true, "echo %s > /proc/irq/%ld/smp_affinity_list", isolated, irq);
}

static void check_interrupts(struct patient *const p)
{
    static char text[STATE_TEXT_BYTES];
    char isolated[128] = "";
    if (!state_text(p->state, text, sizeof text, "proc/interrupts"))
        return;
    (void)state_text(p->state, isolated, sizeof isolated, "sys/devices/system/cpu/isolated");
    if (strspn(isolated, "0123456789,-") != strlen(isolated))
        isolated[0] = '\0';
    for (const char *line = text; line; line = strchr(line, '\n')) {
        line += *line == '\n';
        char *end;
        const long irq = strtol(line, &end, 10);
        if (*end == ':' && irq > 0 && irq < MAX_IRQ && line_is_of(line, strcspn(line, "\n"), p->interface))
            check_interrupt(p, irq, isolated);
    }
}

void check_interface(struct patient *const p)
{
    char ethtool[512] = "";
    if (p->interface[0] == '\0' || strcmp(p->interface, LOOPBACK_IF) == 0)
        return;
    check_link(p);
    check_kind(p);
    if (!state_text(p->state, ethtool, sizeof ethtool, "doctor/ethtool/%s", p->interface))
        find(p->findings, "driver", GRADE_UNKNOWN, "%s tells nothing about itself", p->interface);
    check_driver(p, ethtool);
    check_coalescing(p, ethtool);
    check_saving(p, ethtool);
    check_queues(p, ethtool);
    check_interrupts(p);
}
