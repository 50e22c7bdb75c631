/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unruly_link.h"

#include <string.h>

#define LATE_NS      INT64_C(20000000)
#define VERY_LATE_NS INT64_C(1000000000)

const char *unruly_name(const enum unruly what)
{
    static const char *const names[UNRULY_KINDS] = {[UNRULY_LOST] = "lost",
                                                    [UNRULY_TWICE] = "twice",
                                                    [UNRULY_SWAPPED] = "swapped with the next",
                                                    [UNRULY_LATE] = "late",
                                                    [UNRULY_VERY_LATE] = "1 s too late",
                                                    [UNRULY_GONE] = "lost with all that follow"};
    return names[what];
}

static bool concerned(struct unruly_link *const u, const bool reply)
{
    const uint64_t number = ++u->seen[reply];
    const struct unruly_fault *const f = &u->fault;
    return f->at > 0 && f->reply == reply && (number == f->at || (number > f->at && f->what == UNRULY_GONE));
}

static void hold(struct unruly_link *const u, const void *const data, const size_t len)
{
    u->holds = true;
    u->due_ns = INT64_MAX;
    u->held_len = len;
    memcpy(u->held, data, len);
}

/* What is held goes on at some time after the next one has been sent. */
static void next_was_sent(struct unruly_link *const u)
{
    const int64_t late_ns = u->fault.what == UNRULY_LATE ? LATE_NS : VERY_LATE_NS;
    if (u->holds && u->due_ns == INT64_MAX && (u->fault.what == UNRULY_LATE || u->fault.what == UNRULY_VERY_LATE))
        u->due_ns = link_now_ns(u->below) + late_ns;
}

static int send_held(struct unruly_link *const u)
{
    u->holds = false;
    return link_send(u->below, u->held, u->held_len);
}

static int unruly_send(struct link *const link, const void *const data, const size_t len)
{
    struct unruly_link *const u = (struct unruly_link *)link;
    const bool swap = u->holds && !u->fault.reply && u->fault.what == UNRULY_SWAPPED;
    next_was_sent(u);
    if (!concerned(u, false)) {
        const int err = link_send(u->below, data, len);
        return err == 0 && swap ? send_held(u) : err;
    }
    if (u->fault.what == UNRULY_LOST || u->fault.what == UNRULY_GONE)
        return 0;
    if (u->fault.what != UNRULY_TWICE) {
        hold(u, data, len);
        return 0;
    }
    const int err = link_send(u->below, data, len);
    return err == 0 ? link_send(u->below, data, len) : err;
}

/* A reply from below: its length when it goes on to the client, HM2_ERR_TIMEOUT when it does not (yet). */
static int take_reply(struct unruly_link *const u, const void *const data, const int len)
{
    if (!concerned(u, true)) {
        if (u->holds && u->fault.reply && u->fault.what == UNRULY_SWAPPED)
            u->due_ns = INT64_MIN;
        return len;
    }
    if (u->fault.what == UNRULY_LOST || u->fault.what == UNRULY_GONE)
        return HM2_ERR_TIMEOUT;
    hold(u, data, (size_t)len);
    if (u->fault.what != UNRULY_TWICE)
        return HM2_ERR_TIMEOUT;
    u->due_ns = INT64_MIN;
    return len;
}

static int give_held(struct unruly_link *const u, void *const data, const size_t cap)
{
    u->holds = false;
    if (u->held_len > cap)
        return HM2_ERR_NOSPACE;
    memcpy(data, u->held, u->held_len);
    return (int)u->held_len;
}

static int unruly_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                       const int64_t clock_ns)
{
    struct unruly_link *const u = (struct unruly_link *)link;
    (void)clock_ns;
    for (;;) {
        const bool due = u->holds && u->due_ns <= link_now_ns(u->below);
        if (due && u->fault.reply)
            return give_held(u, data, cap);
        const int sent = due ? send_held(u) : 0;
        if (sent < 0)
            return sent;
        const int64_t until_ns = u->holds && u->due_ns < deadline_ns ? u->due_ns : deadline_ns;
        int len = link_recv(u->below, data, cap, until_ns);
        if (len == HM2_ERR_TIMEOUT && until_ns == deadline_ns)
            return len;
        if (len >= 0)
            len = take_reply(u, data, len);
        if (len != HM2_ERR_TIMEOUT)
            return len;
    }
}

static int64_t unruly_now_ns(struct link *const link)
{
    return link_now_ns(((struct unruly_link *)link)->below);
}

static void unruly_close(struct link *const link)
{
    (void)link; /* the test owns it */
}

void unruly_link_init(struct unruly_link *const unruly, struct link *const below)
{
    static const struct link_ops ops = {
        .send = unruly_send, .recv = unruly_recv, .now_ns = unruly_now_ns, .close = unruly_close};
    *unruly = (struct unruly_link){.link.ops = &ops, .below = below};
}

void unruly_link_set(struct unruly_link *const unruly, const struct unruly_fault *const fault)
{
    unruly->fault = *fault;
    unruly->seen[0] = unruly->seen[1] = 0;
    unruly->holds = false;
}

void unruly_link_release(struct unruly_link *const unruly)
{
    if (unruly->holds && !unruly->fault.reply)
        (void)send_held(unruly);
    unruly->holds = false;
    unruly->fault.at = 0;
}
