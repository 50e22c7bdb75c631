/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The kernel, the processors and the limits. */
#include <stdlib.h>
#include <string.h>

#include "doctor.h"

#define MAX_CPUS        1024u
#define MAX_IDLE_STATES 16u
#define SLOW_WAKE_US    20 /* an idle state that takes longer to leave costs a good part of a round trip */
#define RT_PRIORITY     50
#define RT_MEMORY_BYTES (64LL << 20)

static void check_kernel(struct patient *const p)
{
    char release[128] = "unknown";
    long long realtime = 0;
    (void)state_text(p->state, release, sizeof release, "proc/sys/kernel/osrelease");
    if (state_number(p->state, &realtime, "sys/kernel/realtime") && realtime == 1) {
        find(p->findings, "kernel", GRADE_OK, "kernel %s is a realtime kernel (PREEMPT_RT)", release);
        return;
    }
    remedy(find(p->findings, "kernel", GRADE_FAULT,
                "kernel %s is no realtime kernel (PREEMPT_RT): a thread can be held up for milliseconds", release),
           false, "apt-get install linux-image-rt-amd64 (then restart into it)");
}

static void check_throttling(struct patient *const p)
{
    long long runtime_us = 0;
    if (!state_number(p->state, &runtime_us, "proc/sys/kernel/sched_rt_runtime_us"))
        return;
    if (runtime_us == -1 || runtime_us >= 950000)
        find(p->findings, "throttling", GRADE_OK, "realtime threads may use %s of a second",
             runtime_us == -1 ? "all" : "95 % and more");
    else
        remedy(find(p->findings, "throttling", GRADE_ADVICE,
                    "realtime threads are stopped after %lld us of each second", runtime_us),
               true, "sysctl -w kernel.sched_rt_runtime_us=950000");
}

static void check_limit(struct patient *const p, const char *const limits, const char *const name,
                        const long long wanted, const char *const what)
{
    long long value = 0;
    if (!text_named_number(limits, name, &value))
        find(p->findings, name, GRADE_UNKNOWN, "%s: not known", what);
    else if (value == -1 || value >= wanted)
        find(p->findings, name, GRADE_OK, "%s: allowed", what);
    else
        remedy(find(p->findings, name, GRADE_ADVICE, "%s: this user may not (limit %lld, needed %lld)", what, value,
                    wanted),
               false, "echo '@%s - %s %lld' > /etc/security/limits.d/hm2.conf (then log in again)", "realtime", name,
               strcmp(name, "memlock") == 0 ? wanted / 1024 : 99LL);
}

static void check_limits(struct patient *const p)
{
    char limits[256] = "";
    long long root = 0;
    if (state_text(p->state, limits, sizeof limits, "doctor/limits") && text_named_number(limits, "root", &root) &&
        root) {
        find(p->findings, "limits", GRADE_OK,
             "looked at by root, who has no limits; ask as the user that runs the machine");
        return;
    }
    check_limit(p, limits, "rtprio", RT_PRIORITY, "realtime priority");
    check_limit(p, limits, "memlock", RT_MEMORY_BYTES, "memory that stays in place");
}

static void check_isolation(struct patient *const p)
{
    char isolated[256] = "", online[256] = "";
    if (!state_text(p->state, online, sizeof online, "sys/devices/system/cpu/online"))
        return;
    (void)state_text(p->state, isolated, sizeof isolated, "sys/devices/system/cpu/isolated");
    if (isolated[0])
        find(p->findings, "cpus", GRADE_OK, "processors %s of %s are kept free of other work", isolated, online);
    else if (strcmp(online, "0") == 0)
        find(p->findings, "cpus", GRADE_ADVICE,
             "there is one processor only: the cycle shares it with everything else");
    else
        remedy(find(p->findings, "cpus", GRADE_ADVICE, "no processor of %s is kept free for the cycle", online), false,
               "add isolcpus=%s to GRUB_CMDLINE_LINUX in /etc/default/grub, then update-grub and restart",
               strpbrk(online, "-,") ? strpbrk(online, "-,") + 1 : online);
}

static void check_governor(struct patient *const p)
{
    char governor[32];
    unsigned slow = 0, cpus = 0;
    for (; cpus < MAX_CPUS && state_text(p->state, governor, sizeof governor,
                                         "sys/devices/system/cpu/cpu%u/cpufreq/scaling_governor", cpus);
         cpus++)
        slow += strcmp(governor, "performance") != 0;
    if (cpus > 0 && slow == 0)
        find(p->findings, "governor", GRADE_OK, "processors run at full speed");
    else if (slow > 0)
        remedy(find(p->findings, "governor", GRADE_ADVICE, "%u of %u processors change their clock with the load", slow,
                    cpus),
               true, "for f in /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor; do echo performance > $f; done");
}

static void check_idle(struct patient *const p)
{
    char deepest[32] = "";
    long long worst_us = 0;
    unsigned states = 0;
    for (; states < MAX_IDLE_STATES; states++) {
        long long latency_us = 0, disabled = 0;
        if (!state_number(p->state, &latency_us, "sys/devices/system/cpu/cpu0/cpuidle/state%u/latency", states))
            break;
        (void)state_number(p->state, &disabled, "sys/devices/system/cpu/cpu0/cpuidle/state%u/disable", states);
        if (disabled == 0 && latency_us > worst_us) {
            worst_us = latency_us;
            (void)state_text(p->state, deepest, sizeof deepest, "sys/devices/system/cpu/cpu0/cpuidle/state%u/name",
                             states);
        }
    }
    if (states > 0 && worst_us <= SLOW_WAKE_US)
        find(p->findings, "c-states", GRADE_OK, "an idle processor is back within %lld us", worst_us);
    else if (states > 0)
        remedy(find(p->findings, "c-states", GRADE_ADVICE,
                    "an idle processor sleeps down to %s and needs %lld us to wake", deepest, worst_us),
               false,
               "add processor.max_cstate=1 intel_idle.max_cstate=1 to GRUB_CMDLINE_LINUX in /etc/default/grub, then "
               "update-grub and restart");
}

void check_computer(struct patient *const p)
{
    static void (*const checks[])(struct patient *) = {check_kernel,    check_throttling, check_limits,
                                                       check_isolation, check_governor,   check_idle};
    for (size_t i = 0; i < sizeof checks / sizeof checks[0]; i++)
        checks[i](p);
}
